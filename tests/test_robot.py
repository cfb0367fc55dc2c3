"""Robots are read from presets, specs and URDFs of anyone; postures by joint name."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import snakegen
from snakegen.analysis import along, mass
from snakegen.analysis.allocation import allocation
from snakegen.errors import AnalysisError, DescriptionError, PostureError, SnakegenError, SpecError
from snakegen.simulation.flight.world import make_world
from snakegen.spec.loading import load_spec, presets

FOREIGN = """<?xml version="1.0"?>
<robot name="foreign">
  <link name="hull">
    <inertial><origin xyz="0.1 0 0"/><mass value="2"/>
      <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="ring">
    <inertial><mass value="0.3"/>
      <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="prop_up">
    <inertial><mass value="0.05"/>
      <inertia ixx="1e-5" iyy="1e-5" izz="2e-5" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="prop_down">
    <inertial><mass value="0.05"/>
      <inertia ixx="1e-5" iyy="1e-5" izz="2e-5" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="tilt" type="revolute">
    <parent link="hull"/><child link="ring"/><origin xyz="0.2 0 0.05"/><axis xyz="1 0 0"/>
    <limit lower="-1.5" upper="1.5" effort="2" velocity="5"/>
  </joint>
  <joint name="spin_up" type="continuous">
    <parent link="ring"/><child link="prop_up"/><origin xyz="0 0.1 0"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="spin_down" type="continuous">
    <parent link="ring"/><child link="prop_down"/>
    <origin xyz="0 -0.1 0" rpy="3.141592653589793 0 0"/><axis xyz="0 0 1"/>
  </joint>
</robot>
"""
MODULES = """floating_root: hull
apparatuses:
  - roll: tilt
    rotors:
      - {link: prop_up, thrust_min: 0, thrust_max: 20, drag_ratio: -0.01}
      - {link: prop_down, thrust_min: 0, thrust_max: 20, drag_ratio: 0.01, axis: [0, 0, -1]}
