"""Declared inertias against meshes: what no body inside them has is found, what some has is not."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from snakegen import lint
from snakegen.linter import lint as linting
from snakegen.linter.triangle_solids import enclosed, is_closed, link_triangles, read_stl
from snakegen.linter.xml_tree import parse_xml

SIZE = np.array([0.4, 0.1, 0.06])
MASS = 2.0
EVEN = MASS / 12.0 * np.array([SIZE[1:] @ SIZE[1:], SIZE[::2] @ SIZE[::2], SIZE[:2] @ SIZE[:2]])
ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Holds a box in metres, the same in millimetres, and one with a side missing."""
    made = tmp_path_factory.mktemp("meshes")
    box = trimesh.creation.box(SIZE)
    box.export(made / "box.stl")
    box.copy().apply_scale(1000.0).export(made / "box_mm.stl")
    trimesh.Trimesh(box.vertices, box.faces[:-2]).export(made / "open.obj")
    return made


def urdf(
    inertia: np.ndarray, *, mass: float = MASS, mesh: str = "box.stl", scale: float = 1.0,
    com: str = "0 0 0", rpy: str = "0 0 0",
) -> str:  # fmt: skip
    """Returns a robot of one link with a mesh."""
    values = np.asarray(inertia)[np.triu_indices(3)]
    entries = " ".join(f'{n}="{x:.9g}"' for n, x in zip(ENTRIES, values, strict=True))
    return (
        '<?xml version="1.0"?>\n<robot name="r">\n  <link name="link1">\n    <inertial>\n'
        f'      <origin xyz="{com}" rpy="{rpy}"/>\n      <mass value="{mass}"/>\n'
        f"      <inertia {entries}/>\n    </inertial>\n    <visual><geometry>"
        f'<mesh filename="{mesh}" scale="{scale} {scale} {scale}"/></geometry></visual>\n'
        "  </link>\n</robot>\n"
    )


FAULTY = {
    "mesh_inertia_large": {"inertia": 100.0 * np.diag(EVEN)},
    "mesh_inertia_small": {"inertia": 1e-4 * np.diag(EVEN)},
    "mesh_com_outside": {"inertia": np.diag(EVEN), "com": "0.5 0 0"},
    "mesh_density": {"inertia": np.diag(EVEN), "mesh": "box_mm.stl", "scale": 0.05},
}


@pytest.mark.parametrize("code", FAULTY)
def test_each_code_has_a_faulty_file(folder: Path, code: str) -> None:
    """The rule sees it, with the line of the element, and `check`, which loads robots, is quick."""
    text = urdf(**FAULTY[code])
    found = {f.code: f for f in lint(text, folder=folder)}
    assert code in found and found[code].tier == "physics" and found[code].severity == "warning"
    assert found[code].line == (7 if "inertia" in code else 4)
    assert not any(f.code.startswith("mesh_") for f in lint(text, folder=folder, quick=True))
    linting.check(text, folder=folder)


@pytest.mark.parametrize("mesh", ["box.stl", "box_mm.stl", "open.obj"])
def test_an_evenly_filled_mesh_is_sound(folder: Path, mesh: str) -> None:
    """Closed, open or in millimetres: the closed form of a box's inertia is not complained of."""
    scale = 1e-3 if "mm" in mesh else 1.0
    assert lint(urdf(np.diag(EVEN), mesh=mesh, scale=scale), folder=folder) == []


def test_no_distribution_inside_the_mesh_is_called_impossible(folder: Path) -> None:
    """Point masses anywhere in the box, at its corners too, in turned axes: never too large."""
    rng = np.random.default_rng(2)
    for trial in range(40):
        count = int(rng.integers(4, 30))
        points = (rng.random((count, 3)) - 0.5) * SIZE
        if trial % 2:
            points = 0.5 * SIZE * rng.choice([-1.0, 1.0], (count, 3))
        masses = rng.dirichlet(np.ones(count)) * MASS
        com = masses @ points / MASS
        arms = points - com
        tensor = np.einsum("n,nij->ij", masses, np.einsum("nk,nk->n", arms, arms)[:, None, None]
                           * np.eye(3) - np.einsum("ni,nj->nij", arms, arms))  # fmt: skip
        roll = rng.uniform(-3, 3)
        c, s = np.cos(roll), np.sin(roll)
        turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        text = urdf(turn.T @ tensor @ turn, com=" ".join(map(str, com)), rpy=f"{roll} 0 0")
        codes = {f.code for f in lint(text, folder=folder)}
        assert "mesh_inertia_large" not in codes and "mesh_com_outside" not in codes


