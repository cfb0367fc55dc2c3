"""Declared inertias against meshes: what no body inside them has is found, what some has is not."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from snakegen import lint
from snakegen.linter import lint as linting

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
