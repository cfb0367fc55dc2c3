"""Plans against the body that flies them: tracking errors, rates, hover forces, low-pass."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from snakegen.control.controller import flight_controller
from snakegen.planning.body import PlannedBody
from snakegen.planning.plan_file import RATE_FILTER, PlanFile
from snakegen.planning.timing import rates_of, timed
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.robot import Robot, load
from snakegen.scene.schema import Demands
from snakegen.scene.solids import Solid
from snakegen.simulation.flight.postures import bent, place

TURN = pin.utils.rpyToMatrix(0.0, 0.0, 1.0)
SOLIDS = (
    Solid("plate", "box", np.array([0.1, 0.0, 0.75]), TURN, (0.4, 0.5, 0.02)),
    Solid("post", "cylinder", np.array([-0.9, 0.4, 1.0]), np.eye(3), (0.05, 1.0)),
    Solid("ground", "half_space", np.zeros(3)),
)
STEEP_POSE = np.array(
    [0.26, -0.22, 1.23, 0.69, 0.65, 0.12, 0.01, -0.11, -0.8, -0.02, -0.16, 0.66]
)  # a root link 54° below the horizontal, headed -45°


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load("dragon4")


@pytest.fixture(scope="module")
def body(robot: Robot) -> PlannedBody:
    return PlannedBody(robot, SOLIDS)


@pytest.fixture(scope="module")
def path(body: PlannedBody) -> Trajectory:
    """A motion that turns, bends and passes a vertical link."""
    rng = np.random.default_rng(3)
    poses = np.zeros((5, 12))
    poses[:, 2] = 1.3
    poses[:, :3] += rng.uniform(-0.1, 0.1, (5, 3))
    poses[:, 3:6] = np.cumsum(rng.uniform(-0.4, 0.4, (5, 3)), axis=0)
    poses[:, 6:] = bent(body.robot) + rng.uniform(-0.5, 0.5, (5, 6))
    return timed(poses, rates_of(body, Demands()))


def test_tracking_errors_are_those_of_the_error_budget(robot: Robot, body: PlannedBody) -> None:
    """The planner's two largest sources against every source of the budget that judges flights."""
    from snakegen.planning.plan_file import SETTLING
    from snakegen.planning.tracking import MISMATCH, TILT, Tracking
    from snakegen.simulation.flight.bounds import error_budget
    from snakegen.simulation.flight.planned import follow
    from snakegen.simulation.flight.plant import Imperfections

    usual = Imperfections()
    assert (usual.thrust_mismatch, usual.attitude_bias) == (MISMATCH, TILT)
    poses = np.array([STEEP_POSE, STEEP_POSE])
    poses[0, 3:] = [0.0, 0.0, 0.3, *bent(robot)]
    path = Trajectory(np.array([0.0, 6.0]), poses, -0.7854)
    times = np.linspace(0.0, 6.0, error_budget.INSTANTS)
    found = Tracking(body.turned(path.heading)).errors(path.at(times), times)
    plan = follow(robot, path, np.arange(0.0, 6.0, 0.005), np.arange(0.0, 6.0, 0.005),
                  settling=SETTLING)  # fmt: skip
    right = error_budget.moving_errors(robot, flight_controller(robot), plan, usual)
    for pose, mine, other in zip(path.at(times), found, right, strict=True):
        axes = body.turned(path.heading).attitude(pose[3:6])
        turned = np.concatenate([mine[:3], axes.T @ mine[3:]])
        sizes = [np.linalg.norm(e, axis=1) for e in (turned, other)]
        assert np.all(np.abs(sizes[0] - sizes[1]) <= 0.15 * sizes[1] + 1e-3), sizes


def test_slowing_keeps_gimbals_and_thrusts_within_their_rates(
    body: PlannedBody, path: Trajectory
) -> None:
    from snakegen.planning.hover_actuation import actuation, actuator_use
    from snakegen.planning.timing import slowed

    few = Demands(gimbal_rate=0.3, thrust_rate=1.0)
    assert actuator_use(body, path, few).max() > 1.0  # the pace before is too fast for them
    slower = slowed(path, rates_of(body, few), lambda p: actuator_use(body, p, few))
    t = np.linspace(0.0, slower.times[-1], 4000)
    found = actuation(body, slower.at(t), slower.at(t, 2)[:, :3])
    assert np.abs(np.diff(found.thrust, axis=0)).max() / (t[1] - t[0]) <= 1.05
    turned = np.abs(np.diff(found.angles, axis=0)) / (t[1] - t[0])
    assert turned[..., 1].max() <= 0.3 * 1.05
    assert turned[..., 0][found.across[1:] > 0.35].max() <= 0.3 * 1.05


def test_hover_forces_hold_the_body(robot: Robot, body: PlannedBody) -> None:
    """Against the allocation of the posture with its gimbals at hover."""
    from snakegen.analysis.allocation import allocation
    from snakegen.planning.hover_actuation import actuation

    now = actuation(body, STEEP_POSE[None])
    points = body.at_pose(STEEP_POSE).points
    assert np.allclose(now.forces[0].sum(axis=0), [0.0, 0.0, body.weight], atol=1e-9)
    assert np.abs(np.cross(points, now.forces[0]).sum(axis=0)).max() < 1e-9
    q = place(robot, STEEP_POSE[6:], STEEP_POSE[:3], body.attitude(STEEP_POSE[3:6]))
    a = allocation(robot, q)
    turn = body.attitude(STEEP_POSE[3:6])
    weight = np.concatenate([turn.T @ [0.0, 0.0, body.weight], np.zeros(3)])
    forces = (np.linalg.pinv(a.force) @ weight).reshape(-1, 3)
    size = np.linalg.norm(forces, axis=1)
    assert np.allclose(now.thrust[0], size, atol=0.05 * size.max())


def test_the_low_pass_of_plans_keeps_roll_gimbals_of_steep_links_quiet(
    robot: Robot, body: PlannedBody, tmp_path: Path
) -> None:
    """Without it they swing at their torque limit; a hover in one steep posture shows it."""
    from snakegen.simulation.flight.run import prepare

    near = STEEP_POSE + 0.01 * (np.arange(12) == 2)
    path = Trajectory(np.array([0.0, 2.0]), np.array([STEEP_POSE, near]), -0.7854)
    shares = []
    for cutoff in (0.0, RATE_FILTER):
        file = PlanFile("dragon4", body.names, path, (), None, {}, cutoff)
        file.write(tmp_path / "hold.yaml")
        ready = prepare(robot, str(tmp_path / "hold.yaml"), options={"trim": 0.0})
        noise = np.random.default_rng(0)
        flown = ready.flown(ready.world(), ready.imperfections, noise, 0, margins=False)
        shares.append(flown.metrics["gimbal_torque_limit_share"])
    assert shares[0] > 0.05 and shares[1] == 0.0
