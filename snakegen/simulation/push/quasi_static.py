"""Quasi-static equilibrium under an external wrench: servo compliance, moving thrust points.

Statics only. A servo stands behind its command by its torque over its stiffness; a gimbal is
commanded along the force asked of its apparatus, or in dual-rotor mode along the one direction
that leaves no horizontal force.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import move_wrench, quaternion_xyzw
from snakegen.control.controller import Controller
from snakegen.control.frame import CogFrame, cog_frame
from snakegen.control.fully_actuated import allocate as allocate_virtual
from snakegen.control.underactuated import allocate as allocate_dual
from snakegen.control.underactuated import attitude_for, gimbals_for
from snakegen.kernels.allocation.fully_actuated import aim_forces
from snakegen.kernels.allocation.gimbals import joint_order
from snakegen.kernels.control.types import VIRTUAL
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.posture import set_angle
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import joint_torques

Floats = NDArray[np.float64]
LEVEL = np.eye(3)
STANDS = 1e-9  # rad, change of the last round of giving way


@dataclass(frozen=True, eq=False)
class Load:
    """A body, its controller, the posture commanded, and a push on one of its links.

    Attributes:
        q: (nq,) commanded posture, root level.
        push: (6,) unit of the push, N and N·m, about the CoG.
        link: that carries it.
        frame: the CoG frame at q.
        servos: joints with a servo.
        address: (k,) of each servo's angle among `Robot.angles`.
        stiffness, limit: (k,) N·m/rad and N·m.
        share: (n,) of its apparatus' thrust that each rotor gives.
    """

    robot: Robot
    controller: Controller
    q: Floats
    push: Floats
    link: str
    frame: CogFrame
    servos: tuple[str, ...]
    address: NDArray[np.int64]
    stiffness: Floats
    limit: Floats
    share: Floats

    @property
    def weight(self) -> float:
        """Returns m g [N]."""
        return float(self.frame.mass * self.controller.law.gravity)

    @property
    def virtual(self) -> bool:
        """Tells whether the rotors of an apparatus act as one."""
        return self.controller.mode == VIRTUAL


def load_on(robot: Robot, controller: Controller, q: Floats, push: Floats, link: str) -> Load:
    """Returns the load of `push` (6,), root-link axes, on `link` of a body that hovers at q."""
    servos = tuple(robot.modules.servos)
    names = tuple(s.joint for s in servos)
    count = np.bincount(robot.rotors.apparatus)
    base, origin = robot.base_pose(q)
    return Load(
        robot,
        controller,
        np.array(q),
        np.concatenate([base @ push[:3], base @ push[3:]]),
        link,
        cog_frame(controller, robot.angles(q), base, origin),
        names,
        np.array([robot.joint_names.index(n) for n in names], np.int64),
        np.array([s.stiffness for s in servos], float),
        robot.limits(list(names))[2],
        1.0 / count[robot.rotors.apparatus],
    )


def give_way(
    load: Load, now: Floats, thrust: Floats, gimbals: Floats, t: float
) -> tuple[Floats, Floats]:
    """Returns where the body stands when bent as at `now`, and its servos' torques (k,) [N·m].

    Args:
        load: body and push.
        now: (nq,) where it stands by the round before; gives levers and the attitude.
        thrust: (n,) N.
        gimbals: (Ñ, 2) rad, commanded.
        t: multiple of the push.
    """
    robot = load.robot
    base, origin = robot.base_pose(now)
    poses = forward(robot.tree, base, origin, robot.angles(now))
    _, cog = centre_of_gravity(robot.tree, *poses)
    body, _, place = robot.body_of_link(load.link)
    lever = cog - (poses[1][body] + poses[0][body] @ place)
    wrench = {load.link: move_wrench(t * load.push, lever)}
    every = joint_torques(robot, now, terms="static", thrust=thrust, wrenches=wrench)[6:]
    asked = np.array(load.q)
    asked[3:7] = now[3:7]
    asked = with_gimbals(robot, asked, gimbals)
    out, angles, torque = np.array(asked), robot.angles(asked), every[load.address]
    for name, i, stiff, moment in zip(
        load.servos, load.address, load.stiffness, torque, strict=True
    ):
        if stiff > 0.0:
            set_angle(robot, out, name, float(angles[i] - moment / stiff))
    return out, torque


def with_gimbals(robot: Robot, q: Floats, gimbals: Floats) -> Floats:
    """Returns q with its gimbals at (Ñ, 2) rad."""
    out = np.array(q)
    for apparatus, turns in zip(robot.modules.apparatuses, gimbals, strict=True):
        for name, angle in zip((apparatus.roll, apparatus.pitch), turns, strict=True):
            if name is not None:
                set_angle(robot, out, name, float(angle))
    return out


def leaning(load: Load, q: Floats, side: Floats) -> tuple[Floats, CogFrame]:
    """Returns q turned as the controller turns the body, and the CoG frame there.

    Level, but for dual-rotor mode: there as eqs 23-24 lean it for a horizontal force `side` (2,).
    """
    robot, c = load.robot, load.controller
    base, origin = robot.base_pose(q)
    angles = robot.angles(q)
    frame = cog_frame(c, angles, base, origin)
    wanted = LEVEL
    if not load.virtual:
        wanted = attitude_for(c, load.frame, np.append(side, 0.0), LEVEL)
    out = np.array(q)
    out[3:7] = quaternion_xyzw(wanted @ frame.axes.T @ base)
    return out, cog_frame(c, angles, *robot.base_pose(out))


def lacking(load: Load, q: Floats, thrust: Floats, t: float) -> Floats:
    """Returns the wrench (6,), world axes, about the CoG, by which rotors miss weight and push."""
    base = load.robot.base_pose(q)[0]
    made = allocation(load.robot, q).dual @ thrust
    made = np.concatenate([base @ made[:3], base @ made[3:]])
    weight = np.array([0.0, 0.0, load.weight, 0.0, 0.0, 0.0])
    return np.asarray(weight - t * load.push - made)


def aimed(load: Load, frame: CogFrame, q: Floats, forces: Floats) -> Floats:
    """Returns the gimbals (Ñ, 2) [rad] along apparatus forces (3Ñ,) in world axes."""
    gimbals, law, m = load.robot.gimbals, load.controller.law, frame.mounts
    angles = load.robot.angles(q)
    held = np.zeros((load.controller.apparatuses, 2))
    for j in range(len(held)):
        for k, body in enumerate((gimbals.roll_body[j], gimbals.pitch_body[j])):
            held[j, k] = angles[body - 1] if body >= 0 else 0.0
    turned, thrust = joint_order(m, held), np.zeros(len(held))
    lower, upper = joint_order(m, law.gimbal_lower), joint_order(m, law.gimbal_upper)
    flat = np.ascontiguousarray((forces.reshape(-1, 3) @ frame.axes).ravel())
    aim_forces(m, flat, lower, upper, thrust, turned)
    return np.asarray(joint_order(m, turned))


@dataclass(eq=False)
class Steady:
    """The steady flight of one allocator under a push: its integrals have found what holds it.

    Attributes:
        load: body and push.
        q: (nq,) where it stands.
        wrench: (6,) that the controller asks for, axes of its frame.
        side: (2,) N, horizontal force that it leans for in dual-rotor mode.
        gimbals: (Ñ, 2) rad, commanded.
        thrust: (n,) N.
        torque: (k,) N·m, of the servos.
    """

    load: Load
    q: Floats
    wrench: Floats
    side: Floats = field(default_factory=lambda: np.zeros(2))
    gimbals: Any = None
    thrust: Floats = field(default_factory=lambda: np.zeros(0))
    torque: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def hovering(cls, load: Load) -> "Steady":
        """Returns the start: the weight asked for at the commanded posture."""
        return cls(load, np.array(load.q), load.frame.hover_wrench.copy())

    def copy(self) -> "Steady":
        """Returns a copy that can go on by itself."""
        return Steady(
            self.load, self.q, self.wrench, self.side, self.gimbals, self.thrust, self.torque
        )

    def settle(self, t: float, rounds: int = 100, tolerance: float = 1e-8) -> bool:
        """Goes to the steady state at `t` times the push; False where `rounds` do not get there.

        Each round lets the controller answer what it asks for where the body stands, lets the body
        give way, and adds what the wrench then lacks to what is asked, as the integrals do.
        """
        load, c = self.load, self.load.controller
        robot = load.robot
        for _ in range(rounds):
            q, frame = leaning(load, self.q, self.side)
            if load.virtual:
                answer = allocate_virtual(c, frame, self.wrench, self.gimbals, force=True)
                self.thrust = answer.thrust[robot.rotors.apparatus] * load.share
                self.gimbals = answer.gimbals
            else:
                force = np.append(self.side, 0.0)
                self.gimbals = gimbals_for(c, frame, force, LEVEL, self.gimbals)
                self.thrust = allocate_dual(
                    c, frame, self.wrench, self.gimbals, LEVEL, force=True
                ).thrust
            now, self.torque = give_way(load, q, self.thrust, self.gimbals, t)
            moved = float(np.abs(now - self.q).max())
            self.q = now
            lack = lacking(load, now, self.thrust, t)
            axes = frame.axes
            self.wrench = self.wrench + np.concatenate([axes.T @ lack[:3], axes.T @ lack[3:]])
            if not load.virtual:
                self.side = self.side + 0.5 * lack[:2]
            if not np.isfinite(lack).all():
                return False
            if np.abs(lack).max() < tolerance * load.weight and moved < STANDS:
                return True
        return False

    def room(self) -> tuple[float, list[tuple[str, int, float]]]:
        """Returns the least share of a limit that is left, and ("thrust" or "servo", i, share)."""
        robot, load = self.load.robot, self.load
        if load.virtual:
            count = np.bincount(robot.rotors.apparatus)
            pushes = np.bincount(robot.rotors.apparatus, self.thrust, len(count))
            most = np.maximum(robot.gimbals.limit, 1e-12)
            left = np.minimum(most - pushes, pushes) / most
        else:
            rotors = robot.rotors
            most = np.maximum(rotors.thrust_max, 1e-12)
            left = np.minimum(most - self.thrust, self.thrust - rotors.thrust_min) / most
        rows = [("thrust", i, float(x)) for i, x in enumerate(left)]
        bounded = np.isfinite(load.limit) & (load.limit > 0.0)
        rows += [
            ("servo", int(i), float(1.0 - abs(self.torque[i]) / load.limit[i]))
            for i in np.flatnonzero(bounded)
        ]
        return min(x for _, _, x in rows), rows
