"""Cables as MuJoCo tendons: lengths, moment arms, tensions and the held posture, against ours."""

import json

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.analysis import cables
from snakegen.errors import AnalysisError, SnakegenError
from snakegen.statics.cabled import cables_of
from snakegen.statics.joint_torques import joint_torques

BENT = {"joint1_pitch": 0.3, "joint3_yaw": -0.4, "joint5_pitch": 0.2, "joint6_yaw": 0.35}


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


@pytest.fixture(scope="module")
def held(arm, tmp_path_factory):
    path = tmp_path_factory.mktemp("cabled") / "arm6_cabled.xml"
    q = arm.configuration(BENT)
    return q, cables.analyze(arm, q, mjcf=path), mujoco.MjModel.from_xml_path(str(path))


def posed(model, key="held"):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    return data


def test_tendons_have_our_lengths_and_moment_arms(held, arm):
    _, result, model = held
    data = posed(model)
    ours = [model.tendon(n).id for n in result.names]
    np.testing.assert_allclose(data.ten_length[ours], result.length, rtol=1e-12)
    columns = [model.joint(n).dofadr[0] for n in result.joints]
    J = np.zeros((model.ntendon, model.nv))
    mujoco.mju_sparse2dense(
        J, data.ten_J.ravel(), model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind.ravel()
    )
    np.testing.assert_allclose(-J[np.ix_(ours, columns)].T, result.arms, atol=1e-12)


def test_mujoco_bears_the_posture_with_our_tensions(held, arm):
    q, result, model = held
    data = posed(model)
    winches = [model.actuator(n).id for n in result.names]
    np.testing.assert_allclose(-data.actuator_force[winches], result.tension, rtol=1e-7)
    assert np.min(result.tension) >= 5.0 - 1e-9
    assert np.max(np.abs(data.qacc)) < 1e-6
    # The torques are gravity's by the law, and they are not small ones.
    law = joint_torques(arm, q, terms="static")
    got = [data.qfrc_actuator[model.joint(n).dofadr[0]] for n in arm.joint_names]
    np.testing.assert_allclose(got, law, atol=1e-8)
    assert np.max(np.abs(law)) > 10.0


def test_the_posture_stays_for_a_second_and_a_wrong_tension_moves_it(held):
    _, result, model = held
    assert result.held.drift < 1e-9
    data = posed(model)
    data.ctrl[model.actuator("cable3_1").id] -= 5e-4  # wound half a millimetre too far
    start = data.qpos.copy()
    mujoco.mj_step(model, data, 1000)
    assert np.max(np.abs(data.qpos - start)) > 1e-3
    data = posed(model)
    data.ctrl[:] = data.ctrl[::-1]  # the winches confused: our proof has to see it
    mujoco.mj_forward(model, data)
    assert np.max(np.abs(data.qacc)) > 1.0


def test_cables_only_pull(held):
    model = held[2]
    data = posed(model)
    data.ctrl[:] += 0.05  # all wound out: slack
    mujoco.mj_forward(model, data)
    assert np.all(data.actuator_force == 0.0)
    assert np.max(np.abs(data.qacc)) > 1.0  # nothing holds it


def test_holes_stand_in_the_links_that_hold_them(arm):
    routing = cables.route(arm, count=4, coupled=False)
    flat = np.ones(len(routing.names))
    found = cables_of(arm, routing, flat, flat, np.inf, flat)
    assert [c.name for c in found[:4]] == ["cable1_1", "cable1_2", "cable1_3", "cable1_4"]
    assert found[0].links == ("link1", "link2")  # sheathed: a hole on each side of its own joint
    assert found[-1].links == ("link6", "link7")
    np.testing.assert_allclose(np.linalg.norm(found[0].points[:, 1:], axis=1), 0.03)


def test_tension_limits_reach_the_winch(arm, tmp_path):
    path = tmp_path / "a.xml"
    result = cables.analyze(arm, arm.configuration(BENT), maximum=2000.0, count=4, mjcf=path)
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.ntendon == len(result.names) == 24
    assert np.all(model.actuator_forcerange == [-2000.0, 0.0])
    json.dumps(result.to_json())
    assert result.to_json()["in_mujoco"]["balanced"]


def test_what_cannot_be_held_is_not_written(arm, tmp_path):
    path = tmp_path / "a.xml"
    q = arm.configuration(BENT)
    with pytest.raises(AnalysisError, match=r"not held within 100 N: joint\d_\w+ needs"):
        cables.analyze(arm, q, maximum=100.0, mjcf=path)
    with pytest.raises(AnalysisError, match="without tip force, wrenches"):
        cables.analyze(arm, q, wrenches={"link7": [0, 0, -1, 0, 0, 0]}, mjcf=path)
    with pytest.raises(AnalysisError, match="stiffness"):
        cables.analyze(arm, q, stiffness=0.0, mjcf=path)
    assert not path.exists()
    (tmp_path / "folder.xml").mkdir()
    with pytest.raises(SnakegenError, match="cannot be written"):
        cables.analyze(arm, q, mjcf=tmp_path / "folder.xml")
