"""Scenes and certified motions: bounds against dense sampling, and what is refused."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from snakegen.errors import PlanError
from snakegen.planning.body import PlannedBody
from snakegen.planning.certificate import Certificate, certify
from snakegen.planning.follow import Chain, pose_of
from snakegen.planning.plan_file import PlanFile, read_plan
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


def sampled(body: PlannedBody, path: Trajectory, count: int) -> dict[str, float]:
    """Returns the least of each quantity at evenly spaced instants."""
    outer, clear, own, points = body.shapes.outer, np.inf, np.inf, []
    for t in np.linspace(0.0, path.times[-1], count):
        now = body.at_pose(path.at(t))
        found = body.distances(now.q)
        clear = min(clear, found[:outer].min() - now.slack)
        own = min(own, found[outer:].min())
        points.append(now.points)
    force, torque = body.margins(np.array(points), 1e-3)
    return {
        "clearance": clear,
        "self_clearance": own,
        "force_margin": float(force.min()),
        "torque_margin": float(torque.min()),
    }


@pytest.fixture(scope="module")
def certificate(body: PlannedBody, path: Trajectory) -> Certificate:
    return certify(body, path, most=6000)


def test_bounds_hold_at_every_sample(
    body: PlannedBody, path: Trajectory, certificate: Certificate
) -> None:
    found = sampled(body, path, 1500)
    for name, bound in certificate.bounds().items():
        assert bound.lower <= found[name], name
        assert bound.lower <= bound.seen, name
    assert certificate.clearance.closed
    assert found["clearance"] - certificate.clearance.lower < 3e-3  # and they are no idle ones


def test_a_middle_alone_is_no_bound(body: PlannedBody, path: Trajectory) -> None:
    """The least value at a few instants lies above what is proved: bisection is needed."""
    few = sampled(body, path, 5)
    assert few["clearance"] > sampled(body, path, 400)["clearance"] + 1e-4


def test_the_least_seen_is_that_of_samples_where_the_search_stops_early(
    body: PlannedBody, path: Trajectory
) -> None:
    """Demands that every interval meets end the search of margins at once."""
    early = certify(body, path, enough={"force_margin": -1e3, "torque_margin": -1e3})
    fine = sampled(body, path, 400)
    for name in ("force_margin", "torque_margin"):
        assert early.bounds()[name].lower <= fine[name]
        assert early.bounds()[name].seen <= fine[name] + 0.005 * abs(fine[name])


def test_swing_covers_each_piece(path: Trajectory) -> None:
    rng = np.random.default_rng(0)
    for start, end in path.pieces():
        a, b = np.sort(rng.uniform(start, end, 2))
        middle, swing = path.swing(a, b)
        away = np.abs(path.at(np.linspace(a, b, 50)) - middle)
        assert np.all(away[:, 6:] <= swing.joints + 1e-12)
        assert np.linalg.norm(away[:, :3], axis=1).max() <= swing.shift + 1e-12


def test_reach_bounds_displacements(body: PlannedBody) -> None:
    """Points of shapes and thrust points move no more than Σ κ |Δq| from the CoG."""
    rng = np.random.default_rng(1)
    reach, shapes = body.reach, body.shapes
    for _ in range(50):
        pose = np.concatenate([[0, 0, 2.0], rng.normal(0, 1, 3), rng.uniform(-1.2, 1.2, 6)])
        other = pose.copy()
        other[6:] += rng.normal(0, 0.3, 6)
        seen = []
        for x in (pose, other):
            now = body.at_pose(x)
            at = [
                body.data.oMi[j].act(c) for j, c in zip(shapes.joints, shapes.centres, strict=True)
            ]
            seen.append((np.array(at), now.points))
        turn = np.abs(other[6:] - pose[6:])
        moved = np.linalg.norm(seen[0][0] - seen[1][0], axis=1)
        assert np.all(moved <= reach.shapes @ turn + 1e-9)
        moved = np.linalg.norm(seen[0][1] - seen[1][1], axis=1)
        assert np.all(moved <= reach.points @ turn + 1e-9)


def test_the_body_is_where_hovering_gimbals_put_it(robot: Robot, body: PlannedBody) -> None:
    rng = np.random.default_rng(2)
    looked = 0
    pitches = [robot.joint_names.index(a.pitch) for a in robot.modules.apparatuses]
    for _ in range(20):
        pose = np.concatenate([[0, 0, 2.0], rng.normal(0, 0.6, 3), rng.uniform(-1.2, 1.2, 6)])
        now = body.turned(0.7).at_pose(pose)
        q = place(robot, pose[6:], pose[:3], body.turned(0.7).attitude(pose[3:6]))
        if np.abs(robot.angles(q)[pitches]).max() < 0.5 * np.pi:
            looked += 1
            assert np.linalg.norm(q[:3] - now.q[:3]) <= now.slack + 1e-9
    assert looked > 5


def test_rates_keep_their_limits(body: PlannedBody, path: Trajectory) -> None:
    t = np.linspace(0.0, path.times[-1], 5000)
    rates = rates_of(body, Demands())
    speed, bend = path.at(t, 1), path.at(t, 2)
    assert np.abs(speed[:, 6:]).max() <= 0.31 * 1.02
    assert np.linalg.norm(speed[:, :3], axis=1).max() <= rates.speed * 1.02
    assert np.abs(bend[:, 6:]).max() <= rates.acceleration[2] * 1.05


def test_links_follow_their_nodes(body: PlannedBody, robot: Robot) -> None:
    chain = Chain(body)
    q = body.neutral.copy()
    q[body.at] = bent(robot)
    nodes = chain.line(q)[::-1] + np.array([0.02, 0.01, 0.0])
    found, miss = chain.fit(nodes, q)
    assert miss < 1e-3
    assert np.allclose(pose_of(body, found)[:2] - pose_of(body, q)[:2], [0.02, 0.01], atol=1e-3)


def test_a_plan_survives_its_file(body: PlannedBody, path: Trajectory) -> None:
    from snakegen.base import yaml_file

    file = PlanFile("dragon4", body.names, path, SOLIDS, None, vars(Demands()))
    again = read_plan(yaml_file.parse(file.to_text(), "plan"), "plan")
    assert np.array_equal(again.path.poses, path.poses)
    assert np.array_equal(again.path.times, path.times)
    assert [s.name for s in again.solids] == [s.name for s in SOLIDS]
    with pytest.raises(PlanError, match="waypoint 2: time: 1 finite"):
        data = yaml_file.parse(file.to_text(), "plan")
        data["waypoints"][1]["time"] = "soon"
        read_plan(data, "plan")


def test_robots_that_cannot_be_planned_for_say_why() -> None:
    for name, why in (("arm6", "does not fly"), ("dragon3", "dual-rotor mode")):
        with pytest.raises(PlanError, match=why):
            PlannedBody(load(name))


def test_a_motion_is_drawn(body: PlannedBody, path: Trajectory, tmp_path: Path) -> None:
    """Its rods are where the forward kinematics of the drawn instant put them."""
    from types import SimpleNamespace

    from snakegen.planning.strobe_instants import draw_motion, instant
    from snakegen.scene.schema import Scene

    motion = SimpleNamespace(path=path, body=body)
    now = instant(motion, 1.0)  # type: ignore[arg-type]
    q = body.at_pose(path.at(1.0)).q
    assert np.allclose(now.line, Chain(body).line(q), atol=1e-9)
    assert len(now.discs) == 4
    file = tmp_path / "motion.png"
    draw_motion(file, motion, Scene("test", SOLIDS), count=2)  # type: ignore[arg-type]
    assert file.read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("good", [True, False])
def test_an_interrupted_search_keeps_what_it_has(
    monkeypatch: pytest.MonkeyPatch, good: bool
) -> None:
    """Ctrl-C at the third seed: the two before are kept if one will do, else nothing is."""
    from types import SimpleNamespace

    from snakegen.planning import seed_choice
    from snakegen.planning.seeds import Family

    looked: list[float] = []

    def judge(seed: object, step: float, demands: Demands) -> SimpleNamespace:
        if len(looked) == 2:
            raise KeyboardInterrupt
        looked.append(step)
        worth = len(looked) if good else -11.0
        return SimpleNamespace(miss=0.0, clearance=0.1, torque=1.0, worth=lambda _: worth)

    monkeypatch.setattr(seed_choice, "judge", judge)
    family = [SimpleNamespace(family=Family(True, 0.4, 0.0, 0.0))] * 5
    words: list[str] = []
    begin = [family, family]
    if good:
        found = seed_choice.look(begin, Demands(), np.inf, words.append)  # type: ignore[arg-type]
        assert [worth for worth, _, _ in found] == [2, 1]
        assert words[-1].startswith("interrupted")
    else:
        with pytest.raises(KeyboardInterrupt):
            seed_choice.look(begin, Demands(), np.inf, words.append)  # type: ignore[arg-type]


def test_waves_swing_to_both_sides_and_fade() -> None:
    from snakegen.planning.curves import waved

    line = waved(np.array([[0.0, 0.0, 1.0], [3.0, 0.0, 1.0]]), 0.2, 2.0)
    assert line[:, 1].max() == pytest.approx(0.2, abs=0.01)
    assert line[:, 1].min() == pytest.approx(-0.2, abs=0.01)
    assert np.allclose(line[[0, -1]], [[-1.0, 0.0, 1.0], [4.0, 0.0, 1.0]])
    slope = np.abs(np.diff(line[:, 1])) / np.diff(line[:, 0])
    assert slope[0] < 0.02 and slope[-1] < 0.02  # the turns before and after go on straight
    upward = waved(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]]), 0.2, 2.0)
    assert np.abs(upward[:, :2]).max() < 1e-9


def test_printed_bounds_are_never_above_what_is_proved() -> None:
    from snakegen.planning.certificate import rounded_down

    for value in np.random.default_rng(0).normal(size=1000) * 10.0 ** np.arange(-5, 5).repeat(100):
        assert value - 1.2e-5 * abs(value) <= rounded_down(float(value)) <= value


def test_a_plan_beyond_the_battery_is_not_met(body: PlannedBody, path: Trajectory) -> None:
    """Its energy is that of the hover thrusts, by the power model of flights."""
    from snakegen.planning.hover_actuation import HELD, battery_share
    from snakegen.simulation.recording.rotor_signals import power

    robot = body.robot
    share = battery_share(body, path)
    even = power(robot, np.full((1, 8), body.weight / 8.0))[0]
    watt_hours = float(robot.modules.plant["battery_energy"])
    right = even * (path.times[-1] + 2.0 * HELD) / (3600.0 * watt_hours)
    assert right <= share <= 1.15 * right  # unequal thrusts take more, by convexity
