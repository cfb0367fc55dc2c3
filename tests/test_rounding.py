"""Numbers and words that are written are the same whatever the last bits of the results."""

import numpy as np
import pytest

import snakegen
from snakegen.base.describe_motion import canonical_basis, components, motions
from snakegen.base.rounding import significant


def test_significant_digits_ignore_the_last_bits() -> None:
    """Neighbouring doubles, ties included, become one number; -0 becomes 0."""
    values = np.array([12.345678905, 3.1, -1e-17, 0.0, -0.125])
    for sign in (-1.0, 0.0, 1.0):
        found = significant(values * (1 + sign * 4e-16), 9)
        assert np.array_equal(found, significant(values, 9))
    assert np.array_equal(significant([12.345678951, -1e-17], 9), [12.345679, 0.0])
    assert not np.signbit(significant([-1e-17, 1.0])[0])
    assert np.array_equal(significant([0.0, -0.0]), [0.0, 0.0])
    assert np.isnan(significant([np.nan, 1.0])[0])


def test_components_have_no_negative_zero_and_no_noisy_ties() -> None:
    """A component within rounding of zero, or of a half, is written in one way."""
    assert components([-1e-16, 0.125 - 1e-14, 0.125 + 1e-14]) == components([1e-16, 0.125, 0.125])
    assert components([-0.001, 1, -1], 2) == "+0.00 +1.00 -1.00"


@pytest.mark.parametrize("seed", range(5))
def test_words_depend_on_the_space_not_on_its_basis(seed: int) -> None:
    """Motions lost by a robot are named alike from every basis of the null space."""
    rng = np.random.default_rng(seed)
    lever, points = 0.4, np.array([[0, 0, 0.0], [1, 0, 0], [0, 1, 0.2]])
    scale = np.repeat([1.0, 1 / lever], 3)[:, None]
    lost = {
        2: ("roll", "yaw"),
        3: ("yaw", "translation at right angles to (+0.00 +0.00 +1.00)"),
        4: ("roll", "pitch", "translation at right angles to (+1.00 +0.00 +0.00)"),
    }
    spaces = {2: [3, 5], 3: [0, 1, 5], 4: [1, 2, 3, 4]}
    for count, rows in spaces.items():
        space = np.eye(6)[:, rows]
        turn, _ = np.linalg.qr(rng.normal(size=(count, count)))
        assert motions(scale * (space @ turn), lever, points) == lost[count]


def test_canonical_basis_spans_the_space() -> None:
    """Orthonormal, the same space, and the same whatever the columns."""
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(6, 3))
    first = canonical_basis(columns, (3, 4, 5))
    assert np.allclose(first.T @ first, np.eye(3), atol=1e-12)
    assert np.allclose(first @ (first.T @ columns), columns, atol=1e-12)
    again = canonical_basis(columns @ rng.normal(size=(3, 3)), (3, 4, 5))
    assert np.allclose(first, again, atol=1e-9)


def test_keyframes_hold_nine_digits() -> None:
    """Hover thrusts of the keyframe carry the weight to nine digits, and have no more of them."""
    from snakegen.description.mjcf.decorate import decorate

    robot = snakegen.load("dragon3")
    model = decorate(robot.urdf, robot.modules, {}, visuals=False).compile()
    for row in (model.key("home").ctrl, model.key("home").qpos, model.key("floor").qpos):
        assert np.array_equal(row, significant(row))
    rotors = model.key("home").ctrl[: len(robot.rotors.body)]
    assert rotors.sum() == pytest.approx(robot.force_scale, rel=1e-8)