def test_the_bound_is_four_times_that_of_the_corners(folder: Path) -> None:
    """Just below four times all mass at the corners' distance passes, just above it does not."""
    most = MASS * (SIZE[1] ** 2 + SIZE[2] ** 2) / 4.0  # about x
    flat = MASS * SIZE[0] ** 2 / 6.0
    for share, seen in ((0.99, False), (3.96, False), (4.04, True)):
        found = lint(urdf(np.diag([share * most, flat, flat])), folder=folder)
        assert ("mesh_inertia_large" in {f.code for f in found}) == seen


def test_a_damaged_or_missing_mesh_is_left_to_its_own_rule(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "box.stl").write_bytes(b"no mesh")
    assert not any(f.code.startswith("mesh_") for f in lint(urdf(np.diag(EVEN)), folder=tmp_path))
    codes = {f.code for f in lint(urdf(np.diag(EVEN), mesh="gone.stl"), folder=tmp_path)}
    assert codes == {"missing_mesh"}


def triangles(mesh: trimesh.Trimesh) -> np.ndarray:
    return np.asarray(mesh.triangles, np.float32)


@pytest.mark.parametrize("text", [False, True])
def test_closed_stl_solids_are_those_of_trimesh(tmp_path: Path, text: bool) -> None:
    """Volume and inertia of a hollow, turned, scaled body from its own triangles."""
    hollow = trimesh.util.concatenate(
        [trimesh.creation.icosphere(3, 0.2), trimesh.creation.box((0.1, 0.05, 0.04))]
    )
    hollow.faces[-12:] = hollow.faces[-12:, ::-1]  # the box is a hole
    hollow.apply_transform(trimesh.transformations.euler_matrix(0.3, 0.5, -0.2))
    hollow.export(tmp_path / "h.stl", file_type="stl_ascii" if text else "stl")
    found = read_stl(tmp_path / "h.stl")
    assert found is not None and is_closed(found)
    volume, inertia = enclosed(found.astype(float))
    assert volume == pytest.approx(hollow.mass_properties.volume, rel=1e-4)
    np.testing.assert_allclose(inertia, hollow.mass_properties.inertia, rtol=1e-3, atol=1e-7)


@pytest.mark.parametrize("fault", ["hole", "twice", "flipped", "nan"])
def test_what_is_not_closed_is_not_called_so(fault: str) -> None:
    sound = triangles(trimesh.creation.icosphere(2, 1.0))
    assert is_closed(sound) and is_closed(sound[::-1])
    broken = {
        "hole": sound[1:],
        "twice": np.concatenate([sound, sound[:1]]),
        "flipped": np.concatenate([sound[1:], sound[:1, ::-1]]),
        "nan": np.concatenate([sound[1:], np.full((1, 3, 3), np.nan, np.float32)]),
    }[fault]
    assert not is_closed(broken)


def test_primitives_beside_a_mesh_count(tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    shapes = {"sphere radius='0.2'": 4 / 3 * np.pi * 0.008, "box size='.1 .2 .3'": 0.006,
              "cylinder radius='0.1' length='0.3'": np.pi * 0.003}  # fmt: skip
    for shape, volume in shapes.items():
        text = f"<link><visual><geometry><{shape}/></geometry></visual><collision><origin "
        text += "xyz='1 0 0'/><geometry><mesh filename='box.stl'/></geometry></collision></link>"
        found = link_triangles(parse_xml(text), lambda name: tmp_path / name)
        assert found is not None
        assert enclosed(found)[0] == pytest.approx(0.001 + volume, rel=0.03)
