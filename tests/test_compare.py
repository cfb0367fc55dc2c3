"""Comparison of two robot files: its own MJCF is the same robot, every planted change is named."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.cli import main
from snakegen.errors import DescriptionError

GENERATED = Path(__file__).parent.parent / "generated"
PRESETS = ("dragon3", "dragon4", "arm6", "grasper3", "screw4", "hybrid4")
ARM = """<robot name="arm">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.2 0.01 0" rpy="0.3 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link>
  <link name="camera"><inertial><origin xyz="0 0.02 0"/><mass value="0.1"/>
    <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
  <link name="tool"/>
  <link name="finger"><inertial><origin xyz="0.05 0 0"/><mass value="0.3"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
  <link name="thumb"><inertial><origin xyz="0.05 0 0"/><mass value="0.3"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
  <joint name="shoulder" type="revolute"><origin xyz="0 0 0.2" rpy="0 0.1 0"/>
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="20" velocity="2"/>
    <dynamics damping="0.4" friction="0.1"/></joint>
  <joint name="eye" type="fixed"><origin xyz="0.1 0.02 0.3" rpy="0.1 0.2 0.3"/>
    <parent link="upper"/><child link="camera"/></joint>
  <joint name="wrist" type="fixed"><origin xyz="0.5 0 0"/>
    <parent link="upper"/><child link="tool"/></joint>
  <joint name="lead" type="prismatic"><origin xyz="0 0.05 0"/>
    <parent link="tool"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="30" velocity="1"/></joint>
  <joint name="follow" type="prismatic"><origin xyz="0 -0.05 0"/>
    <parent link="tool"/><child link="thumb"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="30" velocity="1"/>
    <mimic joint="lead" multiplier="0.5" offset="0.01"/></joint>
