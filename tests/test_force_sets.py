"""Force sets: what an apparatus of any kind can push with, and margins bounded from both sides."""

from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from limited_bodies import holds, random_sets

import snakegen
from snakegen.analysis import wrench_margin
from snakegen.analysis.allocation import allocation
from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins import force_sets as kernel
from snakegen.kernels.margins.convex_pieces import pieces_into
from snakegen.kernels.margins.force_sets import slack
from snakegen.kernels.margins.limited_margins import empty_pieces
from snakegen.kernels.margins.wrench_certificate import certify
from snakegen.robot.posture import hover_gimbals
from snakegen.spec.loading import load_spec
from snakegen.sweep.batch import Body, evaluate
from snakegen.wrench_margins.controller import vectored_controller
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.vectored import set_margins

DATA = Path(__file__).parent / "data"
BENT = {"joint1_yaw": 1.0, "joint2_yaw": 1.0, "joint3_yaw": 1.0}


@jit
def hull_farthest(j, d, sets, u, f):
    return kernel.hull_farthest(j, d, sets, u, f)


@jit
def piece_farthest(j, d, sets, f):
    return kernel.piece_farthest(j, d, sets, f)


def margins_at(robot, q, **options):
    scale = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    return set_margins(robot.force_sets(q), allocation(robot, q).hover_wrench, **scale, **options)


def test_farthest_forces_of_the_kernel_are_those_of_numpy_and_lie_in_the_set():
    rng, f, u = np.random.default_rng(0), np.empty(3), np.empty(3)
    for _ in range(60):
        sets = random_sets(rng, 3)
        hull = sets.hull()
        for j in range(3):
            for d in rng.normal(size=(6, 3)):
                best = hull_farthest(j, d, hull, u, f)
                assert best == pytest.approx(d @ sets.strongest(j, d), abs=1e-9)
                assert holds(sets, j, f)


