"""The lint against a table of faults, each one small change of a clean URDF."""

from pathlib import Path

import pinocchio
import pytest
from clean_urdf import GOOD

from snakegen.errors import DescriptionError
from snakegen.linter.lint import check, lint

LINK3 = '<link name="link3"/>\n  <joint name="joint1"'
MESH = 'filename="rod.stl"'

# name: (text of GOOD, its replacement, code of the finding, severity)
FAULTS: dict[str, tuple[str, str, str, str]] = {
    "tag not closed": ("</joint>", "", "malformed_xml", "error"),
    "empty": (GOOD, "<", "malformed_xml", "error"),
    "other root": (GOOD, "<model/>", "not_a_robot", "error"),
    "negative mass": ('mass value="1.2"', 'mass value="-1.2"', "negative_mass", "error"),
    "zero mass": ('mass value="1.2"', 'mass value="0"', "inertia_without_mass", "warning"),
    "nan mass": ('mass value="1.2"', 'mass value="nan"', "not_finite", "error"),
    "infinite mass": ('mass value="1.2"', 'mass value="1e999"', "not_finite", "error"),
    "mass in words": ('mass value="1.2"', 'mass value="1,2"', "not_numeric", "error"),
    "mass without value": ('<mass value="1.2"/>', "<mass/>", "missing_attribute", "error"),
    "no mass": ('<mass value="1.2"/>', "", "missing_element", "error"),
    "zero inertia": ('ixx="0.01"', 'ixx="0"', "bad_inertia", "error"),
    "negative inertia": ('iyy="0.02"', 'iyy="-0.02"', "bad_inertia", "error"),
    "indefinite inertia": ('iyz="0" izz', 'iyz="0.03" izz', "bad_inertia", "error"),
    "triangle": ('izz="0.02"', 'izz="0.0401"', "inertia_triangle", "error"),
    "rotated triangle": ('iyz="0" izz', 'iyz="0.0131" izz', "inertia_triangle", "error"),
    "limits swapped": ('lower="-1" upper="1"', 'lower="1" upper="-1"', "limits_swapped", "error"),
    "lower alone": ('lower="-1" upper="1"', 'lower="0.2"', "limits_swapped", "error"),
    "negative effort": ('effort="7"', 'effort="-7"', "negative_limit", "error"),
    "negative velocity": ('velocity="0.5"', 'velocity="-0.5"', "negative_limit", "error"),
    "no effort": ('effort="7" ', "", "missing_limit", "error"),
    "no velocity": (' velocity="0.5"', "", "missing_limit", "error"),
    "no limit": (
        '<limit lower="-1" upper="1" effort="7" velocity="0.5"/>',
        "",
        "missing_limit",
        "error",
    ),
    "long axis": ('axis xyz="0 0 1"', 'axis xyz="0 0 2"', "axis_not_unit", "warning"),
    "rounded axis": ('axis xyz="0 0 1"', 'axis xyz="0.7071 0 0.7071"', "axis_rounded", "note"),
    "zero axis": ('axis xyz="0 0 1"', 'axis xyz="0 0 0"', "zero_axis", "error"),
    "two parents": (
        '<joint name="weld"',
        '<joint name="second" type="fixed"><parent link="base"/><child link="link2"/></joint>'
        '<joint name="weld"',
        "two_parents",
        "error",
    ),
    "no root": ('parent link="base"', 'parent link="link2"', "loop", "error"),
    "island loop": ('<parent link="link1"/>', '<parent link="link2"/>', "loop", "error"),
    "own parent": ('<parent link="link1"/>', '<parent link="cross"/>', "loop", "error"),
    "two roots": ('<joint name="joint1"', LINK3, "two_roots", "error"),
    "link twice": ('<link name="cross"/>', '<link name="link1"/>', "duplicate_link", "error"),
    "joint twice": ('name="joint2"', 'name="joint1"', "duplicate_joint", "error"),
    "material twice": (
        '<link name="base"/>',
        '<material name="grey"><color rgba="1 0 0 1"/></material><link name="base"/>',
        "duplicate_material",
        "warning",
    ),
    "dangling parent": ('parent link="link1"', 'parent link="lnk1"', "dangling_parent", "error"),
    "dangling child": ('child link="cross"', 'child link="gone"', "dangling_child", "error"),
    "dangling mimic": ('mimic joint="joint1"', 'mimic joint="jiont1"', "dangling_mimic", "error"),
    "own mimic": ('mimic joint="joint1"', 'mimic joint="joint2"', "mimic_loop", "error"),
    "missing mesh": (MESH, 'filename="gone.stl"', "missing_mesh", "warning"),
    "absolute mesh": (MESH, 'filename="/gone/rod.stl"', "absolute_mesh", "warning"),
    "package mesh": (MESH, 'filename="package://two/rod.stl"', "package_mesh", "note"),
    "file mesh": (MESH, 'filename="file:///gone/rod.stl"', "absolute_mesh", "warning"),
    "web mesh": (MESH, 'filename="https://x.org/rod.stl"', "remote_mesh", "warning"),
    "unknown tag": ("<collision>", "<colision/><collision>", "misspelt_tag", "error"),
    "unknown robot tag": ("<gazebo ", "<gazbo/><gazebo ", "unknown_tag", "note"),
    "xacro left": ("<gazebo ", "<xacro:fan/><gazebo ", "xacro_left", "error"),
    "mass in link": (
        '<link name="link2">',
        '<link name="link2"><mass/>',
        "misplaced_tag",
        "warning",
    ),
    "gazebo in link": (
        '<link name="link2">',
        '<link name="link2"><gazebo/>',
        "misplaced_tag",
        "warning",
    ),
    "unknown attribute": ('lower="-1"', 'lowr="-1"', "misspelt_attribute", "error"),
    "unknown joint type": ("revolute", "revolut", "unknown_joint_type", "error"),
    "massless": (
        '<link name="cross"/>',
        '<link name="cross"/><link name="x"/>',
        "massless_tip",
        "warning",
    ),
    "short vector": ('xyz="0 0 0.1"', 'xyz="0 0.1"', "component_count", "error"),
    "long vector": ('size="0.1 0.1 0.2"', 'size="0.1 0.1 0.2 0.3"', "component_count", "warning"),
    "empty vector": ('axis xyz="0 0 1"', 'axis xyz=""', "component_count", "error"),
    "nan in vector": ('xyz="0 0 0.1"', 'xyz="0 NaN 0.1"', "not_finite", "error"),
    "word in vector": ('xyz="0 0 0.1"', 'xyz="0 O 0.1"', "not_numeric", "error"),
    "underscore": ('size="0.1 0.1 0.2"', 'size="0.1 0.1 1_0"', "not_numeric", "error"),
    "negative size": ('radius="0.01"', 'radius="-0.01"', "bad_size", "warning"),
    "two shapes": ("<box ", '<sphere radius="1"/><box ', "shapeless_geometry", "warning"),
    "no geometry": (
        "<visual><geometry><box ",
        "<visual/><visual><geometry><box ",
        "missing_element",
        "error",
    ),
    "two inertials": (
        "<collision>",
        '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
        "</inertial><collision>",
        "repeated_element",
        "warning",
    ),
    "nameless link": ('<link name="cross"/>', '<link name=""/>', "missing_attribute", "error"),
    "negative damping": ('damping="0.1"', 'damping="-0.1"', "negative_dynamics", "error"),
    "locked joint": ('lower="-1" upper="1" ', "", "locked_joint", "warning"),
}
JOINT3 = (
    '<joint name="joint3" type="revolute"><parent link="link2"/><child link="x"/>'
    '<axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rod.stl").write_bytes(b"mesh")
    (tmp_path / "good.urdf").write_text(GOOD, encoding="utf-8")
    return tmp_path


def mutate(name: str) -> str:
    """Returns GOOD with one fault; the text to replace has to be there."""
    old, new, _, _ = FAULTS[name]
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    return (
        text.replace('<joint name="weld"', JOINT3 + '<joint name="weld"')
        if name == "massless"
        else text
    )


def test_clean(folder: Path) -> None:
    assert lint(folder / "good.urdf") == []
    assert lint(str(folder / "good.urdf")) == []
    assert lint("\ufeff" + GOOD, folder=folder) == []
    check(folder / "good.urdf")


def test_parsers_agree_that_it_is_good() -> None:
    """Pinocchio reads the clean file too, so the faults of the table are those and no others."""
    model = pinocchio.buildModelFromXML(GOOD)
    assert list(model.names)[1:] == ["joint1", "joint2"]
    assert sum(inertia.mass for inertia in model.inertias) == pytest.approx(2.0)


@pytest.mark.parametrize("name", FAULTS)
def test_fault(name: str, folder: Path) -> None:
    _, _, code, severity = FAULTS[name]
    text = mutate(name)
    found = lint(text, folder=folder)
    assert (code, severity) in {(f.code, f.severity) for f in found}
    changed = next(
        (
            i
            for i, (a, b) in enumerate(zip(text.splitlines(), GOOD.splitlines(), strict=False))
            if a != b
        ),
        0,
    )
    lines = [f.line for f in found if f.code == code]
    # what is absent has no line of its own, and a loop closes elsewhere; the rest is told in place
    far = {
        "tag not closed",
        "no root",
        "island loop",
        "own parent",
        "massless",
        "no limit",
        "no mass",
    }
    if name not in far:
        assert changed + 1 in lines
    if severity == "error":
        with pytest.raises(DescriptionError, match=r"line \d+"):
            check(text, folder=folder)
    else:
        check(text, folder=folder)
        assert {f.severity for f in found} <= {"warning", "note"}


def test_one_mistake_is_told_once(folder: Path) -> None:
    # these mutations really break two rules
    twofold = {
        "absolute mesh",
        "file mesh",
        "no root",
        "link twice",
        "joint twice",
        "nameless link",
        "zero mass",
        "package mesh",
    }
    alone = [name for name in FAULTS if name not in twofold]
    counts = {name: [f.code for f in lint(mutate(name), folder=folder)] for name in alone}
    assert {name: codes for name, codes in counts.items() if len(codes) != 1} == {}


@pytest.mark.parametrize(
    "name,hint",
    [
        ("unknown tag", "'collision'"),
        ("unknown robot tag", "'gazebo'"),
        ("unknown attribute", "'lower'"),
        ("unknown joint type", "'revolute'"),
        ("dangling parent", "'link1'"),
        ("dangling mimic", "'joint1'"),
        ("mass in link", "<inertial>"),
        ("gazebo in link", "<robot>"),
    ],
)
def test_message_names_the_remedy(name: str, hint: str, folder: Path) -> None:
    (finding,) = lint(mutate(name), folder=folder)
    assert hint in finding.message


def test_a_tree_without_root(folder: Path) -> None:
    codes = [f.code for f in lint(mutate("no root"), folder=folder)]
    # the base, too, hangs on something now
    ring = mutate("no root").replace(
        '<joint name="weld"',
        '<joint name="ring" type="fixed"><parent link="link2"/><child link="base"/></joint>'
        '<joint name="weld"',
    )
    assert "no_root" not in codes
    assert {"no_root", "loop"} == {f.code for f in lint(ring, folder=folder)}
    (finding,) = lint('<robot name="empty"/>')
    assert finding.code == "no_root"
