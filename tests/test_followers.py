"""Joints that follow another, ranges without 0, tool frames: postures and torques of arms."""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import snakegen
from snakegen.analysis import statics
from snakegen.cli import main
from snakegen.errors import AnalysisError, PostureError
from snakegen.statics.tip import find_tip, tip_pose

LINK = (
    '<link name="{}"><inertial><origin xyz="0.25 0 0"/><mass value="1"/><inertia ixx="0.001" '
    'ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>'
)
JOINT = (
    '<joint name="{}" type="revolute"><origin xyz="{} 0 0"/><parent link="{}"/><child link="{}"/>'
    '<axis xyz="0 1 0"/><limit lower="{}" upper="{}" effort="20" velocity="2"/>{}</joint>'
)


def arm(tmp_path: Path, second: str, mimic: str = "", extra: str = "") -> Path:
    """Writes an arm of two links of 0.5 m on a fixed base."""
    low, high = second.split()
    text = '<robot name="arm"><link name="base"/>' + LINK.format("upper") + LINK.format("fore")
    text += JOINT.format("lead", 0, "base", "upper", -1.5, 1.5, "")
    text += JOINT.format("second", 0.5, "upper", "fore", low, high, mimic)
    path = tmp_path / "arm.urdf"
    path.write_text(f"{text}{extra}</robot>")
    return path


@pytest.fixture
def coupled(tmp_path: Path) -> snakegen.Robot:
    mimic = '<mimic joint="lead" multiplier="-1" offset="0.2"/>'
    return snakegen.load(arm(tmp_path, "-1.5 1.5", mimic))


def test_a_follower_follows(coupled: snakegen.Robot) -> None:
    q = coupled.configuration({"lead": 0.5})
    assert np.asarray(q).tolist() == pytest.approx([0.5, -0.3])
    # upper: 0.25 (cos .5, -sin .5); fore: 0.5 (…) + 0.25 (cos .2, -sin .2)
    x = (0.75 * np.cos(0.5) + 0.25 * np.cos(0.2)) / 2
    z = -(0.75 * np.sin(0.5) + 0.25 * np.sin(0.2)) / 2
    assert np.allclose(q.cog, [x, 0, z], atol=1e-12)
    assert np.asarray(coupled.configuration()).tolist() == [0.0, 0.2]


def test_a_follower_given_elsewhere_or_out_of_its_range_is_refused(coupled: snakegen.Robot) -> None:
    coupled.configuration({"lead": 0.5, "second": -0.3})
    with pytest.raises(PostureError, match=r"second follows lead \(mimic\) and is -0\.3 here"):
        coupled.configuration({"lead": 0.5, "second": 0.1})
    with pytest.raises(PostureError, match=r"lead = -1\.4 takes second.*to 1\.6, outside"):
        coupled.configuration({"lead": -1.4})


def test_load_goes_through_the_ratio_to_the_leader(coupled: snakegen.Robot) -> None:
    """The virtual work of gravity: τ_lead = dV/dlead, the follower moving with it."""
    q = coupled.configuration({"lead": 0.5})
    found = statics.analyze(coupled, q)

    def potential(lead: float) -> float:
        at = coupled.configuration({"lead": lead})
        return float(coupled.mass * 9.81 * at.cog[2])

    slope = (potential(0.5 + 1e-5) - potential(0.5 - 1e-5)) / 2e-5
    assert found.torque[0] == pytest.approx(slope, rel=1e-6) and abs(slope) > 1.0
    assert found.torque[1] == 0.0 and found.use[1] == 0.0
    assert found.torque[0] == pytest.approx(sum(found.by_term[k][0] for k in found.by_term))
    assert any("second (lead)" in text for _, text in found.rows())
    assert not any(label.strip() == "second" for label, _ in found.rows())


def test_pinocchios_own_mimic_model_has_the_same_torque(coupled: snakegen.Robot) -> None:
    model = pin.buildModelFromXML(coupled.urdf, mimic=True)
    data = model.createData()
    expected = pin.rnea(model, data, np.array([0.5]), np.zeros(1), np.zeros(1))
    found = statics.analyze(coupled, coupled.configuration({"lead": 0.5}))
    assert found.torque[0] == pytest.approx(expected[0], rel=1e-12)


