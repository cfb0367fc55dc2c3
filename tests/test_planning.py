"""Scenes and certified motions: bounds against dense sampling, and what is refused."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from snakegen.control.controller import flight_controller
from snakegen.errors import PlanError, SceneError
from snakegen.planning.body import PlannedBody
from snakegen.planning.certificate import Certificate, certify
from snakegen.planning.follow import Chain, pose_of
from snakegen.planning.plan_file import RATE_FILTER, PlanFile, read_plan
from snakegen.planning.timing import rates_of, timed
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.robot import Robot, load
from snakegen.scene.schema import Demands, read_scene
from snakegen.scene.solids import Solid, from_json
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


def test_coal_and_solids_agree() -> None:
    import coal

    rng = np.random.default_rng(4)
    ball = coal.Sphere(1e-6)
    for solid in SOLIDS:
        again = from_json(solid.to_json())
        points = rng.uniform(-1.5, 1.5, (40, 3))
        for point, expected in zip(points, again.distances(points), strict=True):
            if expected > 1e-3:
                there = coal.Transform3s(solid.rotation, solid.centre)
                here = coal.Transform3s(np.eye(3), point)
                result = coal.DistanceResult()
                found = coal.distance(
                    solid.shape(), there, ball, here, coal.DistanceRequest(), result
                )
                assert found == pytest.approx(expected, abs=2e-5)


REFUSED = [
    ("obstacles: [{size: [1, 1, 1]}]", "obstacle 1: centre: 3 finite numbers"),
    ("obstacles: [{kind: bx}]", "Did you mean 'box'"),
    ("obstacles: [{centre: [0, 0, 1500], size: [3000, 3000, 40]}]", "divide by 1000"),
    ("obstacles: [{centre: [0, 0, 0], size: [0.003, 0.003, 0.001]}]", "multiplied by 1000"),
    (
        "obstacles: [{centre: [0, 0, 1], size: [1, 1, 0.1], openings: [{size: [2, 1]}]}]",
        "reaches beyond the plate",
    ),
    ("obstacles: []\nstart: {above: roof}", "no opening 'roof'"),
    ("obstacles: [{kind: mesh, file: none.stl}]", "none.stl: no such file"),
    ("obstacles: []\ndemands: {clearence: 1}", "Did you mean 'clearance'"),
    ("obstacles: []\nstart: {cog: [-2000, 0, 1200]}", "as millimetres it is 2 m"),
]


@pytest.mark.parametrize(("text", "message"), REFUSED, ids=[m for _, m in REFUSED])
def test_scenes_are_refused_in_words(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        read_scene(file)


def test_an_open_mesh_is_refused(tmp_path: Path) -> None:
    import trimesh

    mesh = trimesh.creation.box((0.4, 0.4, 0.4))
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    mesh.export(tmp_path / "open.stl")
    file = tmp_path / "scene.yaml"
    file.write_text("obstacles: [{kind: mesh, file: open.stl}]", encoding="utf-8")
    with pytest.raises(SceneError, match=r"open\.stl is not closed: 3 of 18 edges"):
        read_scene(file)


def test_a_cloud_becomes_balls_that_hold_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(0.0, 1.0, (20_000, 3))
    np.savetxt(tmp_path / "scan.csv", points, delimiter=",", header="x,y,z", comments="")
    file = tmp_path / "scene.yaml"
    file.write_text("obstacles: [{kind: points, file: scan.csv, radius: 0.02}]", encoding="utf-8")
    balls = [s for s in read_scene(file).solids if s.kind == "sphere"]
    assert len(balls) <= 2000
    centres, radius = np.array([b.centre for b in balls]), balls[0].size[0]
    away = np.linalg.norm(points[:200, None] - centres[None], axis=2).min(axis=1)
    assert np.all(away + 0.02 <= radius + 1e-9)


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


def test_tracking_errors_are_those_of_the_error_budget(robot: Robot, body: PlannedBody) -> None:
    """The planner's two largest sources against every source of the budget that judges flights."""
    from snakegen.planning.plan_file import SETTLING
    from snakegen.planning.tracking import MISMATCH, TILT, Tracking
    from snakegen.simulation.flight import error_budget
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