"""


def _foreign(folder: Path, urdf: str = FOREIGN, modules: str | None = MODULES) -> snakegen.Robot:
    path, side = folder / "foreign.urdf", folder / "modules.yaml"
    path.write_text(urdf, encoding="utf-8")
    if modules is None:
        return snakegen.load(path)
    side.write_text(modules, encoding="utf-8")
    return snakegen.load(path, modules=side)


@pytest.mark.parametrize("name", sorted(presets()))
def test_preset_spec_and_urdf_are_one_robot(name: str, tmp_path: Path) -> None:
    """A preset, its RobotSpec, its file and the URDF it builds all load as the same robot."""
    built = snakegen.build(name, tmp_path / "built", picture=False)
    robots = [
        snakegen.load(name),
        snakegen.load(load_spec(name)),
        snakegen.load(presets()[name]),
        snakegen.load(built.spec),
        snakegen.load(built.urdf),
        snakegen.load(str(built.urdf)),
    ]
    first = robots[0]
    assert first.name == name
    for other in robots[1:]:
        assert other.modules == first.modules
        assert other.joint_names == first.joint_names
        assert np.array_equal(other.tree.mass, first.tree.mass)
        assert np.array_equal(other.model.armature, first.model.armature)


def test_armature_is_in_the_model() -> None:
    """Servo armature reaches Pinocchio's mass matrix, else it would differ from MuJoCo's."""
    robot = snakegen.load("dragon4")
    joint = robot.model.joints[robot.model.getJointId("joint1_pitch")]
    assert robot.model.armature[joint.idx_v] == 0.005
    assert robot.modules.servos[0].armature == 0.005


def test_foreign_urdf_with_modules(tmp_path: Path) -> None:
    """Rotors on spinning joints, one along −z; checked against moments worked out by hand."""
    robot = _foreign(tmp_path)
    assert robot.floating and robot.chain_joints == () and robot.gimbal_names == {"tilt"}
    q = robot.configuration({"tilt": 0.4, "spin_up": 2.0, "spin_down": -1.0})
    found = allocation(robot, q)
    cog = np.array(pin.centerOfMass(robot.model, robot.model.createData(), q))
    c, s = np.cos(0.4), np.sin(0.4)
    axis = np.array([0.0, -s, c])
    for k, (y, drag) in enumerate(((0.1, -0.01), (-0.1, 0.01))):
        place = np.array([0.2, c * y, 0.05 + s * y]) - cog
        column = np.concatenate([axis, np.cross(place, axis) + drag * axis])
        np.testing.assert_allclose(found.dual[:, k], column, atol=1e-12)
    assert found.mass == pytest.approx(2.4)
    turned = robot.configuration({"tilt": 0.4})
    np.testing.assert_allclose(allocation(robot, turned).dual, found.dual, atol=1e-12)


def test_mass_is_that_of_the_whole_body() -> None:
    """A fixed root link counts, as MuJoCo counts it; the row says how much of it is held."""
    robot = snakegen.load("arm6")
    q = robot.configuration({"joint1_yaw": 0.7, "joint3_pitch": -0.4})
    world = make_world(robot)
    data = mujoco.MjData(world.model)
    world.set_state(data, q)
    mujoco.mj_forward(world.model, data)
    found = mass.analyze(robot, q)
    assert found.mass == pytest.approx(world.model.body_subtreemass[0], rel=1e-9)
    np.testing.assert_allclose(found.cog, data.subtree_com[0], atol=1e-9)
    assert "of it the fixed root link" in dict(found.rows())["mass"]


def test_a_motion_with_a_column_that_is_no_joint_is_refused(tmp_path: Path) -> None:
    """A mistyped joint would else stay where the posture has it, unsaid."""
    robot = snakegen.load("dragon4")
    table = tmp_path / "w.csv"
    table.write_text("time,joint1_yaw,joint2_ywa\n0,0.5,0.5\n1,-0.5,0.1\n")
    with pytest.raises(AnalysisError, match=r"'joint2_ywa' is no joint .* mean 'joint2_yaw'"):
        along.analyze(robot, robot.configuration(), table=str(table))


def test_foreign_urdf_without_modules_is_an_arm(tmp_path: Path) -> None:
    """A bare URDF has a fixed base and no rotors; analyses that need none still run."""
    robot = _foreign(tmp_path, modules=None)
    assert not robot.floating and robot.modules.apparatuses == ()
    with pytest.raises(PostureError, match=r"fixed base"):
        robot.configuration({"base_rpy": [0, 0, 1]})


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("prop_up", "prop_upp", r"no link 'prop_upp'. Did you mean 'prop_up'"),
        ("roll: tilt", "roll: tlt", r"no joint 'tlt'. Did you mean 'tilt'"),
        ("floating_root: hull", "floating_root: ring", r"not the URDF's root link 'hull'"),
        ("thrust_max: 20", "thrust_mx: 20", r"no field 'thrust_mx'. Did you mean 'thrust_max'"),
        ("thrust_min: 0, thrust_max: 20", "thrust_min: 30, thrust_max: 20", r"are no range"),
        ("thrust_max: 20", "thrust_max: .nan", r"thrust_max: nan is not a number"),
        ("thrust_max: 20", "thrust_max: strong", r"modules.yaml"),
        ("[0, 0, -1]", "[0, 0, 0]", r"is no direction"),
        ("[0, 0, -1]", "[0, 1]", r"is no direction"),
        ("    rotors:", "    rators:", r"no field 'rators'. Did you mean 'rotors'"),
        ("apparatuses:", "apparatus:", r"no field 'apparatus'. Did you mean 'apparatuses'"),
        ("- roll: tilt", "- [tilt", r"not YAML"),
        (MODULES, "", r"write 'floating_root:' and 'apparatuses:'"),
        (MODULES, "apparatuses: 3", r"apparatuses"),
        (MODULES, "apparatuses: [{rotors: 3}]", r"rotors"),
        (MODULES, "servos: [{joint: nope}]", r"joint 'nope', which does not exist"),
        (MODULES, "link_length: long", r"link_length"),
    ],
)
def test_mistakes_in_a_modules_file(old: str, new: str, expected: str, tmp_path: Path) -> None:
    """Each mistake in a modules file is one SnakegenError that names the place."""
    with pytest.raises(SnakegenError, match=expected) as caught:
        _foreign(tmp_path, modules=MODULES.replace(old, new))
    assert "\n" not in str(caught.value)


def test_unreadable_urdfs(tmp_path: Path) -> None:
    """No file, a folder, bytes, half a file, another format: one line, with the file's name."""
    for content in (b"\xff\xfe\x00", b"<robot name='x'><link", b"", b"hello", b"<mujoco/>"):
        path = tmp_path / "broken.urdf"
        path.write_bytes(content)
        with pytest.raises(SnakegenError, match=r"broken\.urdf") as caught:
            snakegen.load(path)
        assert "\n" not in str(caught.value)
    (tmp_path / "folder.urdf").mkdir()
    with pytest.raises(DescriptionError, match=r"folder\.urdf"):
        snakegen.load(tmp_path / "folder.urdf")
    with pytest.raises(DescriptionError, match=r"no such file"):
        snakegen.load(tmp_path / "none.urdf")
    with pytest.raises(SpecError, match=r"no such file"):
        snakegen.load(tmp_path / "none.yaml")
    with pytest.raises(SnakegenError, match=r"--modules goes with a URDF"):
        snakegen.load("dragon4", modules=tmp_path / "m.yaml")