def test_the_tip_moves_with_leader_and_follower(coupled: snakegen.Robot) -> None:
    tip = find_tip(coupled)
    pose = tip_pose(coupled, coupled.configuration({"lead": 0.5}), tip)
    places = [
        tip_pose(coupled, coupled.configuration({"lead": 0.5 + h}), tip).position
        for h in (1e-6, -1e-6)
    ]
    assert np.allclose(pose.jacobian[:3, 0], (places[0] - places[1]) / 2e-6, atol=1e-8)
    assert not pose.jacobian[:, 1].any()


def test_a_chain_of_followers_follows_the_first(tmp_path: Path) -> None:
    mimic = '<mimic joint="lead" multiplier="-1" offset="0.2"/>'
    third = LINK.format("hand") + JOINT.format(
        "third", 0.5, "fore", "hand", -3, 3, '<mimic joint="second" multiplier="2" offset="0.1"/>'
    )
    robot = snakegen.load(arm(tmp_path, "-1.5 1.5", mimic, third))
    assert robot.followers["third"] == ("lead", -2.0, 0.5)
    q = robot.configuration({"lead": 0.5})
    assert np.asarray(q).tolist() == pytest.approx([0.5, -0.3, -0.5])


def test_what_moves_joints_on_their_own_is_refused(coupled: snakegen.Robot) -> None:
    with pytest.raises(AnalysisError, match=r"joint 'second' follows 'lead' \(mimic\)"):
        statics.analyze(coupled, coupled.configuration(), worst=True)


def test_the_default_posture_keeps_to_the_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = arm(tmp_path, "-3.07 -0.07")
    robot = snakegen.load(path)
    assert np.asarray(robot.configuration()).tolist() == [0.0, -0.07]
    assert np.asarray(robot.configuration({"lead": 0.3})).tolist() == [0.3, -0.07]
    with pytest.raises(SystemExit) as end:
        main(["analyze", "statics", str(path)])
    assert end.value.code == 0
    assert "second -0.070 (0 is outside the limits of second)" in " ".join(
        capsys.readouterr().out.split()
    )


@pytest.mark.parametrize("before", ["\n  ", "\ufeff", "\ufeff\n"])
def test_a_blank_before_the_declaration_is_no_obstacle(tmp_path: Path, before: str) -> None:
    path = arm(tmp_path, "-1 1")
    plain = snakegen.load(path)
    path.write_text(f'{before}<?xml version="1.0" encoding="utf-8"?>\n{path.read_text()}')
    robot = snakegen.load(path)
    assert robot.mass == plain.mass and robot.joint_names == plain.joint_names
    made = snakegen.convert(path, tmp_path / "out")
    assert snakegen.compare(path, made.mjcf).same


def test_a_leader_rests_where_its_follower_may(tmp_path: Path) -> None:
    mimic = '<mimic joint="lead" multiplier="2"/>'
    robot = snakegen.load(arm(tmp_path, "0.4 1.5", mimic))
    assert np.asarray(robot.configuration()).tolist() == pytest.approx([0.2, 0.4])


@pytest.mark.parametrize("frames", [1, 2])
def test_the_default_tip_is_the_last_frame_of_the_chain(
    tmp_path: Path, frames: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """20 N·m at the root, less the links' 9.81 (0.25 + 0.75), over a lever of 1 m: 10.19 N."""
    tool = '<link name="{1}"/><joint name="{1}_fix" type="fixed"><parent link="{0}"/>'
    tool += '<child link="{1}"/><origin xyz="{2} 0 0"/></joint>'
    extra = tool.format("fore", "camera", 0.1) + tool.format("fore", "hand", 0.5)
    extra += tool.format("hand", "point", 0.0) if frames == 2 else ""
    path = arm(tmp_path, "-0.6 0.6", "", extra)
    with pytest.raises(SystemExit):
        main(["analyze", "statics", str(path), "--json"])
    data = json.loads(capsys.readouterr().out)
    assert data["tip"]["link"] == ("hand" if frames == 1 else "point")
    assert data["tip"]["position_m"] == pytest.approx([1.0, 0.0, 0.0])
    assert data["tip_load"]["payload_kg"] == pytest.approx((20 - 9.81) / 9.81, rel=1e-9)
