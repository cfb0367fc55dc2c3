"""What quick commands do not import: a lint of a robot waits for no simulator or compiler."""

import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

HEAVY = {"mujoco", "pinocchio", "numba", "scipy", "trimesh", "yourdfpy", "pydantic", "matplotlib"}
ROBOT = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial><visual><geometry>
{}</geometry></visual></link><joint name="j" type="revolute"><parent link="base"/>
<child link="arm"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="5" velocity="1"/>
</joint></robot>"""
SHAPES = {"box": '<box size="1 1 1"/>', "stl": '<mesh filename="arm.stl"/>'}


def imported(*arguments: str) -> set[str]:
    """Returns the top-level modules that a command imports."""
    script = (
        "import sys\nfrom snakegen.cli import main\ntry:\n    main(sys.argv[1:])\n"
        "except SystemExit as end:\n    assert end.code == 0, end.code\n"
        "print('MODULES', *{name.partition('.')[0] for name in sys.modules})"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True
    )
    return set(done.stdout.rpartition("MODULES ")[2].split())


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version_import_no_numerics(option: str) -> None:
    assert not imported(option) & (HEAVY | {"numpy"})


@pytest.mark.parametrize("shape", SHAPES)
def test_lint_imports_what_a_mesh_needs_alone(tmp_path: Path, shape: str) -> None:
    trimesh.creation.box((0.4, 0.4, 0.4)).export(tmp_path / "arm.stl")
    path = tmp_path / "r.urdf"
    path.write_text(ROBOT.format(SHAPES[shape]))
    assert not imported("lint", str(path)) & HEAVY


def test_a_mesh_of_another_format_is_read_by_trimesh(tmp_path: Path) -> None:
    trimesh.creation.box((0.4, 0.4, 0.4)).export(tmp_path / "arm.obj")
    path = tmp_path / "r.urdf"
    path.write_text(ROBOT.format('<mesh filename="arm.obj"/>'))
    assert "trimesh" in imported("lint", str(path))
