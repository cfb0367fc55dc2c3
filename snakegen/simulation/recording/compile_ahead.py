"""Compiles parts of a first flight in a process of its own, while the flight itself compiles.

Numba compiles on one core. What this process has put into the cache by the time that the flight
needs it, the flight does not compile again: parts of the controller that it comes to late, and the
margins of its log. Types are those of the robot's own arrays; one that were not the flight's would
cost a process some seconds in vain and nothing else.
"""

import os
import subprocess
import sys
from typing import Any

import numba
import numpy as np

from snakegen.control.controller import MODES, flight_controller
from snakegen.kernels.allocation.compliance import yielding_answer
from snakegen.kernels.allocation.constrained_allocation import bounded_answer
from snakegen.kernels.allocation.types import (
    Limits,
    Previous,
    RotorBounds,
    Task,
    VirtualAnswer,
)
from snakegen.kernels.control.types import VIRTUAL, Command, Measured
from snakegen.kernels.control.vibration_damping import damped
from snakegen.kernels.core.jit import cold
from snakegen.kernels.dynamics.joint_loads import JointLoads
from snakegen.kernels.flight.types import Damper
from snakegen.robot.robot import Robot, load
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.thrust import thrust_margins
from snakegen.wrench_margins.vectored import set_margins

ANY = "dragon4"  # the types of arrays are the same for every robot


def compile_ahead(robot: Robot) -> None:
    """Starts the process where there is a second core and a flight has yet to be compiled."""
    if not robot.modules.apparatuses or (os.cpu_count() or 1) < 2 or not cold():
        return
    mode = str(robot.modules.control.get("mode", "virtual_single_rotor"))
    virtual = MODES.get(mode) == VIRTUAL and bool(robot.gimbal_names)
    command = [sys.executable, "-m", "snakegen.simulation.recording.compile_ahead"]
    null = subprocess.DEVNULL
    subprocess.Popen([*command, str(int(virtual))], stdin=null, stdout=null, stderr=null)


def compile_for(kernel: Any, *examples: Any) -> None:
    """Compiles a kernel for arguments of the types of `examples`."""
    kernel.compile(tuple(numba.typeof(x) for x in examples))


def controller_parts() -> None:
    """Compiles what a flight comes to late: limits, compliant gimbals, vibration damping."""
    c = flight_controller(load(ANY))
    one, two, three = (np.zeros((1,) * k) for k in range(1, 4))
    whole, pairs = np.zeros(1, np.int64), np.zeros((1, 1), np.int64)
    loads = JointLoads(two, one, one)
    task, limits = Task(one, one), Limits(one, two, two)
    virtual = VirtualAnswer(one, two, three, one)
    compile_for(
        bounded_answer, three, task, limits, Previous(two, one, one), True, loads, one, virtual
    )
    bounds = RotorBounds(one, one, 0, loads)
    compile_for(yielding_answer, three, three, two, two, two, one, one, bounds, one, two)
    damper = Damper(0.0, whole, two, two, pairs, whole, whole, two, two, one, two, 0.0)
    measured = Measured(two, one, one, one, one, one, one)
    command = Command(one, two, one, one, 0.0, 0, 0.0, 0)
    compile_for(damped, c.mechanism, c.law, damper, measured, one, two, 0.0, command)


def margins(virtual: bool) -> None:
    """Compiles the margins of a mode by measuring two postures of a made-up body."""
    rng, up = np.random.default_rng(0), np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    scales: dict[str, Any] = {"force_scale": 1.0, "torque_scale": 1.0}
    if virtual:
        set_margins(ForceSets.free(rng.normal(size=(2, 4, 3)), 1.0), up, **scales)
    else:
        thrust_margins(rng.normal(size=(2, 6, 8)), 0.0, 1.0, up, **scales)


if __name__ == "__main__":
    controller_parts()
    margins(sys.argv[1] != "0")
