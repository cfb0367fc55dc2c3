"""Overridden masses and sizes move the inertias that a spec gives, or are refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snakegen.base import yaml_file
from snakegen.errors import SpecError
from snakegen.spec.inertia_scaling import _row
from snakegen.spec.loading import load_spec, presets
from snakegen.spec.warnings import warnings


def chain(name: str, *overrides: str, section: str = "chain", field: str = "inertia"):
    """Returns the inertias (n, 3) of a preset with overrides."""
    return np.array(load_spec(name, overrides=overrides).resolved()[section][field])


def test_a_scaled_body_is_the_cloud_of_its_scaled_points() -> None:
    """Six moments of a cloud of points, stretched and heavier, equal those of the new cloud."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(50, 3)) @ Rotation.random(random_state=1).as_matrix()
    points -= points.mean(axis=0)
    stretch, heavier = np.array([0.4, 2.0, 1.3]), 1.7

    def moments(cloud: np.ndarray, mass: float) -> list[float]:
        second = mass * cloud.T @ cloud / len(cloud)
        i = np.trace(second) * np.eye(3) - second
        return [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]

    found = _row(moments(points, 1.2), heavier, stretch.tolist())
    assert np.allclose(found, moments(points * stretch, 1.2 * heavier), rtol=1e-8)


def test_a_shorter_dragon_has_a_smaller_inertia() -> None:
    """Length 0.42 to 0.2: axial moment kept, ∫x² dm in the square of the lengths."""
    xx, yy, zz = 0.0015, 0.0198, 0.0189
    found = chain("dragon4", "chain.length=0.2")
    sx = 0.5 * (yy + zz - xx) * (0.2 / 0.42) ** 2
    sy, sz = 0.5 * (xx + zz - yy), 0.5 * (xx + yy - zz)
    assert np.allclose(found, [[xx, sx + sz, sx + sy]] * 4, rtol=1e-8)
    assert np.array_equal(chain("dragon4"), [[xx, yy, zz]] * 4)
    spec = load_spec("dragon4", overrides=["chain.length=0.2"])
    assert any(w.startswith("chain.inertia: scaled") for w in warnings(spec))
    assert not any("scaled" in w for w in warnings(load_spec("dragon4")))


def test_mass_radius_and_lists_scale_entry_by_entry() -> None:
    """Mass scales all moments, radius the axial one; per-link lists keep their own ratios."""
    base = chain("dragon4")
    assert np.allclose(chain("dragon4", "chain.mass=1.8205"), 2 * base, rtol=1e-8)
    assert np.allclose(chain("dragon4", "chain.radius=0.025")[:, 0], 4 * base[:, 0], rtol=1e-8)
    one = chain("dragon4", "chain.length=[0.42,0.42,0.21,0.42]")
    assert np.array_equal(one[[0, 1, 3]], base[[0, 1, 3]]) and np.all(one[2, 1:] < base[2, 1:])
    arm = chain("arm6")
    shorter = chain("arm6", "chain.length.3=0.1")
    assert np.array_equal(np.delete(shorter, 2, 0), np.delete(arm, 2, 0))
    assert shorter[2, 1] < 0.4 * arm[2, 1] and shorter[2, 0] == pytest.approx(arm[2, 0])
    heavier = chain("arm6", "joint.mass=0.0002", section="joint")
    assert np.allclose(heavier, 2e-8, rtol=1e-8)
    pitch = {"section": "vectoring_apparatus", "field": "pitch_inertia"}
    wider = chain("dragon4", "vectoring_apparatus.separation=0.446", **pitch)
    assert np.all(wider[:, [0, 2]] > 2 * 0.0061) and np.allclose(wider[:, 1], 0.0001)
    halved = chain("dragon4", "vectoring_apparatus.pitch_mass=0.265", **pitch)
    assert np.allclose(halved, np.array([[0.0061, 0.0001, 0.0061]]) / 2, rtol=1e-8)


def test_a_given_inertia_stays_and_is_refused_where_impossible() -> None:
    """An inertia that the override itself sets is not scaled; more than ¼ m L² + Ixx is refused."""
    row = "chain.inertia=[0.0015,0.008,0.008]"
    assert np.array_equal(chain("dragon4", "chain.length=0.2", row)[0], [0.0015, 0.008, 0.008])
    most = 0.25 * 0.91025 * 0.2**2 + 0.0015
    with pytest.raises(SpecError, match=rf"chain\.inertia.*{most:.4g}"):
        load_spec("dragon4", overrides=["chain.length=0.2", "chain.inertia=[0.0015,0.0198,0.0189]"])
    with pytest.raises(SpecError, match=r"pitch_inertia: 0\.1 kg·m²"):
        load_spec("dragon4", overrides=["vectoring_apparatus.pitch_inertia=[0.1,0.01,0.1]"])
    with pytest.raises(SpecError, match=r"screw_drive\.inertia"):
        load_spec("screw4", overrides=["screw_drive.inertia=[0.001,0.05,0.05]"])


@pytest.mark.parametrize("name", sorted(presets()))
@pytest.mark.parametrize("factor", [0.6, 3.0])
def test_every_preset_scales_in_every_size(name: str, factor: float) -> None:
    """Lengths, masses and radii times 0.6 and 3: the inertia is what an affine body has."""
    data = load_spec(name).resolved()["chain"]
    for field, power in (("mass", (1, 1, 1)), ("length", (0, 2, 2)), ("radius", (2, 0, 0))):
        value = [factor * x for x in data[field]]
        found = chain(name, f"chain.{field}={value}")
        old = np.array(data["inertia"])
        if load_spec(name).chain.inertia is not None or field == "mass":  # else a tube of its wall
            assert found[:, 0] == pytest.approx(factor ** power[0] * old[:, 0], rel=1e-6)
        grown = found[:, 1] / old[:, 1]
        limits = sorted([1.0, factor ** max(power)])
        assert np.all((limits[0] - 1e-9 <= grown) & (grown <= limits[1] + 1e-9))
        assert np.all(grown != 1.0)


def test_a_resolved_spec_scales_as_the_spec_does(tmp_path) -> None:
    """Computed inertias that a resolved spec spells out follow an override as rods do."""
    spec = load_spec("screw4")
    (tmp_path / "r.yaml").write_text(yaml_file.dump(spec.resolved()))
    direct = chain("screw4", "chain.length=0.3")
    again = chain(str(tmp_path / "r.yaml"), "chain.length=0.3")
    assert np.allclose(again, direct, rtol=1e-8)
    other = load_spec({"name": "r", "chain": {"links": 2, "length": 0.4, "mass": 1, "com": 0.02}})
    load_spec(other.resolved())  # its own rod is no excess
