"""The hardest posture and the statics of that posture are one law: limits and gimbals included."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from snakegen.analysis import statics
from snakegen.robot.posture import aim_gimbals, hover_gimbals
from snakegen.robot.robot import Robot, load
from snakegen.spec.loading import load_spec
from snakegen.statics.worst import worst_posture

QUICK = {"samples": 8, "starts": 1, "tolerance": 0.01}
GENERATED = Path(__file__).parent.parent / "generated"


def built(preset: str) -> Robot:
    """Returns a preset as it is committed: sooner read than expanded."""
    return load(GENERATED / preset / f"{preset}.urdf")


def pinocchio_use(robot: Robot, q: np.ndarray) -> dict[str, float]:
    """Returns |torque| / limit by joint in hover: gravity and least-norm forces by Pinocchio."""
    model, data = robot.model, robot.model.createData()
    pin.computeAllTerms(model, data, q, np.zeros(model.nv))
    pin.computeJointJacobians(model, data, q)
    tau = pin.computeGeneralizedGravity(model, data, q)
    jacobians = []
    for body, point in zip(robot.gimbals.thrust_body, robot.gimbals.thrust_point, strict=True):
        J = pin.getJointJacobian(model, data, int(body) + 1, pin.LOCAL_WORLD_ALIGNED)
        x = data.oMi[int(body) + 1].rotation @ point
        jacobians.append(J[:3] - pin.skew(x) @ J[3:])
    J = np.vstack(jacobians)  # of all thrust points
    cog = pin.centerOfMass(model, data, q)
    scale = np.repeat([1.0, 1.0 / robot.link_length], 3)
    moved = np.eye(6)
    moved[3:, :3] = -pin.skew(cog - q[:3])
    base = robot.base_pose(q)[0]
    rows = np.block([[base, np.zeros((3, 3))], [np.zeros((3, 3)), base]])
    wrench_of = scale[:, None] * (moved @ rows @ J[:, :6].T)
    force = np.linalg.pinv(wrench_of, rcond=1e-9) @ (scale * (moved @ rows @ tau[:6]))
    left = (tau - J.T @ force)[6:]
    limit = robot.limits(robot.joint_names)[2]
    return dict(zip(robot.joint_names, np.abs(left) / limit, strict=True))


@pytest.mark.parametrize("preset", ["dragon3", "dragon4"])
def test_statics_reproduces_the_worst_posture(preset: str) -> None:
    robot = built(preset)
    found = worst_posture(robot, hover_gimbals(robot, robot.configuration()), **QUICK)
    chain = {n: found["posture"][n] for n in robot.chain_joints}
    pointed = hover_gimbals(robot, robot.configuration(chain))  # as the command line does
    for q in (pointed, robot.configuration(found["posture"])):
        there = statics.analyze(robot, q)
        assert there.support == found["support"]
        assert there.use.max() == pytest.approx(found["use"], rel=1e-9)
    if found["support"] == "hover":
        use = pinocchio_use(robot, q)
        assert max(use[n] for n in robot.chain_joints) == pytest.approx(found["use"], rel=1e-6)
        assert max(robot.chain_joints, key=use.__getitem__) == found["joint"]


@pytest.mark.parametrize("hold", ["auto", "base", "hover"])
@pytest.mark.parametrize("preset", ["arm6", "dragon3"])
def test_every_support_has_a_worst_posture(preset: str, hold: str) -> None:
    robot = built(preset)
    q = hover_gimbals(robot, robot.configuration())
    if hold == "hover" and not robot.gimbal_names:
        with pytest.raises(statics.AnalysisError, match="cannot hover"):
            worst_posture(robot, q, hold=hold, **QUICK)
        return
    found = worst_posture(robot, q, hold=hold, **QUICK)
    assert np.isfinite(found["use"]) and found["use"] >= 0.0
    held = found["support"] == "base"
    assert held == (hold == "base" or not robot.gimbal_names)
    assert (found["use_bound"] is not None) == held
    if held:
        assert found["use"] <= found["use_bound"]


def test_given_thrusts_load_the_worst_posture_too() -> None:
    robot = built("dragon4")
    q = hover_gimbals(robot, robot.configuration())
    thrust = np.linspace(2.0, 9.0, 8)
    found = worst_posture(robot, q, thrust=thrust, **QUICK)
    there = statics.analyze(robot, robot.configuration(found["posture"]), thrust=thrust)
    assert there.use.max() == pytest.approx(found["use"], rel=1e-9)


@pytest.mark.parametrize(
    ("override", "tilt", "support"),
    [
        ("", 0.3, "hover"),
        ("vectoring_apparatus.pitch_limit=0.31", 0.3, "hover"),
        ("vectoring_apparatus.pitch_limit=0.29", 0.3, "base"),
        ("vectoring_apparatus.thrust_min=10", 0.0, "base"),
    ],
)
def test_hover_needs_forces_that_gimbals_and_limits_allow(
    override: str, tilt: float, support: str
) -> None:
    """A level hover of a body pitched by 0.3 rad turns each pitch gimbal by 0.3 rad."""
    robot = load(load_spec("dragon4", overrides=(override,))) if override else built("dragon4")
    q = hover_gimbals(robot, robot.configuration({"base_rpy": (0.0, tilt, 0.0)}))
    assert statics.analyze(robot, q).support == support


ONE_AXIS = """<robot name="tilter">
<link name="body"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0"
 ixz="0" iyz="0"/></inertial></link>
<link name="rotor"><inertial><mass value="0.1"/><inertia ixx="0.001" iyy="0.001" izz="0.001"
 ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="tilt" type="revolute"><parent link="body"/><child link="rotor"/><axis xyz="0 1 0"/>
<limit lower="-0.3" upper="0.5" effort="1" velocity="9"/></joint></robot>"""
MODULES = """floating_root: body
apparatuses: [{AXIS: tilt, rotors: [{link: rotor, thrust_max: 20, drag_ratio: 0.01}]}]
"""


@pytest.mark.parametrize("axis", ["roll", "pitch"])
def test_a_gimbal_about_one_axis_is_turned_up(axis: str, tmp_path: Path) -> None:
    """It levels what it can: across its axis nothing, beyond its limit all but the limit."""
    (tmp_path / "tilter.urdf").write_text(ONE_AXIS)
    (tmp_path / "modules.yaml").write_text(MODULES.replace("AXIS", axis))
    robot = load(tmp_path / "tilter.urdf", modules=tmp_path / "modules.yaml")
    for pitch, turned, left in ((-0.4, 0.4, 0.0), (0.0, 0.0, 0.0), (0.45, -0.3, 0.15)):
        q = robot.configuration({"base_rpy": (0.0, pitch, 0.0)})
        there, remaining = aim_gimbals(robot, q, np.array([[0.0, 0.0, 1.0]]))
        assert robot.angles(there) == pytest.approx([turned], abs=1e-12)
        assert remaining == pytest.approx([left], abs=1e-9)
        np.testing.assert_array_equal(hover_gimbals(robot, q), there)
    q = robot.configuration({"base_rpy": (0.2, 0.0, 0.0), "tilt": 0.3})
    there, remaining = aim_gimbals(robot, q, np.array([[0.0, 0.0, 1.0]]))
    assert robot.angles(there) == pytest.approx([0.0], abs=1e-12)
    assert remaining == pytest.approx([0.2], abs=1e-9)
