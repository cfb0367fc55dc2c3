"""Work arrays of the flight loop: on the stack, none made anew in a tick, none left behind."""

import numpy as np
import pytest
from numba import njit
from numba.core.runtime import _nrt_python, rtsys

from snakegen.control.controller import flight_controller
from snakegen.kernels.core.mat3 import matmul_into
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.robot.robot import load
from snakegen.simulation.flight.loop import fly
from snakegen.simulation.flight.plant import Imperfections, draw
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.missions import planned


@njit(_nrt=False)
def worked(a, n, out):
    """Fills arrays of known and of unknown shape and adds up what stands in them."""
    square, line, table, block = scratch((3, 3)), scratch(n), scratch((n, 2)), scratch((2, n, 3))
    matmul_into(a, a, square)
    for i in range(n):
        line[i] = i
        for k in range(2):
            table[i, k] = 10.0 * i + k
            for c in range(3):
                block[k, i, c] = 100.0 * k + 10.0 * i + c
    out[0], out[1] = square.sum(), line.sum()
    out[2], out[3] = table[n - 1, 1], block[1, n - 1, 2]


def test_scratch_is_an_array_of_its_shape():
    a, out = np.arange(9.0).reshape(3, 3), np.empty(4)
    for n in (1, 5, 40):
        worked(a, n, out)
        assert out == pytest.approx([(a @ a).sum(), n * (n - 1) / 2, 10 * (n - 1) + 1, 92 + 10 * n])


@pytest.mark.parametrize("mission, allocator", [("hover", "paper"), ("switch", "constrained")])
def test_a_flight_leaves_no_array_behind(mission, allocator):
    robot = load("dragon4")
    plan = planned(mission, robot, duration=6.0)
    c, world = flight_controller(robot, allocator=allocator), make_world(robot)
    what, rng = Imperfections.of(robot.modules.plant), np.random.default_rng(1)
    noise = draw(what, rng, len(plan.time), len(world.rotors), len(robot.joint_names))
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        flown = fly(world, plan, c, noise, what)
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    made, freed = after.mi_alloc - before.mi_alloc, after.mi_free - before.mi_free
    assert flown.ticks == len(plan.time)
    assert made - freed < 0.01 * flown.ticks, "an array a tick is lost"
    if mission == "hover":
        assert made < flown.ticks, "a tick makes arrays"  # some 100 a call from Python
