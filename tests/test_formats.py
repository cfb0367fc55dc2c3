"""`build --format`: each format is read back by its own tools and is the same robot."""

import ast
import warnings
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml
from click.testing import CliRunner

import snakegen
from snakegen.cli import cli
from snakegen.errors import DescriptionError
from snakegen.pipeline.formats import menagerie, ros2

BUILT = Path("generated/dragon4")


@pytest.fixture(scope="module")
def robot() -> snakegen.Robot:
    return snakegen.load(BUILT / "dragon4.urdf")


@pytest.fixture(scope="module")
def package(robot: snakegen.Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ws") / "other_name"
    folder.mkdir()
    ros2.write_package(BUILT, robot, folder, "other_name", "A <robot> & more.", ("gazebo",))
    return folder


def test_catkin_reads_the_package(package: Path) -> None:
    catkin = pytest.importorskip("catkin_pkg.package")
    found = catkin.parse_package(str(package))
    found.validate()
    assert found.name == "other_name" and "A &lt;robot&gt; &amp; more." in found.description
    needed = {d.name for d in found.exec_depends}
    assert {"robot_state_publisher", "rviz2", "gz_ros2_control"} <= needed
    assert found.get_build_type() == "ament_cmake"
    text = (package / "CMakeLists.txt").read_text(encoding="utf-8")
    installed = text.split("DIRECTORY")[1].split("\n")[0].split()
    assert set(installed) == {p.name for p in package.iterdir() if p.is_dir()}
    assert "share/${PROJECT_NAME}" in text


def test_the_package_is_the_same_robot_with_every_mesh(
    package: Path, robot: snakegen.Robot
) -> None:
    import yourdfpy

    urdf = package / "urdf" / "dragon4.urdf"
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    right = pin.crba(robot.model, robot.model.createData(), q)
    found = pin.crba(model, model.createData(), q)
    servos = [
        robot.model.joints[robot.model.getJointId(s.joint)].idx_v for s in robot.modules.servos
    ]
    found[servos, servos] += [s.armature for s in robot.modules.servos]  # of <snakegen> alone
    np.testing.assert_allclose(np.triu(found), np.triu(right), atol=1e-12)
    seen = yourdfpy.URDF.load(
        str(urdf),
        filename_handler=lambda fname: fname.replace("package://other_name", str(package)),
    )
    assert len(seen.scene.geometry) == len(list(ET.parse(urdf).iter("visual")))
    geometry = pin.buildGeomFromUrdf(
        model, str(urdf), pin.GeometryType.VISUAL, package_dirs=[str(package.parent)]
    )
    assert geometry.ngeoms == len(seen.scene.geometry)


def test_launch_rviz_and_controllers_are_well_formed(package: Path, robot: snakegen.Robot) -> None:
    ast.parse((package / "launch" / "display.launch.py").read_text(encoding="utf-8"))
    rviz = yaml.safe_load((package / "rviz" / "dragon4.rviz").read_text(encoding="utf-8"))
    assert rviz["Visualization Manager"]["Global Options"]["Fixed Frame"] == "link1"
    control = yaml.safe_load((package / "config" / "controllers.yaml").read_text(encoding="utf-8"))
    joints = control["body_controller"]["ros__parameters"]["joints"]
    element = ET.parse(package / "urdf" / "dragon4.urdf").find("ros2_control")
    assert element is not None and [j.get("name") for j in element.findall("joint")] == joints
    assert set(joints) == {s.joint for s in robot.modules.servos}
    limit = element.find("joint[@name='joint1_yaw']/command_interface/param[@name='max']")
    assert limit is not None and float(limit.text or "") == pytest.approx(1.65)


@pytest.mark.parametrize("name", ["Dragon", "2fast", "a__b", "a-b", "x_"])
def test_a_name_that_ros_refuses_is_refused_with_one_that_does(name: str) -> None:
    with pytest.raises(DescriptionError, match="would do") as caught:
        ros2.package_name(name, "dragon4")
    hint = str(caught.value).split("'")[-2]
    assert ros2.package_name(hint, "dragon4") == hint


def test_menagerie_loads_without_a_warning_and_names_every_geom(
    robot: snakegen.Robot, tmp_path: Path
) -> None:
    result = menagerie.write_folder(BUILT, robot, tmp_path, "About it.")
    assert result.passed
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
        first = mujoco.MjModel.from_xml_path(str(BUILT / "scene.xml"))
    names = [model.geom(i).name for i in range(model.ngeom)]
    assert all(names) and len(set(names)) == model.ngeom == first.ngeom
    files = {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()}
    assert {"README.md", "LICENSE", "CHANGELOG.md", "dragon4.png", "scene.xml"} <= files
    assert {"assets/ducted_fan.stl", "assets/joint_cross.stl"} <= files


def test_usd_holds_the_robot_and_a_wrong_stage_is_caught(
    robot: snakegen.Robot, tmp_path: Path
) -> None:
    pytest.importorskip("pxr")
    from pxr import Gf, Usd, UsdPhysics

    from snakegen.pipeline.formats.usd import write_stage
    from snakegen.pipeline.formats.usd_check import check_stage

    path = tmp_path / "dragon4.usda"
    lost = write_stage(robot, path)
    assert any("thrust" in text for text in lost)
    stage = Usd.Stage.Open(str(path))
    drive = UsdPhysics.DriveAPI(stage.GetPrimAtPath("/dragon4/joint1_yaw_joint"), "angular")
    assert drive.GetStiffnessAttr().Get() == pytest.approx(200.0 * np.pi / 180.0)
    assert drive.GetMaxForceAttr().Get() == pytest.approx(7.0)
    rotor = stage.GetPrimAtPath("/dragon4/rotor1_1")
    assert rotor.GetAttribute("snakegen:rotor:thrust_max").Get() == pytest.approx(16.0)

    def spoilt(change: object) -> str:
        wrong = Usd.Stage.Open(str(path))
        change(wrong)  # type: ignore[operator]
        file = tmp_path / f"wrong{len(list(tmp_path.iterdir()))}.usda"  # USD keeps what it opened
        wrong.GetRootLayer().Export(str(file))
        wrong.GetRootLayer().Reload(True)
        with pytest.raises(DescriptionError) as caught:
            check_stage(robot, file)
        return str(caught.value)

    link = "/dragon4/link2"
    joint = "/dragon4/joint2_pitch_joint"
    mass = UsdPhysics.MassAPI
    assert "mass" in spoilt(lambda s: mass(s.GetPrimAtPath(link)).GetMassAttr().Set(0.92))
    assert "centre of mass" in spoilt(
        lambda s: mass(s.GetPrimAtPath(link)).GetCenterOfMassAttr().Set(Gf.Vec3f(0.2, 0, 0))
    )
    assert "inertia" in spoilt(
        lambda s: mass(s.GetPrimAtPath(link)).GetDiagonalInertiaAttr().Set(Gf.Vec3f(0.1, 0.1, 0.1))
    )
    revolute = UsdPhysics.RevoluteJoint
    assert "limit of joint2_pitch" in spoilt(
        lambda s: revolute(s.GetPrimAtPath(joint)).GetLowerLimitAttr().Set(-90.0)
    )
    assert "axis of joint2_pitch" in spoilt(
        lambda s: revolute(s.GetPrimAtPath(joint)).GetLocalRot1Attr().Set(Gf.Quatf(1.0))
    )


def test_options_of_another_format_are_refused(tmp_path: Path) -> None:
    run = CliRunner().invoke(
        cli, ["build", "dragon4", "--package", "x_y", "-o", str(tmp_path / "a")]
    )
    assert run.exit_code == 1 and "--format ros2" in str(run.exception)
    run = CliRunner().invoke(
        cli, ["build", "dragon4", "--format", "usd", "--with", "gazebo", "-o", str(tmp_path / "a")]
    )
    assert run.exit_code == 1 and "ros2" in str(run.exception)
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_a_package(tmp_path: Path) -> None:
    run = CliRunner().invoke(
        cli, ["build", "dragon3", "--format", "ros2", "-o", str(tmp_path / "p"), "--no-picture"]
    )
    assert run.exit_code == 0, run.output
    assert "not carried: rotors" in run.output and "URDF and MJCF agree" in run.output
    text = (tmp_path / "p" / "urdf" / "dragon3.urdf").read_text(encoding="utf-8")
    assert "package://dragon3_description/meshes/ducted_fan.stl" in text
    assert "ros2_control" not in text
