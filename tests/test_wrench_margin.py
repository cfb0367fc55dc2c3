"""Exact thrust margins: against hulls, linear programs and least squares, and by laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from margin_cases import disagreement, random_case, ray
from margin_robots import chain, dual_map

from snakegen.analysis.wrench_margin import thrust_margins
from snakegen.errors import SnakegenError


def margins_of(case):
    return thrust_margins(
        case.q,
        case.lower,
        case.upper,
        case.hover,
        force_scale=case.force_scale,
        torque_scale=case.torque_scale,
    )


def test_random_sets_agree_with_hulls_and_linear_programs():
    rng = np.random.default_rng(7)
    worst = 0.0
    for _ in range(150):
        case = random_case(rng, most=7)
        worst = max(worst, disagreement(case, margins_of(case), rng))
    assert worst < 1e-9


@pytest.mark.parametrize("n", [8, 9])
def test_eight_and_nine_rotors_of_rank_six_agree_with_hulls(n):
    rng = np.random.default_rng(n)
    for _ in range(6):
        case = random_case(rng, most=8)
        q = rng.normal(size=(6, n))
        lower, upper = np.zeros(n), rng.uniform(0.5, 2.0, n)
        case = case._replace(q=q, lower=lower, upper=upper, hover=q @ (0.5 * upper))
        assert disagreement(case, margins_of(case), rng) < 1e-9


@pytest.mark.parametrize("n", [6, 8, 9])
def test_ties_are_named_the_same_whatever_rounding_says(n):
    """A hover in the middle is as near to d as to -d; mirrored columns tie facets as well."""
    rng = np.random.default_rng(n)
    half = rng.normal(size=(6, n // 2))
    mirrored = half * np.array([1, -1, 1, -1, 1, -1])[:, None]
    q = np.hstack([half, mirrored, np.eye(6)[:, : n % 2]])
    centre = q @ np.full(n, 0.5)

    def said(noise):
        given = q * (1 + noise * rng.uniform(-1, 1, q.shape))
        m = thrust_margins(given, 0.0, 1.0, centre, force_scale=1.0, torque_scale=1.0)
        return [(m.worst(k), *m.saturated(k)) for k in ("wrench", "force", "torque")]

    first = said(0.0)
    for _ in range(20):
        for (d, full, idle), (e, full_e, idle_e) in zip(first, said(1e-14), strict=True):
            assert d == pytest.approx(e, abs=1e-9)
            assert (full, idle) == (full_e, idle_e)
            assert d[np.flatnonzero(np.abs(d) > 1e-6)[0]] > 0


def test_a_plane_of_lost_directions_is_named_by_its_axis():
    """Forces along x and y are both lost: the SVD's basis must not choose between them."""
    q = np.zeros((6, 4))
    q[2:] = np.linalg.qr(np.random.default_rng(1).normal(size=(4, 4)))[0]
    m = thrust_margins(q, 0.0, 1.0, q @ np.full(4, 0.5), force_scale=1.0, torque_scale=1.0)
    for name in ("wrench", "force"):
        assert m.worst(name) == pytest.approx([1, 0, 0, 0, 0, 0], abs=1e-12)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6))
def test_batch_equals_single_and_a_turned_frame_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    case = random_case(rng)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    both = np.kron(np.eye(2), turn)
    one = margins_of(case)
    batch = thrust_margins(
        np.array([case.q, both @ case.q]),
        case.lower,
        case.upper,
        np.array([case.hover, both @ case.hover]),
        force_scale=case.force_scale,
        torque_scale=case.torque_scale,
    )
    for name in ("wrench", "force", "torque"):
        expected = getattr(one, name)
        np.testing.assert_allclose(getattr(batch, name)[0], expected, atol=1e-12, rtol=1e-11)
        np.testing.assert_allclose(getattr(batch, name)[1], expected, atol=1e-9, rtol=1e-9)
    assert batch[1].rank == one.rank


def test_units_scale_as_they_should():
    rng = np.random.default_rng(3)
    q = rng.normal(size=(6, 8))
    hover = q @ np.full(8, 0.5)
    a = thrust_margins(q, 0, 1, hover, force_scale=2.0, torque_scale=3.0)
    b = thrust_margins(7 * q, 0, 1, 7 * hover, force_scale=14.0, torque_scale=21.0)
    c = thrust_margins(q, 0, 1, hover, force_scale=5.0, torque_scale=0.7)
    assert b.wrench == pytest.approx(a.wrench, rel=1e-12)
    assert b.force == pytest.approx(7 * a.force, rel=1e-12)
    assert (c.force, c.torque) == pytest.approx((a.force, a.torque), rel=1e-10)
    assert c.wrench != pytest.approx(a.wrench, rel=1e-3)


