"""Meshes: closed, where they claim to be, the same bytes twice; inertias against trimesh's."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
import yourdfpy
from hypothesis import given, settings
from hypothesis import strategies as st

from snakegen.description.meshes import parts
from snakegen.errors import DescriptionError
from snakegen.spec import inertia

PARTS = {
    "fan": parts.ducted_fan(),
    "small_fan": parts.ducted_fan(0.07, 0.05, 3, spin=-1),
    "cross": parts.joint_cross(),
    "drum": parts.screw_drum(0.075, 0.206, math.pi / 4),
    "drum_left": parts.screw_drum(0.075, 0.206, math.pi / 4, hand=-1, wheels_per_blade=0),
}
GIVEN_SIZE = {
    "fan": (1.0, 1.0, 0.7),
    "small_fan": (0.07, 0.07, 0.05),
    "cross": (1.0, 0.84, 0.84),
    "drum_left": (0.206, None, None),
}


@pytest.mark.parametrize("name", PARTS)
def test_closed_and_light(name: str) -> None:
    mesh = PARTS[name]
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert all(body.volume > 0 for body in mesh.split(only_watertight=False))
    assert 100 < len(mesh.faces) <= 3000


@pytest.mark.parametrize("name", GIVEN_SIZE)
def test_size(name: str) -> None:
    for found, asked in zip(PARTS[name].extents, GIVEN_SIZE[name], strict=True):
        assert asked is None or found == pytest.approx(asked, rel=2e-3)


def radius_about_x(mesh: trimesh.Trimesh) -> float:
    return float(np.linalg.norm(mesh.vertices[:, 1:], axis=1).max())


def test_drum_wheels_touch_their_radius() -> None:
    assert radius_about_x(PARTS["drum"]) == pytest.approx(0.075, rel=0.02)
    assert radius_about_x(PARTS["drum_left"]) < 0.065


@pytest.mark.parametrize("hand", [1, -1])
def test_drum_blades_follow_the_helix_angle(hand: int) -> None:
    """At the ground (z < 0) seen from above, a blade runs along [cos α, sin α] (HA eq 3)."""
    alpha = 0.5
    drum = parts.screw_drum(0.1, 0.08, alpha, hand=hand, blades=1, wheels_per_blade=0)
    blade = max(drum.split(), key=lambda body: np.linalg.norm(body.centroid[1:]))
    outer = blade.vertices[np.linalg.norm(blade.vertices[:, 1:], axis=1) > 0.08]
    azimuth = np.unwrap(np.arctan2(outer[:, 2], outer[:, 1])) + np.pi / 2
    slope = np.polyfit(outer[:, 0], 0.1 * azimuth, 1)[0]
    assert slope == pytest.approx(hand * math.tan(alpha), rel=1e-6)
    assert blade.centroid[2] < 0


@pytest.mark.parametrize("spin", [1, -1])
def test_fan_blows_down(spin: int) -> None:
    """A blade's leading edge (ahead in the sense of rotation) lies higher: thrust is along +z."""
    fan = parts.ducted_fan(blades=7, spin=spin)
    heights = []
    for body in fan.split():
        x, y, z = body.centroid
        if math.hypot(x, y) < 0.1 or z < 0:
            continue
        around = spin * np.array([-y, x]) / math.hypot(x, y)
        ahead = (body.vertices[:, :2] - [x, y]) @ around
        heights.append(np.polyfit(ahead, body.vertices[:, 2], 1)[0])
    assert len(heights) == 7 and min(heights) > 0.2


def test_mirror_fans_are_mirror_images() -> None:
    one, other = (parts.ducted_fan(spin=spin) for spin in (1, -1))
    assert one.volume == pytest.approx(other.volume)
    assert np.array_equal(one.vertices * [1, -1, 1], other.vertices)


def test_cross_pins_lie_on_the_two_axes() -> None:
    vertices = PARTS["cross"].vertices
    assert vertices[vertices[:, 1] > 0.41].mean(axis=0)[0] == pytest.approx(-0.32)
    assert vertices[vertices[:, 2] > 0.41].mean(axis=0)[0] == pytest.approx(0.32)


def test_bytes_repeat_and_load(tmp_path: Path) -> None:
    first = parts.write_meshes(tmp_path / "a", PARTS)
    second = parts.write_meshes(tmp_path / "b", {"fan": parts.ducted_fan()})
    assert first["fan"].read_bytes() == second["fan"].read_bytes()
    assert not first["fan"].read_bytes().startswith(b"solid")
    for name, path in first.items():
        loaded = trimesh.load_mesh(path)
        assert loaded.volume == pytest.approx(PARTS[name].volume, rel=1e-2)
        # at 70 mm the blades' trailing edges are thinner than the rounding
        assert loaded.is_watertight or name == "small_fan"


