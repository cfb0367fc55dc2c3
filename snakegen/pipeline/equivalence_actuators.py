"""Constants of an MJCF's actuators and joints against what the URDF and its modules declare.

Compared by value: which actuators, joints and sites there are; ranges of command and force; time
constants; gains of servos and drums; armature, damping, friction and limits of joints.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.pipeline.equivalence_pairs import Pairs, pairs
from snakegen.robot.modules import Rotor, Screw, Servo
from snakegen.robot.robot import Robot

_KIND = mujoco.mjtDyn.mjDYN_FILTEREXACT
_RANGE = ("lower [N]", "upper [N]")


@dataclass(frozen=True, eq=False)
class Actuation:
    """A robot and an MJCF of it, with the names that both should have.

    A drum on a ball has no hinge and no wheels in its MJCF: `joints` leaves those out.
    """

    robot: Robot
    model: mujoco.MjModel
    motors: tuple[str, ...] = ()  # joints driven by torque, up to their effort

    @cached_property
    def rotors(self) -> tuple[Rotor, ...]:
        """Rotors, apparatus by apparatus."""
        return tuple(r for a in self.robot.modules.apparatuses for r in a.rotors)

    @cached_property
    def servos(self) -> tuple[Servo, ...]:
        """Position servos."""
        return self.robot.modules.servos

    @cached_property
    def screws(self) -> tuple[Screw, ...]:
        """Drums that turn on a hinge."""
        return tuple(s for s in self.robot.modules.screws if not self.on_ball(s))

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the hinges and slides that both descriptions should have."""
        if len(self.screws) == len(self.robot.modules.screws):
            return self.robot.joint_names
        return tuple(n for n in self.robot.joint_names if n not in self.robot.rolling_names)

    def on_ball(self, screw: Screw) -> bool:
        """Whether the MJCF has a ball for this drum, as rollers 'ball' mean it."""
        joint = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, screw.joint)
        ball = mujoco.mjtJoint.mjJNT_BALL
        return screw.rollers == "ball" and joint >= 0 and self.model.jnt_type[joint] == ball

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """Names of the hinges of drums' passive wheels."""
        drums = enumerate(self.robot.modules.screws, 1)
        return tuple(
            f"wheel{i}_{b + 1}_{w + 1}"
            for i, s in drums
            if not self.on_ball(s)
            for b in range(s.blades)
            for w in range(s.wheels_per_blade)
        )

    def ids(self, names: Any) -> list[int]:
        """Returns the actuators of these names."""
        return [self.model.actuator(n).id for n in names]

    @cached_property
    def dofs(self) -> list[int]:
        """Velocity addresses of `joints`."""
        return [int(self.model.joint(n).dofadr[0]) for n in self.joints]

    def of_joints(self, values: Any) -> Floats:
        """Returns the entries of a Pinocchio velocity vector that belong to `joints`."""
        model = self.robot.model
        rows = [model.joints[model.getJointId(n)].idx_v for n in self.joints]
        return np.asarray(values, float)[rows]


def missing(at: Actuation) -> Pairs | None:
    """Returns the actuators, joints and sites of one description alone, or None."""
    kind, model = mujoco.mjtObj, at.model
    links = [r.label for r in at.rotors]
    screws = [s.joint for s in at.robot.modules.screws]
    expected = {
        (kind.mjOBJ_ACTUATOR, "actuator"): [
            *links,
            *(s.joint for s in at.servos),
            *screws,
            *at.motors,
        ],
        (kind.mjOBJ_JOINT, "joint"): list(at.joints),
        (kind.mjOBJ_SITE, "site"): [*links, "imu"],
    }
    rows = []
    for (what, label), names in expected.items():
        rows += [
            (f"{label} {n}", names.count(n), int(mujoco.mj_name2id(model, what, n) >= 0))
            for n in dict.fromkeys(names)
        ]
    known = set(expected[kind.mjOBJ_ACTUATOR, "actuator"])
    surplus = [model.actuator(i).name for i in range(model.nu)]
    rows += [(f"actuator {n or i}", 0, 1) for i, n in enumerate(surplus) if n not in known]
    wrong = [row for row in rows if row[1] != row[2]]
    if not wrong:
        return None
    absent, declared, found = zip(*wrong, strict=True)
    return pairs("presence", absent, ("count",), declared, found)


def constants(at: Actuation) -> Iterator[Pairs]:
    """Yields what does not depend on the state: ranges, lag, servo constants, joint properties."""
    yield from _rotor_constants(at)
    yield from _servo_constants(at)
    yield from _drum_constants(at)
    yield from _motor_constants(at)
    yield from _joint_constants(at)


def _limits(limited: Any, ranges: Any, rows: list[int]) -> Floats:
    """Returns (m, 2) ranges, infinite where there is no limit."""
    on = np.asarray(limited, bool)[rows][:, None]
    return np.where(on, np.asarray(ranges)[rows], [[-np.inf, np.inf]])


def _rotor_constants(at: Actuation) -> Iterator[Pairs]:
    model, names = at.model, [r.label for r in at.rotors]
    rows = at.ids(names)
    declared = [[r.thrust_min, r.thrust_max] for r in at.rotors]
    commands = _limits(model.actuator_ctrllimited, model.actuator_ctrlrange, rows)
    yield pairs("thrust range", names, _RANGE, declared, commands)
    forces = _limits(model.actuator_forcelimited, model.actuator_forcerange, rows)
    least, most = np.array(declared, float).reshape(-1, 2).T  # the range must let these through
    passed = np.column_stack([np.maximum(forces[:, 0], least), np.minimum(forces[:, 1], most)])
    yield pairs("force range", names, _RANGE, declared, passed)
    lag = np.where(model.actuator_dyntype[rows] == _KIND, model.actuator_dynprm[rows, 0], np.nan)
    lag = np.where(model.actuator_dyntype[rows] == mujoco.mjtDyn.mjDYN_NONE, 0.0, lag)
    yield pairs("motor lag", names, ("time constant [s]",), [r.lag for r in at.rotors], lag)


