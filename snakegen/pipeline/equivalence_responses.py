"""Responses of an MJCF's actuators to commands, against what the URDF and its modules declare.

Thrust goes through MuJoCo from command to generalised force and is compared with the column of Q
(ZN23 eq 10) and, in the joints, with ``Jᵀ w``; servos and drums go from command to torque.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.pipeline.equivalence_actuators import Actuation, joint_limits, torque_limits
from snakegen.pipeline.equivalence_pairs import Pairs, pairs
from snakegen.robot.arrays import base_link

_BEYOND = 3.0  # command over range, by which limits are tried
_AXES = tuple("xyz")
_LIMITS = ("lower [N]", "upper [N]")
_WRENCH = tuple(f"{kind} {axis}" for kind in ("force", "torque [m]") for axis in _AXES)


@dataclass(frozen=True)
class Bodies:
    """Poses of the robot's moving bodies by the URDF: (n, 3, 3) axes, (n, 3) m, (3,) m CoG."""

    rotation: Floats
    position: Floats
    cog: Floats


def responses(at: Actuation, data: mujoco.MjData, bodies: Bodies, v: Floats) -> Iterator[Pairs]:
    """Yields what each actuator does in the state of `data`, and what friction-free joints resist.

    Args:
        at: robot and MJCF.
        data: after `mj_forward`.
        bodies: the same state by the URDF.
        v: (nv,) its velocity in Pinocchio's order.
    """
    yield from _passive(at, data, v)
    yield from _sites(at, data, bodies)
    if at.rotors:
        yield from _thrusts(at, data, bodies)
    yield from _servo_torques(at, data)


def _passive(at: Actuation, data: mujoco.MjData, v: Floats) -> Iterator[Pairs]:
    damped = -at.of_joints(at.robot.model.damping) * at.of_joints(v)
    scale = max(1.0, float(np.abs(damped).max(initial=0.0)))
    declared, found = damped / scale, data.qfrc_passive[at.dofs] / scale
    columns = (f"[{scale:.3g} N·m]",)
    yield pairs("spring and damper torque", at.joints, columns, declared, found)
    if at.robot.floating:
        zero = np.zeros(6)
        yield pairs("passive force", ("root",), _AXES * 2, zero, data.qfrc_passive[:6] / scale)


def _sites(at: Actuation, data: mujoco.MjData, bodies: Bodies) -> Iterator[Pairs]:
    """Yields pose and thrust direction of each rotor's site, and of the IMU's."""
    names = [r.label for r in at.rotors]
    point, axis = _rotor_poses(at, bodies)
    ids = [at.model.site(n).id for n in names]
    axes = data.site_xmat.reshape(-1, 3, 3)
    position = tuple(f"{a} [m]" for a in "xyz")
    yield pairs("site position", names, position, point, data.site_xpos[ids])
    yield pairs("site axis", names, _AXES, axis, axes[ids][:, :, 2])
    imu, root = at.model.site("imu").id, at.model.body(base_link(at.robot)).id
    yield pairs("site position", ("imu",), position, data.xpos[root], data.site_xpos[imu])
    turned = data.xmat[root], axes[imu].ravel()
    yield pairs("site axes", ("imu",), [f"axis {k}" for k in range(9)], *turned)


def _rotor_poses(at: Actuation, bodies: Bodies) -> tuple[Floats, Floats]:
    """Returns thrust points (n, 3) m and unit directions (n, 3), world axes, by the URDF."""
    rotors = at.robot.rotors
    turn, origin = bodies.rotation[rotors.body], bodies.position[rotors.body]
    point = origin + np.einsum("nij,nj->ni", turn, rotors.position)
    return point, np.einsum("nij,nj->ni", turn, rotors.axis)


def unit_wrenches(at: Actuation, bodies: Bodies) -> Floats:
    """Returns Q (n, 6): force and torque about the CoG, root-link axes, of 1 N of each rotor."""
    point, axis = _rotor_poses(at, bodies)
    torque = np.cross(point - bodies.cog, axis) + at.robot.rotors.torque_ratio[:, None] * axis
    base = bodies.rotation[0]
    return np.hstack([axis @ base, torque @ base])


def joint_forces(at: Actuation, bodies: Bodies) -> Floats:
    """Returns (n, joints): generalised force of 1 N of each rotor, ``a · (τ + (p - o) × f)``."""
    tree, rotors = at.robot.tree, at.robot.rotors
    point, axis = _rotor_poses(at, bodies)
    body = np.array([at.robot.body_of_joint(n) for n in at.joints], int)
    moved = np.zeros((len(rotors.body), len(tree.parent)), bool)
    for k, b in enumerate(rotors.body):
        here = int(b)
        while here > 0:
            moved[k, here] = True
            here = int(tree.parent[here])
    turned = np.einsum("bij,bj->bi", bodies.rotation, tree.axis)[body]
    lever = point[:, None] - bodies.position[body][None]
    torque = np.cross(lever, axis[:, None]) + (rotors.torque_ratio[:, None] * axis)[:, None]
    slides = tree.prismatic[body].astype(bool)[None, :, None]
    force = np.where(slides, axis[:, None], torque)
    return np.asarray(np.where(moved[:, body], np.einsum("nbi,bi->nb", force, turned), 0.0))


