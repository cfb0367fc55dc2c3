"""Equivalence check: every planted difference of actuators, joints, sites and contacts is named."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from planted_faults import FAULTS, Fault, plant

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.description.mjcf import decorate
from snakegen.errors import SnakegenError
from snakegen.pipeline.build import GateError
from snakegen.pipeline.equivalence import BOUND, _Own, _Pinocchio, compare
from snakegen.pipeline.equivalence_actuators import Actuation
from snakegen.pipeline.equivalence_responses import joint_forces, unit_wrenches
from snakegen.robot.robot import Robot, from_urdf_text
from snakegen.spec.loading import load_spec

DATA = Path(__file__).parent / "data"


def made(name: str) -> tuple[Robot, mujoco.MjSpec]:
    """Returns a robot and its MJCF, without visuals."""
    if name == "foreign":
        robot = snakegen.load(DATA / "foreign.urdf", modules=DATA / "foreign.modules.yaml")
    elif name == "balls":
        robot = snakegen.load(load_spec("screw4", overrides=["screw_drive.rollers=ball"]))
    else:
        robot = snakegen.load(name)
    return robot, decorate.decorate(robot.urdf, robot.modules, {}, visuals=False)


@pytest.fixture(scope="module")
def robots() -> dict[str, tuple[Robot, mujoco.MjSpec]]:
    """The robots of the planted faults."""
    return {n: made(n) for n in ("dragon4", "screw4", "hybrid4", "arm6", "foreign", "balls")}


@pytest.mark.parametrize("name", ["dragon4", "screw4", "hybrid4", "arm6", "foreign", "balls"])
def test_unchanged_models_agree(name: str, robots: Any) -> None:
    """Actuators, joints, sites and contacts agree to rounding on every kind of robot."""
    robot, spec = robots[name]
    found = compare(robot, spec.compile())
    assert found.passed and found.differences == () and str(found) == ""
    assert 0 < found.actuators < 1e-12


def test_rounding_of_zeros_is_no_difference(tmp_path: Path) -> None:
    """Thrusts that pass through the only joints' axes, and a CoM at the origin of a fixed base."""
    inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    parts = ['<link name="base"/>']
    for side, name in ((0.3, "left"), (-0.3, "right")):
        parts.append(
            f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial></link>'
            f'<joint name="{name}_tilt" type="revolute"><parent link="base"/>'
            f'<child link="{name}"/><origin xyz="0 {side} 0" rpy="0.1 0.2 0.3"/>'
            f'<axis xyz="0 1 0"/>{limit}</joint>'
        )
    (tmp_path / "r.urdf").write_text(f'<robot name="zeros">{"".join(parts)}</robot>')
    rotors = "".join(
        f"  - {{roll: {n}_tilt, rotors: [{{link: {n}, thrust_max: 5}}]}}\n"
        for n in ("left", "right")
    )
    (tmp_path / "m.yaml").write_text("apparatuses:\n" + rotors)
    robot = snakegen.load(tmp_path / "r.urdf", modules=tmp_path / "m.yaml")
    model = decorate.decorate(robot.urdf, robot.modules, {}, visuals=False).compile()
    found = compare(robot, model)
    assert found.passed, str(found)
    model.actuator("left").gear[4] = 1e-6
    assert not compare(robot, model).passed


@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f"{f.robot}-{f.name}-{f.field}-{f.column}")
def test_planted_faults_are_named(fault: Fault, robots: Any) -> None:
    """Each change alone fails the check, which names the thing, the quantity and both values."""
    robot, spec = robots[fault.robot]
    model = spec.compile()
    plant(model, fault)
    found = compare(robot, model, states=1)
    assert not found.passed and found.actuators > BOUND
    named = {(d.name, d.quantity): d for d in found.differences}
    assert (fault.name, fault.quantity) in named, str(found)
    d = named[fault.name, fault.quantity]
    assert d.declared != d.mjcf
    assert fault.name in str(found)


def test_a_rotor_on_another_body_is_named(robots: Any) -> None:
    """A site moved to another link: position and wrench differ."""
    robot, _ = robots["dragon4"]
    spec = made("dragon4")[1]
    site = spec.site("rotor4_1")
    position, turn = np.array(site.pos), np.array(site.quat)
    spec.delete(site)
    spec.body("rotor3_1").add_site(name="rotor4_1", pos=position, quat=turn)
    for actuator in spec.actuators:
        if actuator.name == "rotor4_1":
            actuator.target = "rotor4_1"
    found = compare(robot, spec.compile(), states=2)
    named = {(d.name, d.quantity) for d in found.differences}
    assert {("rotor4_1", "site position"), ("rotor4_1", "thrust on joints")} <= named


@pytest.mark.parametrize("kind", ["actuators", "sites"])
def test_missing_and_surplus_things_are_named(kind: str, robots: Any) -> None:
    """An actuator or site that only one description has fails the check by name."""
    robot, _ = robots["dragon4"]
    spec = made("dragon4")[1]
    for thing in list(spec.sensors) + list(spec.keys):
        spec.delete(thing)
    gone = next(t for t in getattr(spec, kind) if t.name in ("gimbal1_roll", "imu"))
    spec.delete(gone)
    found = compare(robot, spec.compile())
    assert not found.passed
    assert [(d.declared, d.mjcf) for d in found.differences] == [(1.0, 0.0)]
    spec = made("dragon4")[1]
    joint = mujoco.mjtTrn.mjTRN_JOINT
    spec.add_actuator(name="spare", trntype=joint, target="joint1_yaw")
    for key in list(spec.keys):
        spec.delete(key)
    found = compare(robot, spec.compile())
    assert [(d.name, d.mjcf) for d in found.differences] == [("actuator spare", 1.0)]