def test_configuration() -> None:
    """Names land where Pinocchio has them; base_rpy and base_position in its order, xyzw."""
    robot = snakegen.load("dragon4")
    posture = {"joint1_yaw": 0.5, "gimbal2_pitch": -0.1, "base_position": [1, 2, 3]}
    q = robot.configuration(posture, base_rpy=(0.1, 0.2, 0.3))
    assert q.dtype == np.float64 and q.shape == (robot.model.nq,)
    np.testing.assert_array_equal(q[:3], [1, 2, 3])
    expected = pin.Quaternion(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3)).coeffs()
    np.testing.assert_allclose(q[3:7], expected, atol=1e-15)
    angles = dict(zip(robot.joint_names, robot.angles(q), strict=True))
    assert {k: v for k, v in angles.items() if v} == {"joint1_yaw": 0.5, "gimbal2_pitch": -0.1}
    idx = robot.model.joints[robot.model.getJointId("joint1_yaw")].idx_q
    assert q[idx] == 0.5


@pytest.mark.parametrize(
    ("posture", "expected"),
    [
        ({"joint1_ya": 0.5}, r"no joint 'joint1_ya'. Did you mean 'joint1_yaw'"),
        ({"joint1_yaw": 2.0}, r"joint1_yaw = 2 is outside its limits -1.65 … 1.65"),
        ({"joint1_yaw": float("nan")}, r"joint1_yaw: nan is not a finite number"),
        ({"joint1_yaw": "much"}, r"joint1_yaw: 'much' is not a number"),
        ({"joint1_yaw": True}, r"not a finite number"),
        ({"joint1_yaw": None}, r"is not a number"),
        ({"base_rpy": [0, 1]}, r"base_rpy: three numbers are needed"),
        ({"base_rpy": 3}, r"base_rpy: three numbers are needed"),
        ({"base_position": [0, 0, "up"]}, r"base_position: 'up' is not a number"),
    ],
)
def test_mistakes_in_a_posture(posture: dict, expected: str) -> None:
    """Unknown joints are named with the near ones; values out of range with the range."""
    with pytest.raises(PostureError, match=expected):
        snakegen.load("dragon4").configuration(posture)


def test_q_is_checked() -> None:
    """A q of another robot, or with NaN, is refused where it enters."""
    robot = snakegen.load("dragon4")
    with pytest.raises(PostureError, match=r"q has shape \(3,\), \(21,\) needed"):
        robot.angles(np.zeros(3))
    with pytest.raises(PostureError, match=r"NaN"):
        robot.angles(np.full(robot.model.nq, np.nan))