</robot>
"""
Change = Callable[[mujoco.MjSpec], None]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm")
    (folder / "mine.urdf").write_text(ARM)
    snakegen.convert(folder / "mine.urdf", folder / "out")
    return folder / "out"


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_the_same_robot_as_its_own_mjcf(name: str) -> None:
    folder = GENERATED / name
    found = snakegen.compare(folder / f"{name}.urdf", folder / f"{name}.xml")
    assert found.same and found.differences == ()


def test_two_presets_differ() -> None:
    found = snakegen.compare(GENERATED / "dragon3/dragon3.urdf", GENERATED / "dragon4/dragon4.xml")
    assert not found.same
    assert any("link 'link4' is in dragon4.xml alone" in text for text in found.differences)


def _set(path: str, value: object) -> Change:
    """Returns a change of one attribute: ``body upper mass``."""
    kind, name, attribute = path.split()

    def change(spec: mujoco.MjSpec) -> None:
        element = getattr(spec, kind)(name)
        old = getattr(element, attribute)
        new = value(old) if callable(value) else value
        setattr(element, attribute, new)

    return change


def _renamed(spec: mujoco.MjSpec) -> None:
    for pair in list(spec.excludes):
        spec.delete(pair)
    spec.body("link3").name = "limb3"


def _gear(scale: float, row: int = 0) -> Callable[[np.ndarray], list[float]]:
    return lambda old: [x * (scale if k == row else 1.0) for k, x in enumerate(old)]


def _turned(old: np.ndarray) -> list[float]:
    return [*(np.asarray(old) + np.eye(4)[1] * 1e-3)]


DRAGON: dict[str, tuple[Change, str]] = {
    "mass": (_set("body link2 mass", lambda m: m * 1.001), "mass of body 'link2'"),
    "centre": (
        _set("body link2 ipos", lambda p: p + np.array([0, 1e-3, 0])),
        "centre of mass of body 'link2'",
    ),
    "inertia": (_set("body link2 fullinertia", lambda i: _scaled(i)), "inertia"),
    "frame": (_set("body link3 pos", lambda p: p + np.array([0, 0, 1e-4])), "position of link"),
    "attitude": (_set("body link3 quat", _turned), "attitude of link"),
    "axis": (_set("joint joint2_yaw axis", [0.0, 0.01, 1.0]), "axis of joint 'joint2_yaw'"),
    "place": (
        _set("joint joint2_yaw pos", [0.0, 1e-3, 0.0]),
        "axis position of joint 'joint2_yaw'",
    ),
    "limit": (_set("joint joint2_yaw range", [-1.5, 1.5]), "limit of joint 'joint2_yaw'"),
    "armature": (_set("joint joint2_yaw armature", 0.5), "armature of joint 'joint2_yaw'"),
    "damping": (
        _set("joint joint2_yaw damping", lambda d: d + 0.5),
        "damping of joint 'joint2_yaw'",
    ),
    "friction": (_set("joint joint2_yaw frictionloss", 0.5), "friction of joint 'joint2_yaw'"),
    "spring": (
        _set("joint joint2_yaw stiffness", [1.0, 0.0, 0.0]),
        "spring stiffness of joint 'joint2_yaw'",
    ),
    "gear": (_set("actuator joint2_yaw gear", _gear(2.0)), "gear of actuator 'joint2_yaw'"),
    "drag": (_set("actuator rotor1_1 gear", _gear(-1.0, 5)), "gear) of actuator 'rotor1_1'"),
    "range": (
        _set("actuator rotor1_1 ctrlrange", [0.0, 1.0]),
        "most command (range) of actuator 'rotor1_1'",
    ),
    "lag": (_set("actuator rotor1_1 dynprm", [0.07, *[0.0] * 9]), "lag of actuator 'rotor1_1'"),
    "force": (_set("actuator joint2_yaw forcerange", [-1.0, 1.0]), "effort of joint 'joint2_yaw'"),
    "gain": (
        _set("actuator joint2_yaw gainprm", [7.0, *[0.0] * 9]),
        "gain of actuator 'joint2_yaw'",
    ),
    "thrust point": (
        _set("site rotor1_1 pos", lambda p: p + np.array([0, 0, 1e-3])),
        "thrust point of actuator 'rotor1_1'",
    ),
    "target": (_set("actuator joint2_yaw target", "joint1_yaw"), "target of actuator 'joint2_yaw'"),
    "name": (_renamed, "'limb3' has its place there"),
    "missing": (
        lambda spec: spec.delete(spec.actuator("rotor2_1")),
        "actuator 'rotor2_1' is in dragon4.urdf alone",
    ),
    "base": (lambda spec: spec.delete(spec.joint("root")), "base: free in dragon4.urdf, fixed"),
}


def _scaled(inertia: np.ndarray) -> list[float]:
    return [*(np.asarray(inertia) * 1.001)]


def _changed(source: Path, target: Path, change: Change) -> Path:
    """Writes the MJCF `source` with one change into a folder that has its meshes."""
    spec = mujoco.MjSpec.from_file(str(source))
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    for key in list(spec.keys):
        spec.delete(key)
    change(spec)
    if not (target / "meshes").exists() and (source.parent / "meshes").exists():
        shutil.copytree(source.parent / "meshes", target / "meshes")
    path = target / source.name
    path.write_text(spec.to_xml())
    return path


@pytest.mark.parametrize("planted", DRAGON)
def test_a_planted_difference_is_caught_and_named(planted: str, tmp_path: Path) -> None:
    change, words = DRAGON[planted]
    source = GENERATED / "dragon4"
    theirs = _changed(source / "dragon4.xml", tmp_path, change)
    found = snakegen.compare(source / "dragon4.urdf", theirs)
    assert not found.same
    assert any(words in text for text in found.differences), found.differences[:5]
    errors = [d.error for d in found.details]
    assert errors == sorted(errors, reverse=True)


ARM_CHANGES: dict[str, tuple[str, str, str]] = {
    "mass": ('<mass value="1"/>', '<mass value="1.01"/>', "mass of body 'upper'"),
    "welded mass": ('<mass value="0.1"/>', '<mass value="0.11"/>', "mass of body 'upper'"),
    "axis": ('xyz="0 1 0"', 'xyz="0 -1 0"', "axis of joint 'shoulder'"),
    "limit": ('upper="2"', 'upper="2.1"', "upper limit of joint 'shoulder'"),
    "effort": ('effort="20"', 'effort="21"', "effort of joint 'shoulder': 21 N·m"),
    "damping": ('damping="0.4"', 'damping="0.5"', "damping of joint 'shoulder'"),
    "mimic ratio": ('multiplier="0.5"', 'multiplier="0.6"', "mimic multiplier of joint 'follow'"),
    "mimic offset": ('offset="0.01"', 'offset="0.02"', "mimic offset of joint 'follow'"),
    "follower": ('<mimic joint="lead" multiplier="0.5" offset="0.01"/>', "", "leader (mimic)"),
    "type": ('name="lead" type="prismatic"', 'name="lead" type="revolute"', "type of joint 'lead'"),
    "frame": ('<origin xyz="0.5 0 0"/>', '<origin xyz="0.6 0 0"/>', "position of link 'tool'"),
    "fixed": ('name="shoulder" type="revolute"', 'name="shoulder" type="fixed"',
              "joint 'shoulder' is in arm.xml alone"),
}  # fmt: skip


@pytest.mark.parametrize("planted", ARM_CHANGES)
def test_a_changed_urdf_differs_from_the_conversion(
    planted: str, arm: Path, tmp_path: Path
) -> None:
    old, new, words = ARM_CHANGES[planted]
    assert ARM.count(old) >= 1
    (tmp_path / "changed.urdf").write_text(ARM.replace(old, new, 1))
    found = snakegen.compare(tmp_path / "changed.urdf", arm / "arm.xml")
    assert not found.same
    assert any(words in text for text in found.differences), found.differences


def test_a_conversion_is_the_same_robot(arm: Path) -> None:
    found = snakegen.compare(arm / "arm.urdf", arm / "arm.xml")
    assert found.same, found.differences
    assert any("does not say what drives it" in note for note in found.notes)


def test_the_mass_of_the_root_that_mujoco_drops_is_found(arm: Path, tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(arm / "arm.urdf"))  # welds the root into the world
    mujoco.mj_saveLastXML(str(tmp_path / "fused.xml"), model)
    found = snakegen.compare(arm / "arm.urdf", tmp_path / "fused.xml", tolerance=1e-4)
    assert "mass of body 'base': 2 kg in arm.urdf, 0 kg in fused.xml" in found.differences
    assert any("link 'camera' is in arm.urdf alone" in text for text in found.differences)
    quantities = {d.quantity for d in found.details}
    assert "inertia ixx" not in quantities and "axis" not in quantities  # what moves is the same


def test_names_are_mapped_and_unknown_ones_refused(arm: Path, tmp_path: Path) -> None:
    text = ARM.replace('"shoulder"', '"joint_a1"').replace('"upper"', '"link_1"')
    (tmp_path / "theirs.urdf").write_text(text)
    mine, theirs = arm / "arm.xml", tmp_path / "theirs.urdf"
    plain = snakegen.compare(mine, theirs)
    assert any("'joint_a1' has its place there" in text for text in plain.differences)
    names = {"shoulder": "joint_a1", "upper": "link_1"}
    assert snakegen.compare(mine, theirs, names=names).same
    with pytest.raises(DescriptionError, match=r"no link, joint or actuator 'shoulde'\. Did you"):
        snakegen.compare(mine, theirs, names={"shoulde": "joint_a1"})


def test_an_offset_of_the_root_is_found_and_a_tilt_is_a_difference(
    arm: Path, tmp_path: Path
) -> None:
    def lifted(spec: mujoco.MjSpec) -> None:
        spec.body("base").pos = [0.1, 0.2, 0.5]
        spec.body("base").quat = [np.cos(0.2), 0.0, 0.0, np.sin(0.2)]

    def tilted(spec: mujoco.MjSpec) -> None:
        spec.body("base").quat = [np.cos(0.2), np.sin(0.2), 0.0, 0.0]

    found = snakegen.compare(arm / "arm.urdf", _changed(arm / "arm.xml", tmp_path, lifted))
    assert found.same
    assert "the root stands at (0.1, 0.2, 0.5) m" in found.notes[0]
    found = snakegen.compare(arm / "arm.urdf", _changed(arm / "arm.xml", tmp_path, tilted))
    assert found.differences == (
        "attitude of the base: turned by 0.4 rad against gravity in arm.xml",
    )


def test_a_locked_joint_and_a_repeated_element_survive_the_conversion(tmp_path: Path) -> None:
    text = ARM.replace('lower="-1" upper="2"', 'lower="0.5" upper="0.5"')
    text = text.replace('friction="0.1"/>', 'friction="0.1"/><dynamics damping="9"/>')
    (tmp_path / "locked.urdf").write_text(text)
    made = snakegen.convert(tmp_path / "locked.urdf", tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(made.mjcf))
    joint = model.joint("shoulder").id
    assert model.jnt_limited[joint] and np.allclose(model.jnt_range[joint], 0.5, atol=1e-9)
    assert model.dof_damping[model.jnt_dofadr[joint]] == 0.4
    assert any("second <dynamics>" in text for text in made.warnings)
    assert snakegen.compare(tmp_path / "locked.urdf", made.mjcf).same


def test_command_exits_with_3_and_prints_json(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other.urdf").write_text(ARM.replace('upper="2"', 'upper="2.1"'))
    (tmp_path / "map.yaml").write_text("[shoulder]\n")
    args = ["compare", str(arm / "arm.xml"), str(tmp_path / "other.urdf")]
    with pytest.raises(SystemExit) as end:
        main([*args, "--json"])
    data = json.loads(capsys.readouterr().out)
    assert end.value.code == 3 and data["same"] is False
    assert data["differences"] == [
        "upper limit of joint 'shoulder': 2 rad in arm.xml, 2.1 rad in other.urdf"
    ]
    with pytest.raises(SystemExit) as end:
        main(["compare", str(arm / "arm.urdf"), str(arm / "arm.xml")])
    assert end.value.code == 0 and "the same robot" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        main([*args, "--map", str(tmp_path / "map.yaml")])
    assert end.value.code == 1 and "a map has a name of A" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", ["<sdf/>", "no xml", "<mujoco><worldbody><geom/></worldbody></mujoco>"]
)
def test_what_is_no_robot_is_refused_in_one_line(text: str, arm: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.xml").write_text(text)
    with pytest.raises(DescriptionError, match=r"bad\.xml"):
        snakegen.compare(arm / "arm.xml", tmp_path / "bad.xml")
