"""Joint torque maps of a robot, and the joint-limited margins that rest on them."""

import numpy as np
import pytest

from benchmarks.rank_table import plain_robot, posture
from snakegen.analysis import wrench_margin
from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import move_wrench
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot, load
from snakegen.statics.joint_loads import joint_loads
from snakegen.statics.joint_torques import joint_torques


def chain_rows(robot: Robot) -> list[int]:
    return [robot.model.joints[robot.model.getJointId(n)].idx_v for n in robot.chain_joints]


@pytest.mark.parametrize("seed", range(3))
def test_maps_add_up_to_the_general_law(seed: int) -> None:
    """τ = bias + M λ + D w_d is what `joint_torques` gives for the same wrenches."""
    robot, rng = load("dragon4"), np.random.default_rng(seed)
    angles = {n: rng.uniform(-1, 1) for n in robot.joint_names}
    q = robot.configuration(angles, base_rpy=rng.uniform(-1, 1, 3))
    thrust, disturbance = rng.uniform(0, 16, 8), rng.normal(size=6)
    loads, a, base = joint_loads(robot, q, "link3"), allocation(robot, q), robot.base_pose(q)[0]
    # the same disturbance, moved from the CoG to the origin of link3, in world axes
    from snakegen.kernels.kinematics.chain import forward

    rotation, position = forward(robot.tree, base, np.zeros(3), robot.angles(q))
    body, _, at = robot.body_of_link("link3")
    lever = base.T @ (position[body] + rotation[body] @ at) - a.cog
    moved = move_wrench(disturbance, -lever)
    world = np.concatenate([base @ moved[:3], base @ moved[3:]])
    whole = joint_torques(robot, q, terms="static", thrust=thrust, wrenches={"link3": world})
    parts = loads.bias + loads.rotors @ thrust + loads.disturbance @ disturbance
    assert parts == pytest.approx(whole[chain_rows(robot)], abs=1e-12)


def test_forces_of_apparatuses_are_the_rotors_in_sum() -> None:
    """Equal thrusts without drag act like the apparatus' force at its point."""
    robot = load("dragon4")
    q = hover_gimbals(robot, robot.configuration({"joint1_yaw": 0.7, "joint2_pitch": -0.4}))
    loads, a = joint_loads(robot, q), allocation(robot, q)
    for j in range(4):
        mine = robot.rotors.apparatus == j
        force = a.rotor_axes[mine].sum(axis=0)
        # counter-rotating drags cancel, so the pair is a pure force
        assert loads.rotors[:, mine].sum(axis=1) == pytest.approx(
            loads.forces[:, j] @ force, abs=1e-12
        )


def test_the_published_example() -> None:
    """THEORY A5: four links, planar 60°, 64 N an apparatus, 7 N·m joints, root disturbed."""
    robot = plain_robot(4, offset=0.0)
    q = hover_gimbals(robot, robot.configuration(posture(4, "planar")))
    found = wrench_margin.analyze(robot, q)
    limited = found.joint_limited["virtual_single_rotor"]
    assert found.vectored["force"].value == pytest.approx(177.5, abs=0.05)
    assert limited.force[0] <= 53.7 + 0.05 and limited.force[1] == pytest.approx(53.7, abs=0.08)
    assert limited.torque[1] == pytest.approx(13.2, abs=0.05)
    assert set(limited.joints) <= set(robot.chain_joints) and limited.joints


def test_the_place_of_the_disturbance_matters() -> None:
    robot = load("dragon4")
    q = hover_gimbals(robot, robot.configuration({f"joint{i}_yaw": 1.0 for i in (1, 2, 3)}))
    at = {n: wrench_margin.analyze(robot, q, link=n) for n in ("link1", "link2")}
    forces = [m.joint_limited["virtual_single_rotor"].force[0] for m in at.values()]
    assert abs(forces[0] - forces[1]) > 1.0
    free = at["link1"].vectored["force"].bounds[1]
    assert max(forces) <= free + 1e-6
