"""Poses and joints of MCAP recordings beside a log: JSON, ROS 2's CDR, and what does not fit."""

import json
from pathlib import Path

import numpy as np
import pytest

import snakegen
from snakegen.errors import LogError
from snakegen.log.mcap_file import read_mcap
from snakegen.log.measured import against
from snakegen.simulation.recording.recording import Recording

pytest.importorskip("mcap")
START = 1_700_000_000.0  # s, of a robot's clock
POSE = """std_msgs/Header header
geometry_msgs/Pose pose
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
JOINTS = """std_msgs/Header header
string[] name
float64[] position
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


@pytest.fixture(scope="module")
def flight() -> Recording:
    return snakegen.simulate("dragon4", "hover", duration=2.0, seed=1, trim=0.0)


def _samples(flight: Recording) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Returns times, root poses (xyz, xyzw) off by 0.02 m in x, and joints off by 0.01 rad."""
    time = np.linspace(0.0, 1.8, 60)
    pose = flight.held("q", time)[:, :7] + [0.02, 0, 0, 0, 0, 0, 0]
    joints = flight.channel("joint_angle")
    angles = flight.held("joint_angle", time) + 0.01
    return time, pose, dict(zip(joints.labels, angles.T, strict=True))


def _stamp(time: float) -> tuple[int, int]:
    whole = int(START + time)
    return whole, round((START + time - whole) * 1e9)


def _json_file(path: Path, flight: Recording, *, twice: bool = False) -> Path:
    from mcap.writer import Writer

    time, pose, joints = _samples(flight)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("any.Name", "jsonschema", b"{}")
        topics = ["/pose", "/joints", "/text", *(["/odom"] if twice else [])]
        channels = {t: writer.register_channel(t, "json", schema) for t in topics}
        channels["/raw"] = writer.register_channel("/raw", "protobuf", 0)
        for k, t in enumerate(time):
            sec, nano = _stamp(t)
            place = {"position": dict(zip("xyz", pose[k, :3].tolist(), strict=True))}
            place["orientation"] = dict(zip("xyzw", pose[k, 3:].tolist(), strict=True))
            found = {
                "/pose": {"timestamp": {"sec": sec, "nsec": nano}, "pose": place},
                "/odom": {
                    "header": {"stamp": {"sec": sec, "nanosec": nano}},
                    "pose": {"pose": place},
                },
                "/joints": {
                    "header": {"stamp": {"sec": sec, "nanosec": nano}},
                    "name": list(joints),
                    "position": [float(v[k]) for v in joints.values()],
                },
                "/text": {"pose": "standing", "name": ["a"]},
            }
            logged = int((START + t + 5.0) * 1e9)  # later than the stamps, which count
            for topic, channel in channels.items():
                data = b"\x08\x01" if topic == "/raw" else json.dumps(found[topic]).encode()
                writer.add_message(channel, logged, data, logged)
        writer.finish()
    return path


def _ros_file(path: Path, flight: Recording) -> Path:
    from mcap_ros2.writer import Writer

    time, pose, joints = _samples(flight)
    with path.open("wb") as file:
        writer = Writer(file)
        posed = writer.register_msgdef("geometry_msgs/msg/PoseStamped", POSE)
        jointed = writer.register_msgdef("sensor_msgs/msg/JointState", JOINTS)
        for k, t in enumerate(time):
            sec, nano = _stamp(t)
            header = {"stamp": {"sec": sec, "nanosec": nano}, "frame_id": "world"}
            place = {"position": dict(zip("xyz", pose[k, :3].tolist(), strict=True))}
            place["orientation"] = dict(zip("xyzw", pose[k, 3:].tolist(), strict=True))
            states = {"name": list(joints), "position": [float(v[k]) for v in joints.values()]}
            for topic, schema, message in (
                ("/mocap", posed, {"header": header, "pose": place}),
                ("/joint_states", jointed, {"header": header, **states}),
            ):
                writer.write_message(topic, schema, message, int((START + t) * 1e9))
        writer.finish()
    return path


@pytest.mark.parametrize("kind", ["json", "ros2"])
def test_poses_and_joints_are_compared(flight: Recording, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "m.mcap"
    if kind == "ros2":
        pytest.importorskip("mcap_ros2")
        _ros_file(path, flight)
    else:
        _json_file(path, flight)
    found = {d.name: d for d in against(flight, path)}
    names = {f"base_{n}" for n in ("x", "y", "z", "roll", "pitch", "yaw")}
    joints = set(flight.channel("joint_angle").labels)
    assert set(found) == names | joints
    # 60 samples a run of 200 Hz: held values of the log are up to a tick old
    assert found["base_x"].bias == pytest.approx(0.02, abs=2e-3)
    assert abs(found["base_y"].bias) < 2e-3 and abs(found["base_yaw"].rmse) < 5e-3
    for name in joints:
        assert found[name].bias == pytest.approx(0.01, abs=1e-3) and found[name].unit == "rad"


def test_times_are_those_of_the_stamps(flight: Recording, tmp_path: Path) -> None:
    found = read_mcap(_json_file(tmp_path / "m.mcap", flight), "link1")
    np.testing.assert_allclose(found["base_x"].time, np.linspace(0.0, 1.8, 60), atol=1e-6)
    assert found["base_x"].topic == "/pose" and found["joint1_yaw"].topic == "/joints"


def test_two_topics_of_one_column_need_a_choice(flight: Recording, tmp_path: Path) -> None:
    path = _json_file(tmp_path / "m.mcap", flight, twice=True)
    with pytest.raises(LogError, match=r"both /pose and /odom hold base_x; choose with --topic"):
        against(flight, path)
    (one,) = {d.name for d in against(flight, path, topics=["/odom"])} & {"base_x"}
    assert one == "base_x"


@pytest.mark.parametrize("damage", ["cut", "flip", "text", "empty", "absent"])
def test_a_damaged_file_is_one_line(flight: Recording, tmp_path: Path, damage: str) -> None:
    path = _json_file(tmp_path / "m.mcap", flight)
    content = bytearray(path.read_bytes())
    if damage == "flip":
        content[len(content) // 3] ^= 16
    kept = {"cut": content[: len(content) // 2], "flip": content, "text": b"time,x\n0,1\n"}
    if damage == "absent":
        path.unlink()
    else:
        path.write_bytes(kept.get(damage, b""))
    with pytest.raises(LogError, match=r"m\.mcap") as error:
        against(flight, path)
    assert "\n" not in str(error.value)


def test_what_cannot_be_read_is_named(flight: Recording, tmp_path: Path) -> None:
    path = _json_file(tmp_path / "m.mcap", flight)
    with pytest.raises(LogError, match=r"no pose and no joint states .*: /raw \(protobuf\)"):
        against(flight, path, topics=["/raw"])
    (tmp_path / "t.csv").write_text("time,x\n0,1\n1,1\n2,1\n")
    with pytest.raises(LogError, match="has no topics"):
        against(flight, tmp_path / "t.csv", topics=["/a"])
