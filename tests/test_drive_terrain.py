"""Drives over and through things: boxes, ducts, pipes, rough ground, ledges."""

import math

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from snakegen.errors import MissionError
from snakegen.robot.robot import load
from snakegen.screw_drive.geometry import drive_geometry
from snakegen.simulation.drive.gait import Pace, crossing, reaches
from snakegen.simulation.drive.plan import DrivePlan, following
from snakegen.simulation.drive.run import contact_model, run_contact
from snakegen.simulation.drive.stance import Heights, Stance, depth
from snakegen.simulation.flight.plan import Box
from snakegen.simulation.flight.run import run
from snakegen.simulation.missions.drive.pipe import TAIL, braced, fitted
from snakegen.simulation.obstacles import pipe
from snakegen.simulation.run_settings import RunSettings
from snakegen.spec.loading import load_spec


@pytest.fixture(scope="module")
def screw4():
    return load("screw4")


@pytest.fixture(scope="module")
def quick():
    """A drive with balls for drums: the same missions at eight times the speed."""
    return load(load_spec("screw4", overrides=["screw_drive.rollers=ball"]))


def short(robot, **more):
    """Returns a plan of 3 s ahead and its reference."""
    reference = following(robot, [("line", 0.4)], 0.2, 0.4)
    plan = {"reference": reference, "start": reference.at(0.0)[0], "duration": 3.0}
    return DrivePlan(**(plan | more))


def test_a_box_in_the_way_stops_it(quick):
    """The ground of a mission is real: the same drive against a block does not get there."""
    block = Box("block", (0.25, 0.0, 0.2), (0.05, 0.5, 0.2))
    free = run_contact(quick, short(quick), RunSettings(ideal=True))
    stopped = run_contact(quick, short(quick, obstacles=(block,)), RunSettings(ideal=True))
    assert free.rows["state"][-1, 0] > 0.35 > 0.3 > stopped.rows["state"][-1, 0]


def test_duct_no_wider_than_the_body(screw4):
    recording = run(screw4, "gap", options={"length": 0.3, "entry": 0.1})
    found = recording.metrics
    assert recording.verdict.passed, recording.verdict.summary()
    assert recording.meta["facts"]["width_m"] == pytest.approx(0.15)
    assert found["wheel_load_max_n"] > 2 * found["open_ground_wheel_load_max_n"]  # it presses


def test_round_pipe_a_little_wider_than_the_body(screw4):
    """It drives through, walls touching; a pipe narrower than the drums stops it at the mouth."""
    way = {"length": 0.3, "entry": 0.1, "speed": 0.25, "room": 0.0}
    with pytest.raises(MissionError, match=r"0\.12 m apart; a pipe 0\.15 m .* 0\.025 m"):
        run(screw4, "pipe", options=way | {"fit": False})
    assert fitted(screw4, 0.075, 0.0, 16, True).modules.casters[0].track == 0.025
    assert fitted(screw4, 0.4, 0.0, 16, True).modules.casters[0].track == 0.12  # it fits as it is
    with pytest.raises(MissionError, match="6 to 64"):
        run(screw4, "pipe", options={"staves": 4})
    robot = load(load_spec("screw4", overrides=["caster.track=0.02"]))
    through = run(robot, "pipe", options=way)
    found = through.metrics
    assert through.verdict.passed, through.verdict.summary()
    assert sum(found["wheel_load_mean_n"]) > robot.force_scale  # walls press, not weight alone
    assert found["wheel_load_max_n"] > 2 * found["open_ground_wheel_load_max_n"]
    assert found["cone_use_mean"] > found["open_ground_cone_use_mean"]
    stuck = run(robot, "pipe", options=way | {"room": -0.004, "duration": 4.0}).metrics
    assert stuck["distance_end_m"] > 0.3


def test_staves_stand_round_a_pipe(screw4):
    """Rays from the axis meet the polygon about the circle, the ground its lowest side."""
    radius, staves = 0.08, 12
    model = contact_model(screw4, pipe((1.0, 2.0), radius, staves))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for angle in np.linspace(0.1, 2 * math.pi, 29):
        ray = np.array([0.0, math.sin(angle), -math.cos(angle)])
        hit = np.zeros(1, np.int32)
        far = mujoco.mj_ray(model, data, np.array([1.5, 0.0, radius]), ray, None, 1, -1, hit, None)
        off = math.remainder(angle, 2 * math.pi / staves)
        assert far == pytest.approx(radius / math.cos(off), rel=1e-9)


def test_soft_pitch_joints_help_on_rough_ground(screw4):
    short_way = {"length": 0.6, "speed": 0.2}
    soft = run(screw4, "rough", options=short_way)
    stiff = run(screw4, "rough", options=short_way | {"compliance": 1.0})
    air = [np.mean(r.metrics["airborne_share"]) for r in (soft, stiff)]
    assert air[0] < air[1] and soft.metrics["distance_end_m"] < 0.03


def test_pitch_joints_lift_the_body_over_a_ledge(quick):
    """Item 7 of the drive's plan, at 30 mm; without lifting the same drive does not get over."""
    with pytest.raises(MissionError, match="four or more screw drums"):
        run(load(load_spec("screw4", links=3)), "ledge")
    with pytest.raises(MissionError, match=r"0\.904 m: two"):
        run(quick, "ledge", options={"length": 0.5})
    way = {"length": 0.95, "speed": 0.2, "gain": 1.0}
    lifted = run(quick, "ledge", options=way)
    flat = run(quick, "ledge", options=way | {"lift": False, "duration": 15.0})
    assert lifted.verdict.passed, lifted.verdict.summary()
    assert lifted.meta["facts"]["ledge_m"] == 0.03
    assert lifted.channel("position").values[:, 2].max() > 0.075 + 0.03
    assert flat.metrics["distance_rmse_settled_m"] > 5 * lifted.metrics["distance_rmse_settled_m"]