def _thrusts(at: Actuation, data: mujoco.MjData, bodies: Bodies) -> Iterator[Pairs]:
    """Yields force, rate and unit wrench of each rotor, through MuJoCo's own actuation."""
    model, names = at.model, [r.label for r in at.rotors]
    rows = at.ids(names)
    low = np.array([r.thrust_min for r in at.rotors])
    high = np.maximum([r.thrust_max for r in at.rotors], low + 1e-3)
    _pushed(model, data, rows, high)
    force = np.array(data.actuator_force[rows])
    rates = _thrust_rates(at, data, rows)
    resting = _pushed(model, data, rows, low)
    both = np.column_stack([data.actuator_force[rows], force])
    limits = np.column_stack([low, high])
    yield pairs("thrust at its limits", names, _LIMITS, limits, both)
    yield from rates
    forces = np.empty((len(rows), model.nv))
    for k in range(len(rows)):
        thrust = low.copy()
        thrust[k] = high[k]
        forces[k] = (_pushed(model, data, rows, thrust) - resting) / (high[k] - low[k])
    if at.robot.floating:
        base = bodies.rotation[0]
        push = forces[:, :3] @ base
        lever = base.T @ (bodies.cog - bodies.position[0])
        found = np.hstack([push, forces[:, 3:6] - np.cross(lever, push)])
        yield pairs("thrust wrench", names, _WRENCH, unit_wrenches(at, bodies), found)
    columns = [f"on {n}" for n in at.joints]
    declared = joint_forces(at, bodies)
    if columns:
        point, _ = _rotor_poses(at, bodies)
        lever = point[:, None] - bodies.position[None]
        scale = float(np.linalg.norm(lever, axis=2).max())  # m, for 1 N: torques may cancel
        yield pairs("thrust on joints", names, columns, declared, forces[:, at.dofs], scale)


def _pushed(model: mujoco.MjModel, data: mujoco.MjData, rows: list[int], thrust: Floats) -> Floats:
    """Returns the generalised force (nv,) where the rotors' motors have reached `thrust`."""
    for row, value in zip(rows, thrust, strict=True):
        address = model.actuator_actadr[row]
        if address >= 0:
            data.act[address] = value
        data.ctrl[row] = value
    mujoco.mj_fwdActuation(model, data)
    return np.array(data.qfrc_actuator)


def _thrust_rates(at: Actuation, data: mujoco.MjData, rows: list[int]) -> list[Pairs]:
    """Returns λ̇ = (λ_limit - λ)/lag under commands far outside the range, of motors with a lag."""
    lagged = [(r, row) for r, row in zip(at.rotors, rows, strict=True) if r.lag > 0]
    lagged = [(r, row) for r, row in lagged if at.model.actuator_actadr[row] >= 0]
    span = np.array([r.thrust_max - r.thrust_min for r, _ in lagged])
    lags = np.array([r.lag for r, _ in lagged])
    found = []
    for sign in (-1.0, 1.0):
        for (r, row), width in zip(lagged, span, strict=True):
            data.act[at.model.actuator_actadr[row]] = r.thrust_min if sign > 0 else r.thrust_max
            limit = r.thrust_max if sign > 0 else r.thrust_min
            data.ctrl[row] = limit + sign * _BEYOND * max(width, 1.0)
        mujoco.mj_fwdActuation(at.model, data)
        found.append([data.act_dot[at.model.actuator_actadr[row]] for _, row in lagged])
    declared = np.outer([-1.0, 1.0], span / lags if lagged else span)
    columns = ("down [N/s]", "up [N/s]")
    names = [r.label for r, _ in lagged]
    return [pairs("thrust rate", names, columns, declared.T, np.array(found).T)]


def _servo_torques(at: Actuation, data: mujoco.MjData) -> Iterator[Pairs]:
    """Yields torques of servos and drums: one command within their limits, one far outside.

    What an actuator measures, ``length`` and ``velocity``, shows its joint and its gear.
    """
    model, drums = at.model, at.screws
    names, joints = [s.joint for s in at.servos], [s.joint for s in drums]
    rows, turning = at.ids(names), at.ids(joints)
    angle = np.array([data.qpos[model.joint(n).qposadr[0]] for n in names])
    rate = np.array([data.qvel[model.joint(n).dofadr[0]] for n in names])
    spin = np.array([data.qvel[model.joint(n).dofadr[0]] for n in joints])
    measured = np.column_stack([data.actuator_length[rows], data.actuator_velocity[rows]])
    columns: Any = ("angle", "rate")
    yield pairs("servo transmission", names, columns, np.column_stack([angle, rate]), measured)
    yield pairs("drum transmission", joints, ("rate",), spin, data.actuator_velocity[turning])
    kp, kv = np.array([[s.stiffness, s.damping] for s in at.servos]).reshape(-1, 2).T
    gain, most = np.array([[s.gain, s.torque] for s in drums]).reshape(-1, 2).T
    torque, (low, high) = torque_limits(at), joint_limits(at.robot, names).T
    reach = np.where(np.isfinite(torque), torque, 1.0)
    for share in (0.1, -0.1, _BEYOND, -_BEYOND):
        command = angle + (kv * rate + share * reach) / np.maximum(kp, 1e-9)
        data.ctrl[rows], data.ctrl[turning] = command, spin + share * most / gain
        mujoco.mj_fwdActuation(model, data)
        declared = kp * (np.clip(command, low, high) - angle) - kv * rate
        declared = np.clip(declared, -torque, torque)
        yield pairs("servo torque", names, ("[N·m]",), declared, data.actuator_force[rows])
        declared = np.clip(share, -1.0, 1.0) * most
        yield pairs("drum torque", joints, ("[N·m]",), declared, data.actuator_force[turning])