def _servo_constants(at: Actuation) -> Iterator[Pairs]:
    model, names = at.model, [s.joint for s in at.servos]
    rows = at.ids(names)
    gains = np.column_stack(
        [
            model.actuator_gainprm[rows, 0],
            -model.actuator_biasprm[rows, 1],
            -model.actuator_biasprm[rows, 2],
        ]
    )
    columns = ("stiffness [N·m/rad]", "stiffness of the bias [N·m/rad]", "damping [N·m·s/rad]")
    declared = [[s.stiffness, s.stiffness, s.damping] for s in at.servos]
    yield pairs("servo gains", names, columns, declared, gains)
    torque = torque_limits(at)
    forces = _limits(model.actuator_forcelimited, model.actuator_forcerange, rows)
    bounds = ("lower [N·m]", "upper [N·m]")
    yield pairs("servo torque range", names, bounds, np.column_stack([-torque, torque]), forces)
    angles = joint_limits(at.robot, names)
    commands = _limits(model.actuator_ctrllimited, model.actuator_ctrlrange, rows)
    yield pairs("servo command range", names, ("lower", "upper"), angles, commands)


def _drum_constants(at: Actuation) -> Iterator[Pairs]:
    model, screws = at.model, at.robot.modules.screws
    drums = [s.joint for s in screws]
    rows = at.ids(drums)
    torque = np.array([s.torque for s in screws])
    columns: Any = ("lower [N·m]", "upper [N·m]")
    forces = _limits(model.actuator_forcelimited, model.actuator_forcerange, rows)
    both = np.column_stack([-torque, torque])
    yield pairs("drum torque range", drums, columns, both, forces)
    gain = [s.gain for s in screws]
    columns = ("gain [N·m·s/rad]",)
    yield pairs("drum servo gain", drums, columns, gain, model.actuator_gainprm[rows, 0])
    yield pairs("drum servo damping", drums, columns, gain, -model.actuator_biasprm[rows, 2])
    tangent = [[1.0, -1.0 / np.tan(s.alpha) if at.on_ball(s) else 0.0] for s in screws]
    columns = ("about the axle", "across")
    yield pairs("drum gear", drums, columns, tangent, model.actuator_gear[rows, :2])


def _motor_constants(at: Actuation) -> Iterator[Pairs]:
    model, names = at.model, list(at.motors)
    rows = at.ids(names)
    effort = at.robot.limits(names)[2] if names else np.zeros(0)
    commands = _limits(model.actuator_ctrllimited, model.actuator_ctrlrange, rows)
    bounds = ("lower [N·m]", "upper [N·m]")
    yield pairs("motor range", names, bounds, np.column_stack([-effort, effort]), commands)
    turned = [
        model.joint(int(model.actuator_trnid[row, 0])).name == n
        for row, n in zip(rows, names, strict=True)
    ]
    yield pairs("motor joint", names, ("count",), np.ones(len(names)), turned)
    yield pairs("motor gear", names, ("gear",), np.ones(len(names)), model.actuator_gear[rows, 0])


def torque_limits(at: Actuation) -> Floats:
    """Returns the effort (m,) of each servo's joint [N·m], infinite where the URDF has none."""
    names = [s.joint for s in at.servos]
    effort = at.robot.limits(names)[2] if names else np.zeros(0)
    return np.where(effort > 0, effort, np.inf)


def joint_limits(robot: Robot, names: Any) -> Floats:
    """Returns the limits (m, 2) of joints, infinite for continuous ones."""
    if not names:
        return np.zeros((0, 2))
    low, high, _ = robot.limits(names)
    model = robot.model
    free = np.array([model.joints[model.getJointId(n)].nq == 2 for n in names], bool)
    return np.column_stack([np.where(free, -np.inf, low), np.where(free, np.inf, high)])


def _joint_constants(at: Actuation) -> Iterator[Pairs]:
    model, pin, names = at.model, at.robot.model, list(at.joints)
    rows = [model.joint(n).id for n in names]
    ranges = _limits(model.jnt_limited, model.jnt_range, rows)
    limits = joint_limits(at.robot, names)
    yield pairs("joint limits", names, ("lower", "upper"), limits, ranges, 1.0)  # rad, m
    held = [s.joint for s in at.servos]  # a limit of the joint would clip the thrusts' torque too
    rows = [model.joint(n).id for n in held]
    clip = _limits(model.jnt_actfrclimited, model.jnt_actfrcrange, rows)
    free = np.tile([-np.inf, np.inf], (len(held), 1))
    yield pairs("joint torque range", held, ("lower [N·m]", "upper [N·m]"), free, clip)
    friction = dict(zip(names, at.of_joints(pin.friction), strict=True))
    friction |= {s.joint: s.friction for s in at.servos}
    for quantity, unit, declared, values in (
        ("armature", "[kg·m²]", at.of_joints(pin.armature), model.dof_armature),
        ("joint damping", "[N·m·s/rad]", at.of_joints(pin.damping), model.dof_damping),
        ("joint friction", "[N·m]", [friction[n] for n in names], model.dof_frictionloss),
    ):
        yield pairs(quantity, names, (unit,), declared, values[at.dofs])
        if at.robot.floating:
            yield pairs(quantity, ("root",), tuple("xyz") * 2, np.zeros(6), values[:6])
