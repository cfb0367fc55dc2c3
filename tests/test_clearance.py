"""Distances of a robot to itself: elastic links count as the links they are."""

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.simulation.flight.postures import place, resting_joints
from snakegen.simulation.flight.world import make_world
from snakegen.simulation.recording.clearance import clearances


@pytest.mark.parametrize("name", ["dragon3", "dragon4"])
def test_an_unbent_elastic_body_is_as_far_from_itself_as_a_rigid_one(name: str) -> None:
    """Else an apparatus' constant distance to the other half of its own link is told instead."""
    robot = snakegen.load(name)
    rng = np.random.default_rng(0)
    rest, cog = resting_joints(robot, None), np.array([0.0, 0.0, 2.0])
    angles = [rest, *(rest + rng.uniform(-0.5, 0.5, (6, rest.size)))]
    found = []
    for stiffness in (0.0, 1300.0):
        world = make_world(robot, link_stiffness=stiffness, link_damping=2e-4)
        data, rows = mujoco.MjData(world.model), []
        for posture in angles:
            data.qpos[:] = 0.0
            world.set_state(data, place(robot, posture, cog))
            rows.append(data.qpos.copy())
        found.append(clearances(world, np.array(rows)))
    (floor, own, _), (bent_floor, bent_own, _) = found
    assert np.allclose(own, bent_own, rtol=0, atol=1e-6) and np.ptp(own) > 1e-3
    assert np.allclose(floor, bent_floor, rtol=0, atol=1e-6)