def test_stl_ignores_the_last_bits() -> None:
    """Noise of 0.1 nm, far above what a sine's last bit does, does not reach the file."""
    mesh = parts.joint_cross()
    noise = np.random.default_rng(3).uniform(-1e-10, 1e-10, mesh.vertices.shape)
    shaken = trimesh.Trimesh(mesh.vertices + noise, mesh.faces, process=False)
    assert not np.array_equal(shaken.vertices.astype("f4"), mesh.vertices.astype("f4"))
    assert parts.stl_bytes(shaken) == parts.stl_bytes(mesh)
    moved = trimesh.Trimesh(mesh.vertices * (1 + 1e-4), mesh.faces, process=False)
    assert parts.stl_bytes(moved) != parts.stl_bytes(mesh)


def test_mujoco_reads_every_mesh(tmp_path: Path) -> None:
    parts.write_meshes(tmp_path, PARTS)
    assets = "".join(f'<mesh name="{n}" file="{tmp_path}/{n}.stl"/>' for n in PARTS)
    geoms = "".join(f'<geom type="mesh" mesh="{n}"/>' for n in PARTS)
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{assets}</asset><worldbody>{geoms}</worldbody></mujoco>"
    )
    assert model.nmesh == len(PARTS)


lengths = st.floats(0.01, 10)


def triangle(moments: np.ndarray) -> bool:
    low, mid, high = np.sort(np.linalg.eigvalsh(moments))
    return bool(low > 0 and high <= (low + mid) * (1 + 1e-9))


def moments_of(mesh: trimesh.Trimesh, mass: float) -> np.ndarray:
    """Returns trimesh's inertia (3, 3) of a mesh filled evenly, about its centre of mass."""
    filled = mesh.copy()
    filled.density = mass / filled.volume
    return filled.moment_inertia


@given(lengths, st.tuples(lengths, lengths, lengths))
@settings(max_examples=50, deadline=None)
def test_box_inertia(mass: float, size: tuple[float, float, float]) -> None:
    found = moments_of(trimesh.creation.box(size), mass)
    assert np.allclose(np.diag(inertia.box(mass, size)), found, rtol=1e-9, atol=1e-9 * found.max())
    assert triangle(found)


@given(lengths, lengths, lengths, st.floats(0.1, 0.95))
@settings(max_examples=25, deadline=None)
def test_round_inertias(mass: float, radius: float, length: float, bore: float) -> None:
    """A prism of n sides has the cylinder's moments to O(1/n²)."""
    solid = parts.solids.cylinder(radius, 0, length, "x", 256)
    tube = parts.solids.cylinder(radius, 0, length, "x", 256, bore=bore * radius)
    for mesh, closed in (
        (solid, inertia.cylinder(mass, radius, length)),
        (tube, inertia.tube(mass, radius, (1.0 - bore) * radius, length)),
    ):
        found = moments_of(mesh, mass)
        assert np.allclose(np.diag(closed), found, rtol=5e-4, atol=1e-6 * found.max())
        assert triangle(np.diag(closed))


def test_refusals() -> None:
    with pytest.raises(DescriptionError, match="diameter > 0"):
        parts.ducted_fan(-1.0)


@pytest.mark.parametrize("name", ["dragon4", "hybrid4", "screw4"])
def test_a_joints_inertia_is_that_of_the_cross_that_is_shown(name: str) -> None:
    """yourdfpy's mesh, filled evenly with the joint's mass, has the inertia that is declared."""
    folder = Path(__file__).parent.parent / "generated" / name
    seen = yourdfpy.URDF.load(str(folder / f"{name}.urdf"))
    inertial, graph = seen.link_map["joint1_cross"].inertial, seen.scene.graph
    (node,) = [
        n for n in graph.nodes_geometry if "joint1_cross" in str(graph.transforms.parents[n])
    ]
    pose, geometry = graph.get(node, frame_from="joint1_cross")
    mesh = seen.scene.geometry[geometry].copy().apply_transform(pose)
    mesh.density = inertial.mass / mesh.volume
    assert 200.0 < mesh.density < 1400.0  # of servos, or less where it stands out of thick rods
    np.testing.assert_allclose(mesh.center_mass, inertial.origin[:3, 3], atol=1e-6)
    np.testing.assert_allclose(*map(np.diag, (mesh.moment_inertia, inertial.inertia)), rtol=0.02)