def test_the_weakest_attitude_altitude_direction_is_a_facet():
    rng = np.random.default_rng(15)
    q = rng.normal(size=(6, 8))
    m = thrust_margins(q, 0, 1, q @ rng.uniform(0.4, 0.6, 8), force_scale=2, torque_scale=0.5)
    normal = m.normals[3]
    assert (normal[:2] == 0).all()
    products = (normal / m.scale) @ q
    slack = products.clip(0).sum() - (normal / m.scale) @ m.hover_wrench
    assert slack / np.linalg.norm(normal) == pytest.approx(m.attitude_altitude, rel=1e-9)


def test_the_bracket_of_the_slices_holds():
    rng = np.random.default_rng(4)
    q = rng.normal(size=(200, 6, 8))
    hover = q @ rng.uniform(0.3, 0.7, 8)
    m = thrust_margins(q, 0, 1, hover, force_scale=1.5, torque_scale=0.8)
    a, b = m.force / 1.5, m.torque / 0.8
    assert (m.wrench <= np.minimum(a, b) * (1 + 1e-12)).all()
    assert (m.wrench >= a * b / np.hypot(a, b) * (1 - 1e-12)).all()


@pytest.mark.parametrize("n", [8, 9])
@pytest.mark.parametrize("margin", ["wrench", "force", "torque"])
def test_the_worst_direction_is_where_the_ray_is_shortest(margin, n):
    rng = np.random.default_rng(5)
    q = rng.normal(size=(6, n))
    m = thrust_margins(q, 0, 1, q @ rng.uniform(0.4, 0.6, n), force_scale=2, torque_scale=0.5)
    reach, value = m.directional(m.worst(margin)), getattr(m, margin)
    assert reach == pytest.approx(value, rel=1e-9)
    at_upper, at_lower = m.saturated(margin)
    # five rotors span the facet and are free; the others set it
    assert len(at_upper) + len(at_lower) == n - 5
    wrench = m.hover_wrench + reach * m.worst(margin)
    free = np.setdiff1d(np.arange(n), at_upper + at_lower)
    rest = wrench - q[:, at_upper].sum(axis=1)
    thrust, *_ = np.linalg.lstsq(q[:, free], rest, rcond=None)
    np.testing.assert_allclose(q[:, free] @ thrust, rest, atol=1e-9)
    assert (thrust > -1e-9).all() and (thrust < 1 + 1e-9).all()


@pytest.mark.parametrize(
    ("count", "posture", "ranks"),
    [
        (1, "straight", (2, 2, 2)),
        (2, "straight", (4, 3, 3)),
        (2, "planar", (4, 3, 3)),
        (2, "spatial", (4, 4, 3)),
        (3, "planar", (4, 4, 3)),
        (4, "straight", (4, 3, 3)),
        (4, "spatial", (4, 4, 3)),
        (5, "planar", (4, 4, 3)),
    ],
)
def test_ranks_of_the_reference_table(count, posture, ranks):
    weight = 2 * 9.81 * count
    hover = [0, 0, weight, 0, 0, 0]
    for rank, kappa, alternate in zip(ranks, (0.01, 0.01, 0.0), (True, False, True), strict=True):
        q = dual_map(*chain(count, posture), kappa=kappa, alternate=alternate)
        m = thrust_margins(q, 0, 32, hover, force_scale=weight, torque_scale=0.42 * weight)
        assert m.rank == rank
        assert m.wrench == 0.0 and m.force == 0.0  # the horizontal is out of reach: not nan
        assert m.saturated("force") == ([], [])
        lost = m.worst("force")
        assert m.directional(lost) == pytest.approx(0.0, abs=1e-9) and abs(lost[2]) < 1e-9
        assert (m.attitude_altitude > 0) == (rank == 4 and count > 1)


def test_yaw_authority_of_dual_rotors_is_what_drag_gives():
    weight = 8 * 9.81
    q = dual_map(*chain(4, "straight"), kappa=0.01)
    m = thrust_margins(
        q, 0, 32, [0, 0, weight, 0, 0, 0], force_scale=weight, torque_scale=0.42 * weight
    )
    assert m.torque == pytest.approx(0.01 * weight, rel=1e-9)  # κ m g
    np.testing.assert_allclose(np.abs(m.worst("torque")), [0, 0, 0, 0, 0, 1], atol=1e-9)


