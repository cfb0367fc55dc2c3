"""Margins in plain NumPy are those of the kernels, on random cases."""

from typing import Any

import numpy as np
import pytest

import snakegen
from snakegen.kernels.margins import norms, ray_casting, vectored
from snakegen.kernels.margins import zonotope as zonotope_kernel
from snakegen.robot.robot import Robot, load
from snakegen.wrench_margins import wrench_search
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.limited import certify_wrench
from snakegen.wrench_margins.plain import ball_certificate, ball_margins, ball_support, zonotope

ROBOTS = ("dragon4", "dragon3", "hybrid4", "grasper3", "arm6", "screw4")


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return load(request.param)


def test_exact_margins() -> None:
    rng, out_of_reach = np.random.default_rng(11), 0
    for _ in range(150):
        n, r = int(rng.integers(1, 13)), int(rng.integers(1, 8))
        q = rng.normal(size=(6, n))
        if r < 6:  # lower rank
            q = rng.normal(size=(6, r)) @ rng.normal(size=(r, n))
        half, middle = rng.uniform(0.2, 1.0, n), 0.5 * rng.normal(size=n)
        inside = q @ (middle + rng.uniform(-1.0, 1.0, n) * half * rng.choice([0.5, 1.5]))
        hover = inside + rng.choice([0.0, 0.0, 0.3]) * rng.normal(size=6)
        scale = np.repeat([2.0, 1.0], 3)
        found = np.empty((1, 4)), np.empty((1, 4, 6)), np.empty(1, np.int64)
        zonotope_kernel.batch(q[None], half, middle, hover[None], scale, *found)
        a, y = q * 2.0 * half / scale[:, None], (hover - q @ middle) / scale
        plain, normals, rank = zonotope.margins(a, y)
        np.testing.assert_allclose(plain, found[0][0], rtol=1e-9, atol=1e-10)
        assert rank == found[2][0]
        out_of_reach += plain[0] < 0.0
        if plain[0] > 0.0:  # the normals reach what they are said to
            slack = 0.5 * np.abs(normals[:3] @ a).sum(axis=1) - normals[:3] @ y
            parts = [slice(0, 6), slice(0, 3), slice(3, 6)]
            size = [np.linalg.norm(d[p]) for d, p in zip(normals[:3], parts, strict=True)]
            np.testing.assert_allclose(slack / size, plain[:3], rtol=1e-9)
    assert 20 < out_of_reach < 130


def ball_case(rng: np.random.Generator, k: int) -> tuple[Any, ...]:
    """Returns points (n, 4), limits (n,) and hover (6,): wide, thin and collinear bodies."""
    n = int(rng.integers(2, 8))
    p = np.zeros((n, 4))
    p[:, :3] = rng.normal(size=(n, 3)) * rng.choice([1.0, 1.0, 0.3, 1e-3], size=3)
    if k % 7 == 0:
        p[:, 1:3] = 0.0
    if k % 5 == 0:
        p[:, 3] = 0.02 * rng.normal(size=n)
    p[:, :3] -= p[:, :3].mean(axis=0)
    up = rng.normal(size=3)
    hover = np.append(up / np.linalg.norm(up), np.zeros(3))
    return p, rng.uniform(0.3, 1.0, n) * 2.0 / n, hover


def test_certified_margins() -> None:
    rng, closed = np.random.default_rng(13), 0
    for k in range(25):
        p, limit, hover = ball_case(rng, k)
        bounds, twists = np.empty((1, 3, 2)), np.empty((1, 3, 6))
        rank, calls = np.empty(1, np.int64), np.empty((1, 2), np.int64)
        vectored.batch(p[None], limit, hover[None], 1e-3, bounds, twists, rank, calls)
        plain, kernel = ball_margins.margins(p, limit, hover, 1e-3), bounds[0]
        assert plain.rank == rank[0]
        np.testing.assert_array_equal(np.isnan(plain.bounds), np.isnan(kernel))
        if kernel[0, 1] < 0.0:
            assert plain.bounds[0, 1] < 0.0
            continue
        for ours, theirs in zip(plain.bounds[1:], kernel[1:], strict=True):  # brackets of one value
            assert ours[0] <= theirs[1] * (1.0 + 1e-9) and theirs[0] <= ours[1] * (1.0 + 1e-9)
            assert ours[1] - ours[0] <= 1e-3 * ours[1]
            closed += ours[1] > 0.0
    assert closed > 20


