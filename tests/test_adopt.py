"""Adoption: the modules file that is drafted for a stranger's robot is the one a person writes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.base import yaml_file
from snakegen.cli import main
from snakegen.errors import DescriptionError
from snakegen.robot.adoption.adopt import draft
from tests.foreign_robots import ROBOTS, hexarotor


@pytest.fixture(scope="module")
def adopted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Returns path and draft of each robot."""
    folder, out = tmp_path_factory.mktemp("robots"), {}
    for name, make in ROBOTS.items():
        path = folder / f"{name}.urdf"
        path.write_text(make())
        out[name] = path, draft(path)
    return out


def rotors(data: dict[str, Any]) -> list[dict[str, Any]]:
    return [r for a in data["apparatuses"] for r in a["rotors"]]


def test_motor_plugins_give_spin_thrust_drag_and_lag(adopted: dict[str, Any]) -> None:
    data = adopted["hexa"][1].data
    assert data["floating_root"] == "base_link"
    assert [r["link"] for r in rotors(data)] == [f"rotor_{k}" for k in range(6)]
    for k, r in enumerate(rotors(data)):
        assert r["thrust_max"] == pytest.approx(9e-6 * 900**2)
        assert r["drag_ratio"] == (-0.017 if k % 2 == 0 else 0.017)  # ccw: the body turns back
        assert r["lag"] == 0.02 and r["axis"] == [0.0, 0.0, 1.0]
    assert len(adopted["hexa"][1].guesses) == 3  # frames left, root, length


@pytest.mark.parametrize("name, count", [("tilt_quad", 4), ("tilt_hexa", 6)])
def test_tilting_arms_are_gimbals(adopted: dict[str, Any], name: str, count: int) -> None:
    data = adopted[name][1].data
    assert len(data["apparatuses"]) == count
    assert all("tilt" in a["roll"] and "pitch" not in a for a in data["apparatuses"])
    assert {a["link"] for a in data["apparatuses"]} == {
        "chassis" if name == "tilt_quad" else "hull"
    }
    assert sum(r["drag_ratio"] for r in rotors(data)) == 0.0


def test_spins_come_from_names(adopted: dict[str, Any]) -> None:
    for r in rotors(adopted["tilt_quad"][1].data):
        assert (r["drag_ratio"] < 0) == ("ccw" in r["link"])


def test_rotors_that_point_all_ways_are_reversible_by_their_limits(adopted: dict[str, Any]) -> None:
    path, made = adopted["omni"]
    assert all((r["thrust_min"], r["thrust_max"]) == (-9.0, 9.0) for r in rotors(made.data))
    robot = snakegen.load(path, modules=made.data)
    a = allocation(robot, robot.configuration())
    assert np.linalg.matrix_rank(a.dual) == 6
    shafts = [r["axis"] for r in rotors(made.data)]
    assert np.allclose(a.rotor_axes, shafts, atol=1e-8)


def test_a_snake_with_gimbals_newtons_and_a_global_drag_ratio(adopted: dict[str, Any]) -> None:
    data = adopted["serpent"][1].data
    assert data["floating_root"] == "root"
    for j, a in enumerate(data["apparatuses"], start=1):
        assert (a["roll"], a["pitch"]) == (f"gimbal{j}_roll", f"gimbal{j}_pitch")
        assert [r["drag_ratio"] for r in a["rotors"]] == [-0.012, 0.012]
        assert [r["thrust_max"] for r in a["rotors"]] == [18.0, 18.0]
        assert [r["axis"] for r in a["rotors"]] == [[0.0, 0.0, 1.0]] * 2  # upwards, both


def test_a_snake_without_gimbals_has_none(tmp_path: Path) -> None:
    text = ROBOTS["serpent"]()
    for j in range(1, 5):
        for axis in ("roll", "pitch"):
            text = text.replace(
                f'"gimbal{j}_{axis}" type="continuous"', f'"weld{j}_{axis}" type="fixed"'
            )
    (tmp_path / "stiff.urdf").write_text(text)
    data = snakegen.adopt(tmp_path / "stiff.urdf")
    assert len(data["apparatuses"]) == 8
    assert not any({"roll", "pitch"} & a.keys() for a in data["apparatuses"])