def test_no_sampled_force_of_a_set_lies_farther():
    rng = np.random.default_rng(1)
    for _ in range(40):
        sets = random_sets(rng, 1)
        phi, theta = (rng.uniform(*r[0], 400) for r in (sets.phi, sets.theta))
        unit = [np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
        forces = (
            np.vstack([unit]).T
            @ sets.frames[0].T
            * rng.choice([sets.low[0], sets.high[0]], (400, 1))
        )
        for d in rng.normal(size=(5, 3)):
            assert (forces @ d).max() <= d @ sets.strongest(0, d) + 1e-12


def test_convex_pieces_lie_in_their_sets_and_hold_the_direction_asked():
    rng, f = np.random.default_rng(2), np.empty(3)
    for _ in range(60):
        sets = random_sets(rng, 3)
        hull = sets.hull()
        convex = empty_pieces(hull)
        pieces_into(rng.normal(size=(3, 3)), hull, convex)
        for j in range(3):
            corners = []
            for d in rng.normal(size=(12, 3)):
                assert piece_farthest(j, d, convex, f) == pytest.approx(d @ f, abs=1e-9)
                corners.append(f.copy())
            assert piece_farthest(j, convex.axis[j], convex, f) == pytest.approx(convex.high[j])
            for w in rng.dirichlet(np.full(12, 0.2), 12):
                assert holds(sets, j, w @ np.array(corners))


@pytest.mark.parametrize(
    ("case", "force", "torque"), [("one_axis_tilt", 19.96, 3.777), ("reversible", 5.646, 1.7455)]
)
def test_bodies_of_other_people(case, force, torque):
    """Upper values from linear programs over discs and segments."""
    robot = snakegen.load(DATA / f"{case}.urdf", modules=DATA / f"{case}.modules.yaml")
    m = margins_at(robot, robot.configuration())
    assert m.closed and m.rank == 6 and not m.hull
    assert force * (1 - 1.5e-3) <= m.force <= force * (1 + 1e-4)
    assert torque * (1 - 1.5e-3) <= m.torque <= torque * (1 + 1e-4)


def test_four_discs_reach_no_farther_along_x_than_two_of_them_push():
    robot = snakegen.load(DATA / "one_axis_tilt.urdf", modules=DATA / "one_axis_tilt.modules.yaml")
    low, high = margins_at(robot, robot.configuration()).directional_bounds([1, 0, 0, 0, 0, 0])
    assert 19.94 < low <= 19.96 and low <= high < 19.98


def test_reversible_rotors_hover_in_any_attitude():
    robot = snakegen.load(DATA / "reversible.urdf", modules=DATA / "reversible.modules.yaml")
    for rpy in ((0, 0, 0), (np.pi, 0, 0), (0.5, 1.2, 0), (-1.9, 0.3, 0)):
        m = margins_at(robot, robot.configuration(base_rpy=rpy))
        assert m.feasible and m.closed and m.force > 3.0 and m.torque > 1.0


def test_a_tricopter_that_cannot_hover_level_says_so():
    robot = snakegen.load(DATA / "tricopter.urdf", modules=DATA / "tricopter.modules.yaml")
    m = margins_at(robot, robot.configuration())
    assert m.rank == 4 and m.closed and not m.feasible and m.wrench < 0 and np.isnan(m.force)


def test_a_tricopter_hovers_with_the_tilt_that_is_printed():
    """That the tail's drag and side force take: one angle of roll, from two equations by hand."""
    robot = snakegen.load(DATA / "tricopter.urdf", modules=DATA / "tricopter.modules.yaml")
    found = wrench_margin.analyze(robot, robot.configuration()).obstacles
    turned = {"base_rpy": found.rpy, "tail_servo": np.arctan2(*(-1, 1) * found.forces[2, 1:])}
    a = allocation(robot, robot.configuration(turned))
    thrust = np.linalg.norm(found.forces, axis=1)
    assert np.abs(a.dual @ thrust - a.hover_wrench).max() < 1e-5
    assert (thrust < 8.0).all() and found.tilt == pytest.approx(0.01996, abs=2e-5)
    # only the tail pushes sideways, which tilts the body; its arm bears the rotors' drag in yaw
    assert found.forces[2, 1] / 12.2625 == pytest.approx(np.sin(found.tilt), rel=1e-6)
    drag = 0.016 * found.forces[:, 2] @ [1, -1, 1]
    assert np.cross(a.thrust_points, found.forces)[:, 2].sum() == pytest.approx(-drag, abs=1e-6)


@pytest.mark.parametrize("limits", [(), ("roll_limit=0.5", "pitch_limit=0.5")])
def test_a_straight_body_that_is_too_heavy_is_out_of_reach(limits):
    fields = [f"vectoring_apparatus.{f}" for f in ("thrust_max=2", *limits)]
    robot = snakegen.load(load_spec("dragon4", overrides=fields))
    m = margins_at(robot, robot.configuration(), wrench_starts=0)
    assert m.rank == 5 and not m.feasible and np.isnan(m.force)
    assert m.wrench == pytest.approx(16.0 / robot.force_scale - 1.0, rel=1e-6)
    page = wrench_margin.analyze(robot, robot.configuration(), mass_error=0.1)
    text = " ".join(value for _, value in page.rows())
    assert "too heavy: all thrusts at their largest add up to 16 N" in text and "nan" not in text


def test_the_gimbals_in_the_way_of_hover_are_named():
    fields = [f"vectoring_apparatus.{k}_limit=0.05" for k in ("roll", "pitch")]
    robot = snakegen.load(load_spec("dragon4", overrides=fields))
    leaning = {"base_rpy": (0.3, 0.0, 0.0), "joint1_yaw": 1.0, "joint3_yaw": 1.0}
    page = wrench_margin.analyze(robot, robot.configuration(leaning))
    assert (
        "gimbal1_roll" in page.obstacles.gimbals and "gimbal1_pitch" not in page.obstacles.gimbals
    )
    assert 0.2 < page.obstacles.tilt < 0.3  # back towards level, by what the limits do not allow


def test_narrow_gimbals_of_a_chain():
    """An independent linear program over sampled forces allows 4.66 N."""
    narrow = [f"vectoring_apparatus.{k}_limit=0.05" for k in ("roll", "pitch")]
    robot = snakegen.load(load_spec("dragon4", overrides=narrow))
    m = margins_at(robot, robot.configuration(BENT))
    assert 4.65 < m.force <= 4.664 and m.force_bounds[1] <= 4.67


def limited(angle, *more):
    """Returns dragon4 with gimbals of ± `angle` rad."""
    names = [f"vectoring_apparatus.{k}_limit={angle}" for k in ("roll", "pitch")]
    return snakegen.load(load_spec("dragon4", overrides=[*names, *more]))


def test_a_sweep_counts_gimbal_limits_and_least_thrusts():
    """A row of a sweep is the margin of its posture: 4.66 N, not 44.5."""
    angles = np.array([[1.0, 1.0, 1.0], [0.6, -0.9, 0.3]])
    for more in ((), ("vectoring_apparatus.thrust_min=5",)):
        robot = limited(0.05, *more)
        joints = ("joint1_yaw", "joint2_yaw", "joint3_yaw")
        found = evaluate(Body.of(robot, joints, np.eye(3), 1e-3), angles).to_pydict()
        for i, row in enumerate(angles):
            q = hover_gimbals(robot, robot.configuration(dict(zip(joints, row, strict=True))))
            m = margins_at(robot, q)
            for name in ("wrench", "force", "torque"):
                low, high = getattr(m, f"{name}_bounds")
                certain = found[f"{name}_margin"][i]  # wrench: looser than one posture's
                assert certain == pytest.approx(low, rel=2e-3 if name != "wrench" else 0.3)
                assert certain <= high and found[f"{name}_margin_upper"][i] >= high * (1 - 2e-3)
            assert found["force_margin"][i] < 8.0


def test_a_mixture_with_fixed_rotors_is_swept_in_its_own_axes():
    robot = snakegen.load(DATA / "tricopter.urdf", modules=DATA / "tricopter.modules.yaml")
    table = evaluate(Body.of(robot, (), np.eye(3), 1e-3), np.zeros((1, 0))).to_pydict()
    m = margins_at(robot, robot.configuration())
    assert table["wrench_margin"][0] == pytest.approx(m.wrench, rel=1e-6) and m.wrench < 0


def test_a_ball_in_six_dimensions_is_certified():
    """Least of many searches above, proved to 3e-4 below; a ball a little larger is not."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(4, 3)) * [0.5, 0.4, 0.1]
    sets = ForceSets.free(points - points.mean(axis=0), [2.0, 2.5, 1.5, 2.0])
    m = set_margins(sets, [0, 0, 4, 0, 0, 0], force_scale=4, torque_scale=2)
    low, high = m.wrench_bounds
    assert high * (1 - 4e-4) <= low <= high
    hull = sets.hull((4, 2))
    convex, least = empty_pieces(hull), np.full(7, np.inf)
    pieces_into(np.zeros((4, 3)), hull, convex)
    hover = np.array([0, 0, 1.0, 0, 0, 0])
    assert certify(0.98 * high, convex, hover, 10**6, least)[0]
    assert not certify(1.02 * high, convex, hover, 10**6, least)[0] and least[0] < 1.02 * high
    for d in rng.normal(size=(200, 6)):
        assert slack(d, convex, hover) >= low * np.linalg.norm(d)


def test_bounds_of_random_bodies_against_sequential_quadratic_programs():
    """No lower bound above what forces reach, no upper one below: a few bodies of the benchmark."""
    path = Path(__file__).parent.parent / "benchmarks" / "force_set_fuzz.py"
    spec = spec_from_file_location("force_set_fuzz", path)
    fuzz = module_from_spec(spec)
    spec.loader.exec_module(fuzz)
    rng, checked = np.random.default_rng(3), 0
    while checked < 2:
        sets, hover = fuzz.random_body(rng)
        if len(sets) > 4:  # slow to search
            continue
        scale = {"force_scale": np.linalg.norm(hover), "torque_scale": 8.0}
        m = set_margins(sets, hover, wrench_starts=0, **scale)
        if m.feasible and m.force > 0.0:
            assert fuzz.check(checked, sets, m, 60) == []
            checked += 1
    false = replace(m, bounds=m.bounds * 1.3)  # the check sees bounds that are too high
    assert fuzz.check(0, sets, false, 2) != []


def test_every_margin_of_the_page_falls_with_the_gimbals():
    """Narrow gimbals bound failures, guaranteed, joint-limited and allocator margins too."""
    robot = limited(0.05)
    q = hover_gimbals(robot, robot.configuration(BENT))
    page = wrench_margin.analyze(robot, q, mass_error=0.02)
    exact = page.vectored["force"].value
    assert 4.6 < exact < 4.67
    assert page.guaranteed["virtual_single_rotor"]["force"] < exact
    low, high = page.joint_limited["virtual_single_rotor"].force
    assert 0.95 * exact < low <= exact and low <= high <= page.vectored["force"].bounds[1]
    sets, a = robot.force_sets(q), allocation(robot, q)
    given = a.thrust_points, robot.gimbals.limit, a.hover_wrench
    scale = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    held = vectored_controller(*given, sets=sets, **scale)
    assert page.controller["virtual_single_rotor"]["force"] == held.force <= exact
    direction = held.slices["force"].push[:3] / np.linalg.norm(held.slices["force"].push[:3])
    inverse = np.linalg.pinv(a.force @ block_diagonal(a.link_axes))
    for share, within in ((0.999, True), (1.01, False)):  # of the push at which a force leaves
        moved = inverse @ (a.hover_wrench - np.r_[share * held.force * direction, 0, 0, 0])
        inside = [holds(sets, j, f, 1e-6) for j, f in enumerate(moved.reshape(-1, 3))]
        assert all(inside) == within


def block_diagonal(turns):
    """Returns (3n, 3n), from CoG axes to each link's."""
    out = np.zeros((3 * len(turns), 3 * len(turns)))
    for j, turn in enumerate(turns):
        out[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] = turn.T
    return out


@pytest.mark.parametrize("case", ["one_axis_tilt", "tricopter"])
def test_the_page_of_a_body_without_chain_joints(case):
    robot = snakegen.load(DATA / f"{case}.urdf", modules=DATA / f"{case}.modules.yaml")
    page = wrench_margin.analyze(robot, robot.configuration())
    found = page.vectored["force"].value
    assert np.isnan(found) if case == "tricopter" else 19.9 < found <= 19.96
