"""Joints whose description declares no effort, and bodies without a joint that shapes them."""

import json

import numpy as np
import pytest
from multirotors import multirotor

import snakegen
from snakegen.analysis import catalogue, motion, statics, wrench_margin
from snakegen.errors import AnalysisError
from snakegen.report.page import plain

INERTIA = '<inertia ixx="0.001" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>'


def arm(folder, efforts=(0, 0)):
    """Returns two links of 1 kg and 0.5 m, level, on a base."""
    links = f'<link name="base"><inertial><mass value="1"/>{INERTIA}</inertial></link>'
    joints = ""
    for k, effort in enumerate(efforts, 1):
        links += (
            f'<link name="part{k}"><inertial><origin xyz="0.25 0 0"/><mass value="1"/>{INERTIA}'
            "</inertial></link>"
        )
        joints += (
            f'<joint name="j{k}" type="revolute"><origin xyz="{0.5 * (k - 1)} 0 0"/>'
            f'<parent link="{"base" if k == 1 else "part1"}"/><child link="part{k}"/>'
            f'<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="{effort}" velocity="0"/>'
            "</joint>"
        )
    (folder / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
    return snakegen.load(folder / "arm.urdf")


def test_an_effort_of_0_is_none_declared_and_named_once(tmp_path):
    robot = arm(tmp_path)
    found = statics.analyze(robot, np.zeros(2))
    np.testing.assert_allclose(found.torque, [-9.81, -2.4525])  # 1 kg at 0.25 m and at 0.75 m
    rows = found.rows()
    assert [text for _, text in rows if "j1, j2" in text] == ["j1, j2: no share of a limit"]
    assert not found.overloaded and dict(rows)["j1"] == "-9.81 N·m"
    moved = motion.analyze(robot, np.zeros(2))
    assert dict(moved.rows())["no declared effort"] == "j1, j2"
    assert np.all(moved.peak > 0.0)
    with pytest.raises(AnalysisError, match="no joint declares an effort"):
        statics.analyze(robot, np.zeros(2), worst=True)


def test_joints_with_an_effort_keep_their_share(tmp_path):
    found = statics.analyze(arm(tmp_path, (0, 10)), np.zeros(2), worst=True)
    np.testing.assert_allclose(found.use, [0.0, 0.24525])
    assert found.worst["joint"] == "j2"
    assert found.worst["use"] == pytest.approx(0.24525, rel=1e-6)  # level is the hardest for j2


def test_every_analysis_of_such_an_arm_has_figures(tmp_path):
    robot = arm(tmp_path)
    for command, entry in catalogue().items():
        module = entry.load()
        if module.applies(robot) and command not in ("tunnel", "along"):
            result = module.analyze(robot, np.zeros(2))
            assert not any(w in t.split() for _, t in result.rows() for w in ("nan", "inf"))
            json.dumps(plain(result.to_json()), allow_nan=False)


def test_a_body_without_chain_joints_has_margins_and_no_worst_posture(tmp_path):
    robot = multirotor(tmp_path, tilts=("1 0 0",) * 4)
    q = robot.configuration()
    assert wrench_margin.analyze(robot, q).rows()
    with pytest.raises(AnalysisError, match="no joint that shapes it"):
        statics.analyze(robot, q, worst=True)
