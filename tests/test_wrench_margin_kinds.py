"""Controller, failure, guaranteed, joint-limited and gimbal-limited margins."""

from dataclasses import replace

import numpy as np
import pytest
from margin_robots import LENGTH, MASS, chain
from scipy.optimize import linprog

from snakegen.analysis.wrench_margin import thrust_margins, vectored_margins
from snakegen.errors import SnakegenError
from snakegen.wrench_margins.controller import ball_reach, thrust_controller, vectored_controller
from snakegen.wrench_margins.failure import thrust_failures, vectored_failures
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.joint_limited import vectored_joint_limited
from snakegen.wrench_margins.joint_limited_rotors import thrust_joint_limited
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.uncertainty import guaranteed_thrust, guaranteed_vectored

WEIGHT = 4 * MASS * 9.81
HOVER = np.array([0, 0, WEIGHT, 0, 0, 0])
SCALES = {"force_scale": WEIGHT, "torque_scale": WEIGHT * LENGTH}


def unit_ball(rng, count, size):
    d = rng.normal(size=(count, size))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_ball_reach_is_the_largest_ball_that_saturates_nothing():
    rng = np.random.default_rng(0)
    for _ in range(30):
        f0, gain = rng.normal(size=3), rng.normal(size=(3, rng.integers(2, 7)))
        limit = np.linalg.norm(f0) + rng.uniform(0.1, 3.0)
        r = ball_reach(f0, gain, limit)
        d = unit_ball(rng, 4000, gain.shape[1])
        for _ in range(60):  # climb: the farthest d of a linearised norm
            reached = f0 + r * d @ gain.T
            d = reached @ gain
            d /= np.linalg.norm(d, axis=1, keepdims=True)
        assert np.linalg.norm(f0 + r * d @ gain.T, axis=1).max() == pytest.approx(limit, rel=1e-7)
        assert r >= (limit - np.linalg.norm(f0)) / np.linalg.norm(gain, 2) * (1 - 1e-12)


def test_ball_reach_in_the_hard_case_and_at_the_ends():
    gain = np.diag([2.0, 1.0, 0.5])
    # f0 has no part along the first axis: max over ‖d‖ ≤ r of 4x² + (1 + y)², known by hand
    r = ball_reach([0.0, 1.0, 0.0], gain, 3.0)
    angle = np.linspace(0, 2 * np.pi, 200001)
    assert np.sqrt(
        4 * (r * np.cos(angle)) ** 2 + (1 + r * np.sin(angle)) ** 2
    ).max() == pytest.approx(3.0, rel=1e-8)
    assert ball_reach(np.zeros(3), gain, 3.0) == pytest.approx(1.5)
    assert np.isnan(ball_reach([4.0, 0, 0], gain, 3.0))
    assert ball_reach([1.0, 0, 0], np.zeros((3, 3)), 3.0) == np.inf


def test_the_controller_never_beats_the_exact_margin():
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = rng.normal(size=(6, 8))
        inverse = np.linalg.pinv(q)
        hover = q @ np.full(8, 0.5)
        if not 0.0 < (inverse @ hover).min() <= (inverse @ hover).max() < 1.0:
            c = thrust_controller(q, 0, 1, hover, force_scale=2.0, torque_scale=0.7)
            assert np.isnan(c.force)  # the allocator's own hover saturates
            continue
        c = thrust_controller(q, 0, 1, hover, force_scale=2.0, torque_scale=0.7)
        m = thrust_margins(q, 0, 1, hover, force_scale=2.0, torque_scale=0.7)
        for name in ("wrench", "force", "torque"):
            assert 0 < getattr(c, name) <= getattr(m, name) * (1 + 1e-9)
        d = unit_ball(rng, 2000, 3) * c.force
        thrust = inverse @ hover + d @ inverse[:, :3].T
        assert thrust.min() > -1e-9 and thrust.max() < 1 + 1e-9
        j = c.limiting[1]
        push = inverse[j, :3] / np.linalg.norm(inverse[j, :3]) * c.force
        ends = [(inverse @ (hover + np.r_[s * push, 0, 0, 0]))[j] for s in (1, -1)]
        assert min(abs(np.array([*ends, *(1 - np.array(ends))]))) < 1e-9


def test_vectored_controller_of_the_table_and_its_lost_direction():
    for posture in ("planar", "spatial"):
        points, _ = chain(4, posture)
        c = vectored_controller(points, 64.0, HOVER, **SCALES)
        m = vectored_margins(points, 64.0, HOVER, **SCALES)
        assert 0 < c.force <= m.force_bounds[1] * (1 + 1e-9) and 0 < c.torque <= m.torque
        assert 0 < c.wrench <= m.wrench_bounds[1]
    straight = vectored_controller(chain(4, "straight")[0], 64.0, HOVER, **SCALES)
    assert straight.torque == 0.0 and straight.wrench == 0.0 and straight.force > 0.0
    assert np.isnan(vectored_controller(points, 5.0, HOVER, **SCALES).force)