def test_a_ray_sees_the_thickness_of_a_set_below_the_rank_tolerance():
    """σ6/σ1 about 3e-7: balls count the direction as lost, a ray along it ends where it ends."""
    rng = np.random.default_rng(6)
    for thin in (3e-7, 1e-7):
        u, _ = np.linalg.qr(rng.normal(size=(6, 6)))
        q = u * [1, 1, 1, 1, 1, thin] @ rng.normal(size=(6, 8))
        case = random_case(rng)._replace(
            q=q, lower=np.zeros(8), upper=np.ones(8), hover=q @ np.full(8, 0.5),
            force_scale=1.0, torque_scale=1.0,
        )  # fmt: skip
        m = margins_of(case)
        assert m.rank == 5 and m.wrench == 0.0
        across, along = u[:, 5], q @ rng.normal(size=8)
        assert 0.1 * thin < m.directional(across) < 10 * thin
        # in units of the thin direction the same question is well conditioned
        stretched = case._replace(q=np.diag([1, 1, 1, 1, 1, 1 / thin]) @ u.T @ q)
        stretched = stretched._replace(hover=stretched.q @ np.full(8, 0.5))
        for v in (across, along):
            w = np.diag([1, 1, 1, 1, 1, 1 / thin]) @ u.T @ v
            assert m.directional(v) == pytest.approx(ray(stretched, w), rel=1e-6)


def test_dead_rotors_are_as_if_absent():
    rng = np.random.default_rng(8)
    q = rng.normal(size=(6, 9))
    upper = np.ones(9)
    upper[4] = 0.0
    hover = q @ (0.5 * upper)
    kept = np.delete(q, 4, axis=1)
    a = thrust_margins(q, 0, upper, hover, force_scale=1, torque_scale=1)
    b = thrust_margins(kept, 0, 1, hover, force_scale=1, torque_scale=1)
    assert (a.wrench, a.force, a.torque) == (b.wrench, b.force, b.torque)


GOOD = {"allocation": np.eye(6), "lower": 0.0, "upper": 1.0, "hover_wrench": np.full(6, 0.5)}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"allocation": np.full((6, 6), np.nan)}, r"Q\[0, 0\] is nan"),
        ({"allocation": np.eye(5)}, r"Q has shape \(5, 5\)"),
        ({"allocation": "six"}, "not an array of numbers"),
        ({"lower": 2.0}, r"lower\[0\] = 2 is above upper\[0\] = 1"),
        ({"lower": -2.0, "upper": -1.0}, r"upper\[0\] is -1; .* cannot be negative"),
        ({"upper": np.inf}, "must be finite"),
        ({"upper": [1.0, 2.0]}, r"upper has shape \(2,\)"),
        ({"hover_wrench": np.zeros(5)}, r"hover_wrench has shape \(5,\)"),
        ({"force_scale": 0.0}, "force_scale is 0; it must be positive"),
        ({"torque_scale": np.nan}, "torque_scale is nan"),
    ],
)
def test_bad_input_is_one_clear_line(change, says):
    arguments = {**GOOD, "force_scale": 1.0, "torque_scale": 1.0, **change}
    with pytest.raises(SnakegenError, match=says) as caught:
        thrust_margins(**arguments)
    assert "\n" not in str(caught.value)


def test_a_negative_least_thrust_reverses_a_rotor():
    """Unit axes, thrusts -0.8 to 1 about none: the nearer limit is the margin."""
    given = {**GOOD, "hover_wrench": np.zeros(6), "force_scale": 1, "torque_scale": 1}
    m, forward = (thrust_margins(**{**given, "lower": low}) for low in (-0.8, 0.0))
    assert [m.wrench, m.force, m.torque] == pytest.approx([0.8] * 3, rel=1e-12)
    assert forward.force == forward.torque == 0.0


def test_results_refuse_what_they_do_not_hold():
    m = thrust_margins(**GOOD, force_scale=1, torque_scale=1)
    with pytest.raises(SnakegenError, match="u is zero"):
        m.directional(np.zeros(6))
    with pytest.raises(SnakegenError, match="no margin 'forces'"):
        m.worst("forces")
    assert m.singular_values == pytest.approx(np.ones(6))
