"""Faults planted in a compiled MJCF model, one number each."""

from dataclasses import dataclass

import mujoco
import numpy as np


@dataclass(frozen=True)
class Fault:
    """A change of one entry of a compiled MJCF; the name and quantity that must be reported."""

    robot: str
    kind: str  # of the thing: actuator, joint, site, geom, body
    name: str
    field: str  # of MjModel
    quantity: str
    column: int | None = None
    factor: float = 1.0
    shift: float = 0.0


BALL = {"rollers": "ball"}
ROTOR = ("dragon4", "actuator", "rotor1_1")
SERVO = ("dragon4", "actuator", "joint2_yaw")
GIMBAL = ("dragon4", "actuator", "gimbal3_roll")
JOINT = ("dragon4", "joint", "joint2_yaw")
DRUM = ("screw4", "actuator", "screw2")
WHEEL = ("screw4", "geom", "wheel2_3_1_contact")
CASTER = ("screw4", "geom", "caster1_contact2")
FAULTS = [
    Fault(*ROTOR, "actuator_gear", "thrust wrench", 2, -1.0),
    Fault(*ROTOR, "actuator_gear", "thrust wrench", 5, -1.0),
    Fault(*ROTOR, "actuator_gear", "thrust wrench", 5, 1 + 1e-6),
    Fault(*ROTOR, "actuator_gear", "thrust wrench", 0, shift=1e-6),
    Fault("hybrid4", "actuator", "rotor3_2", "actuator_gear", "thrust wrench", 5, 1.1),
    Fault("foreign", "actuator", "tip_b_left", "actuator_gear", "thrust wrench", 5, -1.0),
    Fault(*ROTOR, "actuator_gainprm", "thrust at its limits", 0, 1.01),
    Fault(*SERVO, "actuator_biastype", "servo torque", factor=0),
    Fault(*ROTOR, "actuator_ctrlrange", "thrust range", 1, 1.01),
    Fault(*ROTOR, "actuator_ctrlrange", "thrust range", 0, shift=0.5),
    Fault(*ROTOR, "actuator_ctrllimited", "thrust range", factor=0),
    Fault("foreign", "actuator", "prop_a_left", "actuator_ctrlrange", "thrust range", 1, 0.9),
    Fault(*ROTOR, "actuator_forcelimited", "force range", shift=1),
    Fault(*ROTOR, "actuator_dynprm", "motor lag", 0, 1.001),
    Fault(*ROTOR, "actuator_dyntype", "motor lag", shift=-1),
    Fault(*SERVO, "actuator_gainprm", "servo gains", 0, 1.001),
    Fault(*SERVO, "actuator_biasprm", "servo gains", 1, 1.001),
    Fault(*GIMBAL, "actuator_biasprm", "servo gains", 2, 0.999),
    Fault("arm6", "actuator", "joint3_yaw", "actuator_gainprm", "servo gains", 0, 0.5),
    Fault("foreign", "actuator", "nod_b", "actuator_biasprm", "servo gains", 2, 2.0),
    Fault(*SERVO, "actuator_forcerange", "servo torque range", 1, 2.0),
    Fault(*GIMBAL, "actuator_forcelimited", "servo torque range", factor=0),
    Fault(*SERVO, "actuator_ctrlrange", "servo command range", 0, 0.5),
    Fault(*SERVO, "actuator_gear", "servo transmission", 0, -1.0),
    Fault(*SERVO, "actuator_trnid", "servo transmission", 0, shift=1),
    Fault(*JOINT, "jnt_range", "joint limits", 1, 1.001),
    Fault(*JOINT, "jnt_limited", "joint limits", factor=0),
    Fault("arm6", "joint", "joint6_pitch", "jnt_range", "joint limits", 0, 2.0),
    Fault(*JOINT, "jnt_actfrclimited", "joint torque range", shift=1),
    Fault(*JOINT, "jnt_stiffness", "spring and damper torque", shift=1e-3),
    Fault(*JOINT, "dof_armature", "armature", shift=1e-6),
    Fault(*JOINT, "dof_damping", "joint damping", shift=1e-4),
    Fault("foreign", "joint", "shaft_a_left", "dof_damping", "joint damping", shift=1e-4),
    Fault(*JOINT, "dof_frictionloss", "joint friction", shift=1e-4),
    Fault("dragon4", "site", "rotor2_2", "site_pos", "site position", 1, shift=1e-6),
    Fault("dragon4", "site", "rotor2_2", "site_quat", "site axis", 1, shift=1e-4),
    Fault("dragon4", "site", "imu", "site_pos", "site position", 0, shift=1e-6),
    Fault("dragon4", "site", "imu", "site_quat", "site axes", 3, shift=1e-4),
    Fault(*DRUM, "actuator_gainprm", "drum servo gain", 0, 1.01),
    Fault(*DRUM, "actuator_biasprm", "drum servo damping", 2, 1.01),
    Fault(*DRUM, "actuator_forcerange", "drum torque range", 0, 0.5),
    Fault(*DRUM, "actuator_gear", "drum gear", 0, -1.0),
    Fault(*DRUM, "actuator_trnid", "drum transmission", 0, shift=-1),
    Fault("screw4", "joint", "screw3", "dof_armature", "armature", None, 0.5),
    Fault("screw4", "joint", "wheel2_3_1", "dof_frictionloss", "joint friction", shift=0.01),
    Fault(*WHEEL, "geom_friction", "contact friction", 0, 0.9),
    Fault(*WHEEL, "geom_size", "contact size", 0, 1.001),
    Fault(*WHEEL, "geom_size", "contact size", 1, 1.001),
    Fault(*WHEEL, "geom_pos", "contact size", 2, shift=1e-6),
    Fault(*WHEEL, "geom_quat", "contact axis", 1, shift=1e-3),
    Fault(*WHEEL, "geom_type", "contact shape", shift=2),
    Fault(*WHEEL, "geom_conaffinity", "contact shape", shift=1),
    Fault(*WHEEL, "geom_condim", "contact shape", shift=1),
    Fault(*CASTER, "geom_pos", "contact size", 1, -0.9),
    Fault(*CASTER, "geom_size", "contact size", 0, 1.1),
    Fault(*CASTER, "geom_condim", "contact shape", shift=2),
    Fault("balls", "actuator", "screw3", "actuator_gear", "drum gear", 1, -1.0),
    Fault("balls", "actuator", "screw3", "actuator_forcerange", "drum torque range", 1, 2.0),
    Fault("balls", "geom", "screw3_contact", "geom_size", "contact size", 0, 1.01),
    Fault("balls", "joint", "screw3", "dof_armature", "armature", None, 2.0),
]


def plant(model: mujoco.MjModel, fault: Fault) -> None:
    """Changes the entry that `fault` names."""
    values = getattr(model, fault.field)
    if fault.field.startswith("dof_"):
        row = int(model.joint(fault.name).dofadr[0])
    else:
        row = getattr(model, fault.kind)(fault.name).id
    at = row if fault.column is None else (row, fault.column)
    changed = values[at] * fault.factor + fault.shift
    assert np.any(changed != values[at])
    if fault.kind == "site":
        model.site_sameframe[row] = 0  # else MuJoCo takes the body's frame for the site's
    values[at] = changed