def test_failures_are_the_margins_of_what_is_left():
    rng = np.random.default_rng(2)
    q = rng.normal(size=(6, 10))
    hover = q @ np.full(10, 0.5)
    apparatus = np.repeat(np.arange(5), 2)
    table = thrust_failures(q, 0, 1, hover, apparatus, force_scale=1, torque_scale=1)
    assert [(f.part, f.index) for f in table] == [
        *(("rotor", j) for j in range(10)),
        *(("apparatus", k) for k in range(5)),
    ]
    for f in (table[3], table[12]):
        lost = [3] if f.part == "rotor" else [4, 5]
        left = thrust_margins(
            np.delete(q, lost, axis=1), 0, 1, hover, force_scale=1, torque_scale=1
        )
        assert f.margins.wrench == pytest.approx(left.wrench, rel=1e-9)
        assert f.margins.force == pytest.approx(left.force, rel=1e-9, nan_ok=True)
    points, _ = chain(4, "planar")
    for j, f in enumerate(vectored_failures(ForceSets.free(points, 64.0), HOVER, **SCALES)):
        left = vectored_margins(np.delete(points, j, axis=0), 64.0, HOVER, **SCALES)
        assert f.margins.wrench == pytest.approx(left.wrench, rel=1e-9)


def test_guaranteed_margins_hold_for_every_mass_and_limit_in_range():
    rng = np.random.default_rng(3)
    q = rng.normal(size=(6, 8))
    hover = q @ np.full(8, 0.5)
    scales = {"force_scale": 1.0, "torque_scale": 1.0}
    sure = guaranteed_thrust(q, 0.05, 1.0, hover, mass=0.1, thrust=0.15, **scales)
    low, least = np.inf, np.inf
    for _ in range(300):
        factor = rng.uniform(0.85, 1.15, 8)
        m = thrust_margins(q, 0.05 * factor, factor, hover * rng.uniform(0.9, 1.1), **scales)
        low, least = min(low, m.force), min(least, m.wrench)
    assert sure.force <= low and sure.wrench <= least
    exact = guaranteed_thrust(q, 0.0, 1.0, hover, mass=0.1, thrust=0.15, **scales)
    ends = [thrust_margins(q, 0, 0.85, hover * x, **scales).torque for x in (0.9, 1.1)]
    assert exact.torque == min(ends)
    points, _ = chain(4, "planar")
    sure_v = guaranteed_vectored(
        ForceSets.free(points, 64.0), HOVER, mass=0.1, thrust=0.1, **SCALES
    )
    assert sure_v.force == pytest.approx(4 * 64 * 0.9 - 1.1 * WEIGHT, rel=1e-3)
    with pytest.raises(SnakegenError, match=r"mass is 1.2; it must be a fraction"):
        guaranteed_thrust(q, 0, 1, hover, mass=1.2, **scales)


def joint_rows(points, rotations):
    """Torque of the pitch and yaw axes between links, per newton; and that of gravity."""
    rows, bias = [], []
    for i in range(len(points) - 1):
        joint = points[i] + rotations[i] @ [LENGTH / 2, 0, 0]
        for axis in (rotations[i][:, 1], rotations[i][:, 2]):
            arms = points[i + 1 :] - joint
            row = np.zeros((len(points), 3))
            row[i + 1 :] = np.cross(axis, arms)
            rows.append(row)
            bias.append((np.cross(arms, [0, 0, -MASS * 9.81]) @ axis).sum())
    return np.array(rows), np.array(bias)


def test_joint_limits_of_the_published_case():
    # THEORY A5: planar 60°, 64 N an apparatus, disturbance at the root link, 7 N·m joints
    points, rotations = chain(4, "planar")
    rows, bias = joint_rows(points, rotations)
    bounds = Bounds(rows, bias, np.zeros((len(rows), 6)), 7.0)
    m = vectored_joint_limited(points, 64.0, HOVER, bounds, **SCALES)
    assert m.closed
    assert m.force == pytest.approx(53.7, abs=0.1) and m.torque == pytest.approx(13.2, abs=0.05)
    assert m.force_joints and m.torque_joints
    free = vectored_joint_limited(points, 64.0, HOVER, replace(bounds, limit=1e4), **SCALES)
    assert (free.force, free.torque) == pytest.approx((free.free_force, free.free_torque), rel=1e-3)
    # where the disturbance acts matters: on the last link it bends every joint
    arms = rows[:, -1]
    tip = np.hstack([arms, np.zeros((len(rows), 3))])
    there = vectored_joint_limited(points, 64.0, HOVER, replace(bounds, wrench=tip), **SCALES)
    assert abs(there.force - m.force) > 0.5


def test_joint_limited_rotors_stay_inside_their_rays():
    rng = np.random.default_rng(4)
    q, rows = rng.normal(size=(6, 9)), rng.normal(size=(2, 9))
    hover, bias = q @ np.full(9, 0.5), -rows @ np.full(9, 0.5)
    bounds = Bounds(rows, bias, np.zeros((2, 6)), 0.3)
    m = thrust_joint_limited(q, 0, 1, hover, bounds, force_scale=1, torque_scale=1, tolerance=1e-7)
    assert m.force < m.free_force
    shortest = np.inf
    for e in [m.force_direction, *unit_ball(rng, 40, 3)]:
        found = linprog(
            np.r_[np.zeros(9), -1.0],
            A_eq=np.c_[q, -np.r_[e, 0, 0, 0]],
            b_eq=hover,
            A_ub=np.c_[np.vstack([rows, -rows]), np.zeros(4)],
            b_ub=np.r_[0.3 - bias, 0.3 + bias],
            bounds=[(0, 1)] * 9 + [(None, None)],
        )
        shortest = min(shortest, -found.fun)
    assert shortest == pytest.approx(m.force, rel=1e-6)
