"""Drag of rotors together with limits: of gimbals, of the controller, of joints."""

from types import SimpleNamespace

import numpy as np
import pytest
from dragging_bodies import (
    F0,
    SCALES,
    SLICES,
    margins_of,
    matrix,
    random_body,
    wrench_of,
)
from margin_robots import LENGTH
from scipy.optimize import minimize

from snakegen.wrench_margins.controller import vectored_controller
from snakegen.wrench_margins.failure import vectored_failures
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.joint_limited import vectored_joint_limited
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.uncertainty import guaranteed_vectored


def test_gimbal_limits_that_bind_nothing_leave_the_margins():
    b = random_body(np.random.default_rng(5), 4)
    free, turned = margins_of(b), margins_of(b, gimbal_limits=[np.pi, 0.5 * np.pi])
    assert not turned.hull
    # a kernel that is compiled between the two calls gives other round-off than plain NumPy
    np.testing.assert_allclose(turned.bounds, free.bounds, rtol=1e-6)


def reached(b: SimpleNamespace, limit: float, u: np.ndarray) -> float:
    """Largest t at which forces λ, φ, θ give hover + t u: sequential programs from three starts."""
    n, unit = len(b.points), F0 * np.r_[np.ones(3), np.full(3, LENGTH)]
    rng, found = np.random.default_rng(0), []

    def missed(x):
        thrust, phi, theta = x[:-1].reshape(3, n)
        axes = [np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
        return (wrench_of(b, (thrust * np.array(axes)).T) - b.hover) / unit - x[-1] * u * F0 / unit

    ranges = [*((0.0, most) for most in b.limits), *[(-limit, limit)] * (2 * n), (None, None)]
    for _ in range(3):
        first = np.r_[rng.random(n) * b.limits, limit * rng.uniform(-1.0, 1.0, 2 * n), 0.0]
        end = minimize(
            lambda x: -x[-1],
            first,
            method="SLSQP",
            bounds=ranges,
            constraints={"type": "eq", "fun": missed},
            options={"maxiter": 300, "ftol": 1e-10},
        )
        if end.success and np.abs(missed(end.x)).max() < 1e-9:
            found.append(end.x[-1] * F0)
    return max(found)


def test_narrow_gimbals_against_forces_of_nonlinear_programs():
    """The sets are not convex: neither their hulls nor mixtures of forces are in reach."""
    rng, b = np.random.default_rng(6), random_body(np.random.default_rng(6), 5)
    b.hover = np.r_[0, 0, 0.7 * F0, 0, 0, 0]
    b.drag = np.array([0.3, -0.25, 0.2, -0.3, 0.25])
    m = margins_of(b, gimbal_limits=[0.8, 0.8], tolerance=1e-3)
    assert m.feasible and m.hull
    for name, part in SLICES.items():
        low, high = getattr(m, f"{name}_bounds")
        assert 0.997 * high <= low <= high
        weakest = m.worst(name)
        assert low * (1 - 1e-9) <= reached(b, 0.8, weakest) <= high * (1 + 1e-9)
        for _ in range(2):
            near = weakest.copy()
            near[part] += 0.3 * rng.normal(size=3)
            assert reached(b, 0.8, near / np.linalg.norm(near)) >= low * (1 - 1e-9)


def test_controller_failure_and_guarantee_take_the_drag():
    rng = np.random.default_rng(8)
    b = random_body(rng, 4)
    given = b.points, b.limits, b.hover
    c = vectored_controller(*given, drag=b.drag, **SCALES)
    inverse = np.linalg.pinv(matrix(b) / np.repeat([1, LENGTH], 3)[:, None])
    unit = rng.normal(size=(20000, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    start = (inverse @ np.r_[b.hover[:3], b.hover[3:] / LENGTH]).reshape(4, 3)
    steps = (unit @ inverse[:, 3:].T / LENGTH).reshape(-1, 4, 3)
    sizes = np.linalg.norm(start + c.torque * steps, axis=2) / b.limits
    assert 0.999 < sizes.max() <= 1.0 + 1e-9
    sets = ForceSets.free(b.points, b.limits, b.drag)
    lost = vectored_failures(sets, b.hover, **SCALES)[1].margins
    less = SimpleNamespace(**vars(b))
    for name in ("points", "limits", "drag"):
        setattr(less, name, np.delete(getattr(b, name), 1, axis=0))
    assert lost.wrench == pytest.approx(margins_of(less).wrench, rel=1e-6)  # both by search
    sure = guaranteed_vectored(sets, b.hover, mass=0.0, thrust=0.0, **SCALES)
    np.testing.assert_array_equal(sure.force, margins_of(b).force_bounds[0])


def test_joint_limits_on_a_body_that_drags():
    """Loose joints change nothing; tight ones are met by a linear program along the worst push."""
    rng = np.random.default_rng(9)
    b = random_body(rng, 4)
    bends = rng.normal(size=(2, 4, 3))
    given = b.points, b.limits, b.hover

    def weak(limit: float) -> Bounds:
        return Bounds(bends, np.zeros(2), np.zeros((2, 6)), np.full(2, limit))

    loose = vectored_joint_limited(*given, weak(1e4), drag=b.drag, **SCALES)
    free = margins_of(b)
    np.testing.assert_allclose(loose.force_bounds, free.force_bounds, rtol=2e-3)
    coarse = margins_of(b, wrench_starts=0)
    assert (loose.free_force, loose.free_torque) == (coarse.force, coarse.torque)
    tight = vectored_joint_limited(*given, weak(20.0), drag=b.drag, **SCALES)
    assert tight.closed and tight.force < 0.95 * loose.force
    row, n = bends.reshape(2, 12), 4
    for e, bounds, part in (
        (tight.force_direction, tight.force_bounds, slice(0, 3)),
        (tight.torque_direction, tight.torque_bounds, slice(3, 6)),
    ):
        u = np.zeros(6)
        u[part] = e

        def left(x, u=u):
            return matrix(b) @ x[:12] - b.hover - x[12] * u

        found = minimize(
            lambda x: -x[12],
            np.zeros(13),
            constraints=[
                {"type": "eq", "fun": left},
                {"type": "ineq", "fun": lambda x: np.r_[20 - row @ x[:12], 20 + row @ x[:12]]},
                {
                    "type": "ineq",
                    "fun": lambda x: b.limits**2 - (x[:12].reshape(n, 3) ** 2).sum(axis=1),
                },
            ],
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-10},
        )
        assert found.success
        assert bounds[0] * (1 - 1e-6) <= found.x[12] <= bounds[1] * (1 + 1e-6)