def test_no_drum_stands_across_an_edge_and_never_two_are_up(screw4):
    """Along the whole gait, from its own states: the rule that the mission lives by."""
    edges, height = (0.4, 1.6), 0.03
    gait = crossing(screw4, edges, height, Pace(0.1, 0.4), 0.4)
    reach = reaches(screw4, drive_geometry(screw4))
    for t in np.arange(0.0, gait.duration, 0.05):
        x, shape, floor = gait.state(float(t))
        at = x + gait.stance.places(shape)[1][:, 0]
        turn = np.abs(np.cos(gait.stance.headings(shape)))
        low, high = at - turn * reach[:, 1], at + turn * reach[:, 0]
        for k in range(4):
            under = max((h for a, b, h in ((edges[0], edges[1], height),) if a < high[k] and
                         low[k] < b), default=0.0)  # fmt: skip
            assert floor[k] >= under - 1e-9
        up = (floor > 1e-9) & (np.abs(floor - height) > 1e-9)
        assert up.sum() <= 1
        if up.any():
            assert gait.stance.margin(shape, int(np.flatnonzero(up)[0])) > 0.005
    _, end, _ = gait.state(gait.duration)
    assert np.allclose(gait.at(gait.duration)[0][3:], end, atol=1e-9)


def test_depth_in_a_stance_is_the_hulls(screw4):
    rng = np.random.default_rng(4)
    for count in (3, 4, 5):
        for _ in range(20):
            points, inside = rng.normal(size=(count, 2)), 0.7 * rng.normal(size=2)
            hull = ConvexHull(points).equations
            assert depth(points, inside) == pytest.approx(
                -(hull[:, :2] @ inside + hull[:, 2]).max()
            )
    stance = Stance(screw4)
    assert stance.margin(np.zeros(3), 0) == pytest.approx(0.0, abs=1e-9)  # straight: a line
    assert stance.margin(np.full(3, 0.5), 0) < 0 < stance.margin(np.full(3, 0.5), 1)


def test_joints_of_a_lifted_body_put_its_nodes_there(screw4):
    """Forward kinematics by Pinocchio gives back the headings and heights asked for."""
    g = drive_geometry(screw4)
    rng = np.random.default_rng(5)
    heights = Heights(g)
    for _ in range(10):
        z, shape = rng.uniform(0, 0.05, 5), rng.uniform(-0.6, 0.6, 3)
        headings = 0.4 + np.concatenate([[0.0], np.cumsum(shape)])
        pitch, yaw = heights.joints(z, headings)
        names = {f"joint{i + 1}_{n}": v[i] for n, v in (("pitch", pitch), ("yaw", yaw))
                 for i in range(3)}  # fmt: skip
        steep = float(np.arcsin((z[0] - z[1]) / g.lengths[0]))
        q = screw4.configuration(names, base_rpy=(0.0, steep, 0.4), base_position=(0, 0, z[0]))
        data = screw4.model.createData()
        pin.framesForwardKinematics(screw4.model, data, q)
        for i in range(4):
            frame = data.oMf[screw4.model.getFrameId(f"link{i + 1}")]
            along = frame.rotation[:, 0]
            assert frame.translation[2] == pytest.approx(z[i], abs=1e-12)
            assert math.atan2(along[1], along[0]) == pytest.approx(headings[i], abs=1e-12)


def test_heights_over_a_ledge_are_the_constrained_least_squares(screw4):
    """The least-distance solution against a general solver; no drum below its floor."""
    heights = Heights(drive_geometry(screw4))
    for floor in ((0.038, 0, 0, 0), (0.03, 0.038, 0, 0), (0.03, 0.03, 0.02, 0), (0, 0, 0.01, 0.03)):
        least = np.array([floor[0], *floor, floor[-1]])
        z = heights.over(least)
        assert (heights.rows @ z - least).min() > -1e-9
        rest = np.zeros(len(heights.cost) - len(least))
        wish = np.concatenate([heights.weight * least, rest])
        found = minimize(
            lambda x, c=wish: 1e4 * np.sum((heights.cost @ x - c) ** 2),
            z + 0.01,
            constraints={"type": "ineq", "fun": lambda x, f=least: heights.rows @ x - f},
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert 1e4 * np.sum((heights.cost @ z - wish) ** 2) <= found.fun + 1e-6


def test_a_body_in_a_pipe_has_casters_at_both_ends(screw4):
    """The tail's caster stands on the ground below the last link's end and weighs the same."""
    both = braced(screw4)
    assert [c.link for c in both.modules.casters] == ["caster1", TAIL]
    assert both.mass == pytest.approx(screw4.mass + 0.05) and braced(both) is both
    model = contact_model(both)
    data = mujoco.MjData(model)
    data.qpos[2] = 0.075
    mujoco.mj_forward(model, data)
    ball = data.geom(f"{TAIL}_contact1").xpos
    length = sum(screw4.modules.lengths.values())
    assert ball == pytest.approx([length, 0.06, 0.012], abs=1e-9)