@pytest.mark.parametrize("name", ROBOTS)
def test_the_yaml_is_the_data_with_comments(
    adopted: dict[str, Any], name: str, tmp_path: Path
) -> None:
    path, made = adopted[name]
    (tmp_path / "m.yaml").write_text(made.text)
    assert yaml_file.read(tmp_path / "m.yaml") == made.data
    values = [line for line in made.text.splitlines() if ": " in line and line[0] != "#"]
    assert values and all("  # " in line for line in values)
    robot = snakegen.load(path, modules=tmp_path / "m.yaml")
    again = snakegen.load(path, modules=made.data)
    assert robot.floating and robot.modules == again.modules
    assert not robot.chain_joints or name == "serpent"


@pytest.mark.parametrize("name", ROBOTS)
def test_an_adopted_robot_is_analysed_and_flies(
    adopted: dict[str, Any], name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, made = adopted[name]
    modules = tmp_path / "modules.yaml"
    modules.write_text(made.text)
    arguments = ["analyze", "hover", str(path), "--modules", str(modules), "--json"]
    assert _run(arguments) == 0
    hover = json.loads(capsys.readouterr().out)
    assert hover
    log = ["-o", str(tmp_path / "f.rrd"), "--duration", "3", "--json"]
    flight = ["analyze", "flight", str(path), "--modules", str(modules), "--mission", "hover", *log]
    code = _run(flight)
    found = json.loads(capsys.readouterr().out)
    assert code == 0 and found["passed"], found


def _run(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return int(end.value.code or 0)


def test_names_that_are_yaml_words_stay_names(tmp_path: Path) -> None:
    text = hexarotor().replace('"rotor_0"', '"no: rotor # 0"').replace('"base_link"', '"yes"')
    (tmp_path / "odd.urdf").write_text(
        text.replace("<linkName>rotor_0<", "<linkName>no: rotor # 0<")
    )
    made = draft(tmp_path / "odd.urdf")
    (tmp_path / "m.yaml").write_text(made.text)
    data = yaml_file.read(tmp_path / "m.yaml")
    assert data == made.data and data["floating_root"] == "yes"
    assert snakegen.load(tmp_path / "odd.urdf", modules=tmp_path / "m.yaml").floating


def test_a_robot_without_rotors_is_refused(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"/><link name="wheel"/><joint name="j" '
        'type="continuous"><parent link="base"/><child link="wheel"/></joint></robot>'
    )
    with pytest.raises(
        DescriptionError, match=r"no rotor found by name, shaft or mesh.*modules\.md"
    ):
        snakegen.adopt(tmp_path / "arm.urdf")


@pytest.mark.parametrize("text, words", [
    ("<mujoco/>", "is an MJCF"), ("<!-- <robot> --><mujoco/>", "is an MJCF"),
    ("hello", "does not begin with '<'"), ("", "is empty"), ("<sdf/>", "root element is <sdf>"),
    ("<robot name='r'><link name='a'/><link name='b'/></robot>", "second root"),
])  # fmt: skip
def test_what_is_no_urdf_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "strange.urdf"
    path.write_text(text)
    for call in (snakegen.adopt, snakegen.load, snakegen.convert):
        with pytest.raises(DescriptionError, match=words):
            call(path)


TRI = """<robot name="tri"><link name="body"><inertial><mass value="1.2"/><inertia ixx="0.01"
ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.02"/></inertial></link><link name="left"/>
<joint name="left_mount" type="fixed"><parent link="body"/><child link="left"/>
<origin xyz="0.15 0.2 0"/></joint><link name="right"/><joint name="right_mount" type="fixed">
<parent link="body"/><child link="right"/><origin xyz="0.15 -0.2 0"/></joint>
<link name="camera_eye"/><joint name="eye" type="fixed"><parent link="body"/>
<child link="camera_eye"/><origin xyz="0.2 0 0"/></joint><link name="horn"><inertial>
<mass value="0.05"/><inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/></inertial>
</link><joint name="tail_servo" type="revolute"><parent link="body"/><child link="horn"/>
<origin xyz="-0.3 0 0"/><axis xyz="1 0 0"/><limit lower="-0.7" upper="0.7" effort="1"
velocity="5"/></joint><link name="rear"/><joint name="rear_mount" type="fixed">
<parent link="horn"/><child link="rear"/><origin xyz="0 0 0.02"/></joint></robot>"""


def test_frames_that_the_others_need_to_hover_are_rotors(tmp_path: Path) -> None:
    """A tricopter whose tail servo gives one rotor away; a camera's frame is none."""
    path = tmp_path / "tri.urdf"
    path.write_text(TRI)
    made = draft(path)
    assert [r["link"] for r in rotors(made.data)] == ["left", "right", "rear"]
    assert [a.get("roll") for a in made.data["apparatuses"]] == [None, None, "tail_servo"]
    assert sum("frame without mass" in guess for guess in made.guesses) == 2
    assert "camera_eye" in made.guesses[0]
    robot = snakegen.load(path, modules=made.data)
    assert snakegen.margins(robot.configuration()).rank == 4
    path.write_text(TRI.replace('"-0.3 0 0"', '"0.02 0 0"'))  # the tail alone holds the body
    assert [r["link"] for r in rotors(draft(path).data)] == ["rear"]


def test_frames_that_were_not_taken_are_listed(tmp_path: Path) -> None:
    text = hexarotor().replace("rotor_5", "front")
    (tmp_path / "hexa.urdf").write_text(text)
    made = draft(tmp_path / "hexa.urdf")
    assert "imu_link" in made.text.splitlines()[3]


def test_command_writes_the_file_and_prints_json(
    adopted: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, made = adopted["serpent"]
    out = tmp_path / "modules.yaml"
    assert _run(["adopt", str(path), "-o", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["modules"] == made.data and out.read_text() == made.text
    assert _run(["adopt", str(path)]) == 0
    assert capsys.readouterr().out == made.text


def test_a_floating_root_joint_is_kept_free(adopted: dict[str, Any], tmp_path: Path) -> None:
    path, made = adopted["tilt_hexa"]
    assert made.data["floating_root"] == "world"
    robot = snakegen.load(path)
    assert robot.floating and robot.root_link == "hull" and robot.model.nv == 12
    result = snakegen.convert(path, tmp_path / "out", modules=made.data)
    assert 'type="floating"' in result.urdf.read_text()
    modules = tmp_path / "modules.yaml"
    modules.write_text(made.text)
    found = snakegen.compare(result.urdf, result.mjcf, modules=modules)
    assert found.same, found.differences


@pytest.mark.parametrize(
    "effort, span, spins", [(0.0, 1.0, True), (1.0, 60.0, True), (1.0, 3.0, False)]
)
def test_which_revolute_joints_are_shafts(
    tmp_path: Path, effort: float, span: float, spins: bool
) -> None:
    text = hexarotor()
    text = text.replace("-1e+16", str(-span / 2)).replace("1e+16", str(span / 2))
    text = text.replace('effort="0.0"', f'effort="{effort}"')
    (tmp_path / "hexa.urdf").write_text(text)
    link = {"floating_root": "base_link", "apparatuses": [
        {"rotors": [{"link": f"rotor_{k}", "thrust_max": 8.0}]} for k in range(6)]}  # fmt: skip
    robot = snakegen.load(tmp_path / "hexa.urdf", modules=link)
    assert len(robot.spinners) == (6 if spins else 0)
    assert len(robot.modules.servos) == (0 if spins else 6)