def test_rays_and_distances() -> None:
    rng = np.random.default_rng(17)
    for k in range(1, 7):
        p, limit, hover = ball_case(rng, k)
        u, normal = rng.normal(size=(5, 6)), np.empty(6)
        low, high, twists = ball_support.shoot.__wrapped__(u, p, 2.0 * limit, hover)  # type: ignore[attr-defined]
        for i, a in enumerate(u):
            kernel = ray_casting.shoot(a, p, 2.0 * limit, hover, normal)
            assert low[i] <= kernel[1] * (1.0 + 1e-9) and kernel[0] <= high[i] * (1.0 + 1e-9)
            assert high[i] - low[i] <= 1e-3 * high[i] + 1e-7
            assert twists[i] @ a == pytest.approx(1.0)
        far = 3.0 * hover
        plain = ball_support.distance.__wrapped__(p, limit, far)  # type: ignore[attr-defined]
        apart = ray_casting.distance(p, limit, far, normal)
        np.testing.assert_allclose(plain[:2], apart, rtol=1e-8)
        assert plain[0] <= apart[1] * (1.0 + 1e-9) and apart[0] <= plain[1] * (1.0 + 1e-9)


def test_distance_of_hover_from_thin_sets() -> None:
    """Points in a plane, on a line, weights just out of reach: Newton ends, bounds agree."""
    rng, normal, outside = np.random.default_rng(29), np.empty(6), 0
    for flat in ((1, 1, 1, 0), (1, 1, 0, 0), (1, 0, 0, 0)):
        for share in (0.5, 0.9, 1.0, 1.1):
            p, limit, _ = ball_case(rng, 1)
            p = p * flat
            hover = np.array([0.0, 0.0, share * limit.sum(), 0.0, 0.0, 0.0])
            low, high, twist = ball_support.distance.__wrapped__(p, limit, hover)  # type: ignore[attr-defined]
            assert 0.0 <= low <= high <= low + 2e-6
            theirs = ray_casting.distance(p, limit, hover, normal)
            assert low <= theirs[1] * (1.0 + 1e-9) and theirs[0] <= high * (1.0 + 1e-9)
            if low > 1e-6:
                outside += 1
                assert -ball_support.slack(twist[None], p, limit, hover)[0] == pytest.approx(low)
    assert outside >= 4


def test_sum_of_norms() -> None:
    rng = np.random.default_rng(19)
    for _ in range(10):
        n, k = int(rng.integers(4, 9)), int(rng.integers(2, 8))
        start, maps = rng.normal(size=(n, 3)), rng.normal(size=(n, 3, k))
        limit, cost = rng.uniform(0.3, 1.0, n), 0.05 * rng.normal(size=k)
        above, below, gap = [], [], []
        for minimise in (ball_support.minimise.__wrapped__, norms.minimise):  # type: ignore[attr-defined]
            x, f = np.zeros(k), np.zeros((n, 3))
            gap.append(minimise(start, maps, limit, cost, x, f) * limit.sum())
            assert np.abs(np.einsum("jck,jc->k", maps, f) - cost).max() < 1e-8
            assert (np.linalg.norm(f, axis=1) <= limit * (1.0 + 1e-12)).all()
            above.append(np.linalg.norm(start + maps @ x, axis=1) @ limit - cost @ x)
            below.append((f * start).sum())
        assert max(below) <= min(above) + 1e-7 and max(gap) < 5e-6
        assert max(above) - min(below) <= max(gap) + 1e-7


def test_wrench_certificate() -> None:
    rng, raised = np.random.default_rng(23), 0
    for _ in range(3):
        p, limit, hover = ball_case(rng, 1)
        p[:, :3] = rng.normal(size=(len(p), 3))
        p[:, :3] -= p[:, :3].mean(axis=0)
        plain = ball_margins.margins(p, 2.0 * limit, hover, 1e-4)
        if plain.rank < 6 or plain.bounds[0, 1] < 0.0:
            continue
        bounds, twists = plain.bounds.copy(), plain.twists.copy()
        wrench_search.refine(p, 2.0 * limit, hover, bounds, twists, 6, 16)
        hull = ForceSets.free(p[:, :3], 2.0 * limit).hull()
        theirs, there = bounds.copy(), twists.copy()
        certify_wrench(hull, hover, theirs, there, 1e-3)
        ball_certificate.certify_balls(p, 2.0 * limit, hover, bounds, twists, 1e-3)
        np.testing.assert_allclose(bounds[0], theirs[0], rtol=1e-3)
        raised += bounds[0, 0] > plain.bounds[0, 0]
    assert raised > 0


def test_joint_limited_margins_close_where_plain_forces_do_not_balance():
    """Plain Newton leaves four of sixty sums unbalanced in this posture; the kernel ends them."""
    robot = snakegen.load("dragon4")
    q = robot.configuration({"joint1_yaw": 1.0}, gimbals="hover")
    found = snakegen.margins(q)
    assert found.force_bounds_N[1] <= found.force_bounds_N[0] * 1.0011
    from snakegen.analysis import wrench_margin

    page = wrench_margin.analyze(robot, q)
    low, high = page.push["virtual_single_rotor"].kinds["force"]["exact_servo"].bounds
    assert low == pytest.approx(24.43, abs=0.02) and high <= 1.002 * low