@pytest.mark.parametrize("field", ["disableflags", "density", "gravcomp"])
def test_options_that_change_forces_fail(field: str, robots: Any) -> None:
    """Disabled actuation or command clamping, a fluid and compensated weight are all seen."""
    robot, spec = robots["dragon4"]
    model = spec.compile()
    if field == "disableflags":
        for bit in (mujoco.mjtDisableBit.mjDSBL_ACTUATION, mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL):
            model.opt.disableflags = int(bit)
            assert not compare(robot, model, states=1).passed
        return
    if field == "density":
        model.opt.density = 1.2
    else:
        spec = made("dragon4")[1]
        spec.body("link2").gravcomp = 0.01
        model = spec.compile()
    assert compare(robot, model, states=1).actuators > BOUND


@pytest.mark.parametrize("name", ["dragon4", "foreign", "hybrid4"])
def test_declared_wrenches_are_those_of_q(name: str, robots: Any) -> None:
    """The check's own columns equal Q of `allocation`, and its joint forces Pinocchio's Jᵀ w."""
    robot, spec = robots[name]
    at = Actuation(robot, spec.compile())
    rng = np.random.default_rng(3)
    low, high, _ = robot.limits(robot.joint_names)
    angles = rng.uniform(np.maximum(low, -2), np.minimum(high, 2))
    posture = dict(zip(robot.joint_names, angles, strict=True))
    q = robot.configuration(posture, base_rpy=[0.3, -0.5, 1.0], base_position=[1, 2, 3])
    for oracle in (_Pinocchio(robot), _Own(robot)):
        bodies = oracle.bodies(oracle.evaluate(q, np.zeros(robot.model.nv))[1])
        assert np.allclose(unit_wrenches(at, bodies).T, allocation(robot, q).dual, atol=1e-12)
        forces = joint_forces(at, bodies)
        pin.computeJointJacobians(robot.model, data := robot.model.createData(), q)
        pin.updateFramePlacements(robot.model, data)
        for k, rotor in enumerate(at.rotors):
            if rotor.link.startswith("prop_a"):  # the check lets thrust act on the shaft's carrier
                continue
            frame = robot.model.getFrameId(rotor.link)
            jacobian = pin.getFrameJacobian(robot.model, data, frame, pin.ReferenceFrame.LOCAL)
            wrench = np.concatenate([rotor.axis, rotor.drag_ratio * np.array(rotor.axis)])
            assert np.allclose(forces[k], at.of_joints(jacobian.T @ wrench), atol=1e-12)


@pytest.mark.parametrize("change", ["rotor1_1", "joint1_yaw"])
def test_the_build_fails(change: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A flipped gear, or a servo of twice the stiffness: exit 3, no folder, both values named."""
    right = decorate.decorate

    def wrong(*args: Any, **kwargs: Any) -> mujoco.MjSpec:
        spec = right(*args, **kwargs)
        for actuator in spec.actuators:
            if actuator.name == change:
                actuator.gear = [-x for x in actuator.gear]
        return spec

    monkeypatch.setattr(decorate, "decorate", wrong)
    with pytest.raises(GateError, match=rf"{change}: .* in the URDF, .* in the MJCF") as caught:
        snakegen.build("dragon4", tmp_path / "r", picture=False)
    assert caught.value.exit_code == 3 and isinstance(caught.value, SnakegenError)
    assert not (tmp_path / "r").exists()


def test_kept_balls_are_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The MJCF that is kept for rollers 'ball' is compared too, not only the one with wheels."""
    right = decorate.decorate

    def wrong(*args: Any, **kwargs: Any) -> mujoco.MjSpec:
        spec = right(*args, **kwargs)
        if "rollers" not in kwargs:
            spec.geom("screw1_contact").friction = [0.1, 0, 0]
        return spec

    monkeypatch.setattr(decorate, "decorate", wrong)
    spec = load_spec("screw4", links=2, overrides=["screw_drive.rollers=ball"])
    with pytest.raises(GateError, match="screw1_contact: contact friction"):
        snakegen.build(spec, tmp_path / "r", picture=False)


def test_friction_of_the_urdf_reaches_the_servo() -> None:
    """<dynamics friction> of a joint whose servo names none is the servo's; damping stays."""
    text = (DATA / "foreign.urdf").read_text(encoding="utf-8")
    dynamics = '<dynamics damping="0.3" friction="0.2"/></joint>'
    head, name, rest = text.partition('<joint name="nod_b"')
    text = head + name + rest.replace("</joint>", dynamics, 1)
    robot = from_urdf_text(text, None, modules=DATA / "foreign.modules.yaml")
    assert {s.joint: s.friction for s in robot.modules.servos}["nod_b"] == 0.2
    spec = decorate.decorate(robot.urdf, robot.modules, {}, visuals=False)
    found = compare(robot, spec.compile())
    assert found.passed, str(found)
    dof = spec.compile().joint("nod_b").dofadr[0]
    assert spec.compile().dof_frictionloss[dof] == 0.2
    assert spec.compile().dof_damping[dof] == 0.3
    ignored = replace(
        robot.modules, servos=tuple(replace(s, friction=0.0) for s in robot.modules.servos)
    )
    model = decorate.decorate(robot.urdf, ignored, {}, visuals=False).compile()
    assert not compare(robot, model).passed
