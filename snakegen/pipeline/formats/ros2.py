"""A ROS 2 description package: package.xml, CMakeLists, URDF with package:// meshes, launch, RViz.

``ros2_control`` and Gazebo elements are written on request.
"""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Collection
from pathlib import Path

import yaml

from snakegen import __version__
from snakegen.errors import DescriptionError
from snakegen.pipeline.formats.filled import fill, xml_text
from snakegen.robot.robot import Robot

PARTS = ("ros2_control", "gazebo")
"""Elements that are written only when asked for."""

_RATE = 200  # Hz of the controller manager
_DEPENDS = (
    "joint_state_publisher_gui", "launch", "launch_ros", "robot_state_publisher", "rviz2",
)  # fmt: skip
_CONTROL_DEPENDS = (
    "controller_manager", "joint_state_broadcaster", "joint_trajectory_controller",
    "ros2_control",
)  # fmt: skip


def package_name(given: str | None, robot: str) -> str:
    """Returns the name of the package, checked against what ROS allows (REP 144).

    Raises:
        DescriptionError: the name that would do is in the message.
    """
    name = f"{_plain(robot)}_description" if given is None else given
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or len(name) < 2:
        raise DescriptionError(
            f"package name '{name}': ROS takes lower-case letters, digits and single underscores, "
            f"a letter first; '{_plain(name)}' would do."
        )
    return name


def write_package(
    built: Path, robot: Robot, folder: Path, package: str, about: str, parts: Collection[str] = ()
) -> tuple[str, ...]:
    """Writes the package of a build into `folder`; returns what it does not carry.

    Args:
        built: folder of the build.
        robot: the robot that was built.
        folder: empty; filled with what colcon takes.
        package: its name.
        about: one sentence.
        parts: of `PARTS`.
    """
    name = robot.name
    root = ET.fromstring((built / f"{name}.urdf").read_text(encoding="utf-8"))
    for mesh in root.iter("mesh"):
        mesh.set("filename", f"package://{package}/{mesh.get('filename', '')}")
    folders = ["urdf", "meshes", "launch", "rviz"]
    rows, depends = "", [*_DEPENDS]
    lost = _lost(robot, parts)
    joints = _driven(robot)
    if "gazebo" in parts and "ros2_control" not in parts:
        parts = (*parts, "ros2_control")  # the plugin that drives the joints reads it
    if "ros2_control" in parts:
        root.append(_ros2_control(robot, joints, simulated="gazebo" in parts))
        depends += _CONTROL_DEPENDS
        folders.append("config")
        path = folder / "config" / "controllers.yaml"
        path.parent.mkdir(parents=True)
        path.write_text(yaml.safe_dump(_controllers(joints), sort_keys=False), encoding="utf-8")
        rows += "| `config/controllers.yaml` | a trajectory controller over the servos' joints |\n"
    if "gazebo" in parts:
        root.append(_gazebo(package))
        depends += ["gz_ros2_control", "ros_gz_sim"]
    if (built / "meshes").is_dir():
        shutil.copytree(built / "meshes", folder / "meshes")
    else:
        folders.remove("meshes")
    ET.indent(root)
    (folder / "urdf").mkdir()
    (folder / "urdf" / f"{name}.urdf").write_text(
        '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8"
    )
    lines = "".join(f"  <exec_depend>{d}</exec_depend>\n" for d in sorted(depends))
    fill(
        "ros2/package.xml", folder / "package.xml", package=package, about=xml_text(about),
        email="maintainer@example.com", maintainer="maintainer", depends=lines,
    )  # fmt: skip
    fill(
        "ros2/CMakeLists.txt", folder / "CMakeLists.txt", package=package, folders=" ".join(folders)
    )
    launch = folder / "launch" / "display.launch.py"
    fill("ros2/display.launch.py", launch, package=package, name=name)
    base = robot.root_link or root.find("link").get("name")  # type: ignore[union-attr]
    size = max(3.0 * robot.link_length, 1.0)
    fill("ros2/display.rviz", folder / "rviz" / f"{name}.rviz", root=base, distance=f"{size:.2f}")
    text_there = "; ".join(lost) or "nothing that URDF could say"
    fill(
        "ros2/README.md", folder / "README.md", package=package, about=about, name=name,
        version=__version__, rows=rows, lost=text_there,
    )  # fmt: skip
    return lost


def _plain(name: str) -> str:
    """Returns the nearest name that ROS takes."""
    words = re.findall(r"[a-z0-9]+", name.lower())
    out = "_".join(words) or "robot"
    return out if out[0].isalpha() and len(out) > 1 else f"robot_{out}"


def _driven(robot: Robot) -> list[str]:
    """Returns the joints that a position servo holds."""
    served = {s.joint for s in robot.modules.servos}
    return [name for name in robot.joint_names if name in served]


def _lost(robot: Robot, parts: Collection[str]) -> tuple[str, ...]:
    lost = []
    if robot.modules.apparatuses:
        lost.append("rotors push in no ROS package of a plain description")
    if robot.modules.screws:
        lost.append("screw drums have no controller")
    if parts and any(s.stiffness for s in robot.modules.servos):
        lost.append("stiffness and lag of servos, which ros2_control does not state")
    return tuple(lost)


def _ros2_control(robot: Robot, joints: list[str], *, simulated: bool) -> ET.Element:
    kind = "gz_ros2_control/GazeboSimSystem" if simulated else "mock_components/GenericSystem"
    element = ET.Element("ros2_control", name=robot.name, type="system")
    hardware = ET.SubElement(element, "hardware")
    ET.SubElement(hardware, "plugin").text = kind
    low, high, _ = robot.limits(joints)
    for name, least, most in zip(joints, low, high, strict=True):
        joint = ET.SubElement(element, "joint", name=name)
        command = ET.SubElement(joint, "command_interface", name="position")
        ET.SubElement(command, "param", name="min").text = f"{least:.9g}"
        ET.SubElement(command, "param", name="max").text = f"{most:.9g}"
        ET.SubElement(joint, "state_interface", name="position")
        ET.SubElement(joint, "state_interface", name="velocity")
    return element


def _controllers(joints: list[str]) -> dict[str, object]:
    kinds = {
        "joint_state_broadcaster": "joint_state_broadcaster/JointStateBroadcaster",
        "body_controller": "joint_trajectory_controller/JointTrajectoryController",
    }
    manager: dict[str, object] = {"update_rate": _RATE}
    manager |= {name: {"type": kind} for name, kind in kinds.items()}
    body = {
        "joints": joints,
        "command_interfaces": ["position"],
        "state_interfaces": ["position", "velocity"],
    }
    return {
        "controller_manager": {"ros__parameters": manager},
        "body_controller": {"ros__parameters": body},
    }


def _gazebo(package: str) -> ET.Element:
    element = ET.Element("gazebo")
    plugin = ET.SubElement(
        element, "plugin", filename="gz_ros2_control-system",
        name="gz_ros2_control::GazeboSimROS2ControlPlugin",
    )  # fmt: skip
    where = f"$(find {package})/config/controllers.yaml"
    ET.SubElement(plugin, "parameters").text = where
    return element
