"""Habits of other people: grippers, nacelles on one axis, missing packages, idle shafts."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import snakegen
from snakegen.cli import cli
from snakegen.errors import MissionError
from snakegen.linter.lint import lint
from snakegen.log.body import drawable
from snakegen.robot.adoption.adopt import draft
from snakegen.simulation.flight.run import prepare, run
from snakegen.statics.tip import find_tip

SMALL = '<inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/>'


def link(name: str, mass: float = 0.1, rest: str = "") -> str:
    return f'<link name="{name}"><inertial><mass value="{mass}"/>{SMALL}</inertial>{rest}</link>\n'


def joint(name: str, kind: str, parent: str, child: str, xyz: str, rest: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}"/><parent link="{parent}"/>'
        f'<child link="{child}"/>{rest}</joint>\n'
    )


LIMIT = '<limit lower="-1" upper="1" effort="9" velocity="3"/>'


def gripper(*, mimic: bool = True, tool: bool = True, linkage: bool = False) -> str:
    body = link("base", 1.0) + link("upper", 1.0) + link("palm")
    body += joint("lift", "revolute", "base", "upper", "0 0 0.1", '<axis xyz="0 1 0"/>' + LIMIT)
    follows = '<mimic joint="lift" multiplier="-1"/>' if linkage else ""
    turn = '<axis xyz="0 1 0"/>' + LIMIT + follows
    body += joint("wrist", "revolute", "upper", "palm", "0.4 0 0", turn)
    for side, way in (("left", 1), ("right", -1)):
        body += link(f"{side}_finger", 0.03) + link(f"{side}_tip", 0.01)
        follows = '<mimic joint="left_slide"/>' if mimic and way < 0 else ""
        slide = f'<axis xyz="0 {way} 0"/>{LIMIT}{follows}'
        body += joint(f"{side}_slide", "prismatic", "palm", f"{side}_finger", "0.1 0 0", slide)
        body += joint(f"{side}_pad", "fixed", f"{side}_finger", f"{side}_tip", "0.05 0 0")
    if tool:
        body += '<link name="tool0"/>' + joint("tool", "fixed", "palm", "tool0", "0.12 0 0")
    return f'<robot name="pick">\n{body}</robot>'


@pytest.mark.parametrize(
    ("given", "tip"),
    [
        ({}, "tool0"),
        ({"tool": False}, "palm"),
        ({"linkage": True}, "tool0"),
        ({"mimic": False}, "left_tip"),  # nothing says that they are a gripper
    ],
)
def test_fingers_that_mimic_each_other_carry_no_tip(
    given: dict[str, bool], tip: str, tmp_path: Path
) -> None:
    path = tmp_path / "pick.urdf"
    path.write_text(gripper(**given))
    assert find_tip(snakegen.load(path)).link == tip


def test_a_linkage_that_mimics_is_part_of_the_chain(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    lead = '<axis xyz="0 1 0"/>' + LIMIT
    text = link("base") + link("a") + link("b")
    text += joint("lead", "revolute", "base", "a", "0 0 0", lead)
    follow = f'{lead}<mimic joint="lead" multiplier="-1"/>'
    text += joint("follow", "revolute", "a", "b", "0.5 0 0", follow)
    path.write_text(f'<robot name="r">{text}</robot>')
    assert find_tip(snakegen.load(path)).link == "b"


def nacelles(axis: str, *, count: int = 4) -> str:
    """Rotors in nacelles that all tilt about one axis of the body, as those of a convertiplane."""
    body = link("base_link", 2.0).replace("1e-4", "0.03")
    for k in range(count):
        angle = np.pi / count + k * 2 * np.pi / count
        spot = f"{0.3 * np.cos(angle):.5f} {0.3 * np.sin(angle):.5f} 0.02"
        tilt = f'<axis xyz="{axis}"/><limit lower="-1.57" upper="1.57" effort="2" velocity="6"/>'
        body += link(f"nacelle_{k}", 0.08) + link(f"prop_{k}", 0.012)
        body += joint(f"tilt_{k}", "revolute", "base_link", f"nacelle_{k}", spot, tilt)
        spin = '<axis xyz="0 0 1"/><limit effort="0" velocity="0"/>'
        body += joint(f"spin_{k}", "continuous", f"nacelle_{k}", f"prop_{k}", "0 0 0.03", spin)
    return f'<robot name="convert">\n{body}</robot>'


@pytest.mark.parametrize(("axis", "count"), [("0 1 0", 4), ("1 0 0", 4), ("0 1 0", 6)])
def test_nacelles_on_one_axis_are_adopted_and_fly(axis: str, count: int, tmp_path: Path) -> None:
    path = tmp_path / "nacelles.urdf"
    path.write_text(nacelles(axis, count=count))
    made = draft(path)
    assert made.data["control"] == {"mode": "dual_rotor"}
    assert "mode: dual_rotor  # guess: free gimbals leave an axis without force" in made.text
    modules = tmp_path / "modules.yaml"
    modules.write_text(made.text)
    robot = snakegen.load(path, modules=modules)
    assert run(robot, "hover", options={"duration": 5.0}, seed=1).verdict.passed
    free = snakegen.load(path, modules={k: v for k, v in made.data.items() if k != "control"})
    with pytest.raises(MissionError, match=r"lacks an axis; control: \{mode: dual_rotor\}"):
        prepare(free, "hover")


def test_nacelles_that_reach_six_axes_keep_their_mode(tmp_path: Path) -> None:
    text = nacelles("1 0 0")
    for k, axis in enumerate(("1 1 0", "-1 1 0", "-1 -1 0", "1 -1 0")):
        text = text.replace('<axis xyz="1 0 0"/>', f'<axis xyz="{axis}" k="{k}"/>', 1)
    path = tmp_path / "radial.urdf"
    path.write_text(text)
    assert "control" not in draft(path).data


RANGE = 'lower="-1" upper="1" effort="9"'


def test_a_range_beyond_a_turn_is_converted(tmp_path: Path) -> None:
    path = tmp_path / "pick.urdf"
    path.write_text(gripper().replace(RANGE, 'lower="3.3" upper="4" effort="9"', 1))
    made = snakegen.convert(path, tmp_path / "out")
    assert snakegen.compare(path, made.mjcf).same


def test_a_robot_without_any_effort_is_analysed(tmp_path: Path) -> None:
    path = tmp_path / "pick.urdf"
    path.write_text(gripper().replace('effort="9"', 'effort="0"'))
    done = CliRunner().invoke(cli, ["analyze", str(path)])
    assert done.exit_code == 0, done.exception


@pytest.mark.parametrize(
    "moment, code", [("1e-12", "gyration_small"), ("4000", "gyration_large"), ("1e-4", "")]
)
def test_inertias_of_links_without_shapes(moment: str, code: str, tmp_path: Path) -> None:
    path = tmp_path / "pick.urdf"
    path.write_text(gripper().replace("1e-4", moment, 3))
    assert {f.code for f in lint(path) if f.severity == "warning"} == ({code} if code else set())


def test_a_misspelt_colour_is_no_error(tmp_path: Path) -> None:
    path = tmp_path / "pick.urdf"
    shape = '<visual><geometry><sphere radius="1"/></geometry><meterial name="a"/></visual>'
    path.write_text(gripper().replace('name="palm">', f'name="palm">{shape}', 1))
    found = [(f.severity, f.code) for f in lint(path) if f.severity != "note"]
    assert ("warning", "misspelt_tag") in found and "error" not in dict(found)


def test_shafts_without_effort_are_a_note(tmp_path: Path) -> None:
    path = tmp_path / "nacelles.urdf"
    path.write_text(nacelles("0 1 0"))
    found = lint(path)
    assert {f.code for f in found if f.severity != "note"} == set()
    assert sum(f.code == "no_effort" for f in found) == 4


MISSING = (
    '<visual><geometry><mesh filename="package://my_robot/meshes/leg.dae"/></geometry></visual>'
)


def test_a_mesh_that_many_links_lack_is_one_warning_with_a_remedy(tmp_path: Path) -> None:
    path = tmp_path / "legs.urdf"
    text = gripper().replace('name="palm">', f'name="palm">{MISSING}', 1)
    path.write_text(text.replace('name="upper">', f'name="upper">{MISSING}', 1))
    made = snakegen.convert(path, tmp_path / "out")
    (said,) = [w for w in made.warnings if "leg.dae" in w]
    assert "visual of 2 links ('upper', 'palm')" in said
    assert "set ROS_PACKAGE_PATH to the folder that holds my_robot" in said


def test_the_viewer_gets_no_mesh_that_is_not_there(tmp_path: Path) -> None:
    text = gripper().replace('name="palm">', f'name="palm">{MISSING}', 1)
    for folder in (tmp_path, None):
        assert "leg.dae" not in drawable(text, folder)
    mesh = tmp_path / "my_robot" / "meshes" / "leg.dae"
    mesh.parent.mkdir(parents=True)
    mesh.write_text("<COLLADA/>")
    assert str(mesh) in drawable(text, tmp_path)


def test_a_fix_without_edits_says_so(tmp_path: Path) -> None:
    path = tmp_path / "pick.urdf"
    path.write_text(gripper())
    done = CliRunner().invoke(cli, ["lint", str(path), "--fix"])
    assert "nothing to fix" in done.output and path.read_text() == gripper()


def test_commands_import_no_library_that_they_do_without() -> None:
    code = "import sys, snakegen.cli; print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert not loaded & {"numpy", "hashlib", "secrets", "tempfile", "ctypes"}
