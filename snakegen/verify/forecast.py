"""What the analysis promises before a push: how much of it this allocator holds, on this link.

The reach is worked out where the robot will be when it gets there: each round turns the gimbals
as the forces at the end of the ray ask, lets every servo give way under its torque by τ/k, and
starts anew. Without that a dual-rotor robot, whose yaw is drag alone, is some 15 % off. Where the
thrust points move much with gimbals that point many ways, the rounds need not settle; then the
least of them is promised.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.analysis.wrench_margin import thrust_margins, vectored_margins
from snakegen.control.controller import Controller
from snakegen.control.frame import cog_frame
from snakegen.errors import MissionError
from snakegen.geometry import move_wrench
from snakegen.kernels.chain import centre_of_gravity, forward
from snakegen.kernels.control_types import VIRTUAL
from snakegen.kernels.fully_actuated import aim_forces
from snakegen.kernels.vectoring import joint_order
from snakegen.kinetostatics.joint_loads import joint_loads
from snakegen.kinetostatics.law import joint_torques
from snakegen.margins.inputs import force_map
from snakegen.margins.rays import Bounds, Reach, inverse_ray, thrust_ray, vectored_ray
from snakegen.posture import set_angle
from snakegen.robot import Robot

Floats = NDArray[np.float64]
KINDS = {"force": slice(0, 3), "torque": slice(3, 6), "wrench": slice(0, 6)}
ROUNDS = 8
SETTLED = 2e-3  # change of reach in the last round, of its size
_SAMPLES = 3000  # directions tried for the weakest of a pseudo-inverse, then refined


@dataclass(frozen=True, eq=False)
class Forecast:
    """A push and how far it can be held.

    Attributes:
        push: (6,) unit of the push on the robot, N and N m, root-link axes, about the CoG.
        held: multiple of it that can be held, thrust and joints within limits.
        thrust_only: the same without the joints' limits.
        settled: whether the last rounds agree; else `held` is the least of them.
        at_posture: `held` with the gimbals as the posture has them (the analysis' own number).
        stopped: what is at its limit there.
        link: that carries the push.
    """

    push: Floats
    held: float
    thrust_only: float
    at_posture: float
    stopped: tuple[str, ...]
    link: str
    settled: bool

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; infinite values are null."""
        numbers = {
            "held": self.held,
            "thrust_only": self.thrust_only,
            "held_at_posture": self.at_posture,
        }
        plain = {k: v if np.isfinite(v) else None for k, v in numbers.items()}
        return plain | {
            "push": self.push.tolist(),
            "stopped": list(self.stopped),
            "link": self.link,
            "settled": self.settled,
        }


def forecast(
    robot: Robot, controller: Controller, q: Floats, kind: str = "force", link: str | None = None
) -> Forecast:
    """Returns the weakest push of a kind at a hover posture, and how far it can be held.

    Args:
        robot, controller: the allocator and the mode are the controller's.
        q: (nq,) hover posture, level.
        kind: ``force``, ``torque`` or ``wrench``; dual-rotor mode always takes [f_z; τ].
        link: that carries the push (about the CoG); the root link if not given.

    Raises:
        MissionError: an unknown kind, or a posture that cannot hold anything.
    """
    if kind not in KINDS:
        raise MissionError(f"kind '{kind}': force, torque or wrench is needed.")
    name = link or robot.root_link
    direction = _weakest(robot, controller, q, kind, name)
    first = _reach(robot, controller, q, direction, name)
    found, settled = [(np.array(q), first)], False
    for _ in range(ROUNDS):
        reach = found[-1][1]
        if not 0 < reach.t < np.inf:
            break
        asked = _aimed(robot, controller, q, reach.x) if controller.mode == VIRTUAL else q
        now = _given_way(robot, controller, asked, reach, direction, name)
        found.append((now, _reach(robot, controller, now, direction, name)))
        settled = abs(found[-1][1].t - reach.t) <= SETTLED * reach.t
    now, reach = found[-1] if settled else min(found, key=lambda round_: round_[1].t)
    if not 0 < reach.t < np.inf:
        raise MissionError(
            f"{robot.name} holds no push in this posture: its margin is 0 or not defined."
        )
    free = _reach(robot, controller, now, direction, name, joints=False)
    stopped = _names(robot, controller, reach)
    return Forecast(direction, reach.t, free.t, first.t, stopped, name, settled)


def _map(robot: Robot, controller: Controller, a: Allocation) -> Floats:
    """Returns (6, 3Ñ) of forces in root-link axes, or (6, n) of rotor thrusts."""
    if controller.mode != VIRTUAL:
        return a.dual
    return force_map(a.thrust_points, a.drag)


def _bounds(robot: Robot, controller: Controller, q: Floats, link: str) -> Bounds:
    loads = joint_loads(robot, q, link)
    rows = loads.rotors
    if controller.mode == VIRTUAL:
        rows = loads.forces.reshape(len(loads.limit), -1)
    return Bounds(rows, loads.bias, loads.disturbance, loads.limit)


def _reach(
    robot: Robot,
    controller: Controller,
    q: Floats,
    push: Floats,
    link: str,
    *,
    joints: bool = True,
) -> Reach:
    """Returns the reach along `push` at q."""
    a = allocation(robot, q)
    bounds = _bounds(robot, controller, q, link) if joints else None
    matrix, rotors = _map(robot, controller, a), robot.rotors
    virtual = controller.mode == VIRTUAL
    if not controller.law.constrained:
        return _printed(robot, virtual, matrix, a.hover_wrench, push, bounds)
    if virtual:
        return vectored_ray(matrix, robot.gimbals.limit, a.hover_wrench, push, bounds)
    low, high = rotors.thrust_min, rotors.thrust_max
    return thrust_ray(matrix, low, high, a.hover_wrench, push, bounds, part=slice(2, 6))


def _printed(
    robot: Robot, virtual: bool, matrix: Floats, hover: Floats, push: Floats, bounds: Bounds | None
) -> Reach:
    """Returns the reach of the weighted pseudo-inverse of eqs 22 and 36."""
    rotors, limit = robot.rotors, robot.gimbals.limit
    if virtual:
        d = np.repeat(limit, 3)
        inverse = d[:, None] * np.linalg.pinv(matrix * d)
        return inverse_ray(inverse, hover, push, 0.0, limit, bounds, balls=True)
    d = rotors.thrust_max
    inverse = d[:, None] * np.linalg.pinv(matrix[2:] * d)
    low, high = rotors.thrust_min, rotors.thrust_max
    return inverse_ray(inverse, hover[2:], push[2:], low, high, bounds, joint_push=push)


def _weakest(robot: Robot, controller: Controller, q: Floats, kind: str, link: str) -> Floats:
    """Returns the push (6,) against which the allocator is weakest: unit of its kind."""
    a = allocation(robot, q)
    scale: dict[str, Any] = {
        "force_scale": robot.force_scale,
        "torque_scale": robot.torque_scale,
    }
    virtual = controller.mode == VIRTUAL
    if controller.law.constrained:
        if virtual:
            limit = robot.gimbals.limit
            v = vectored_margins(a.thrust_points, limit, a.hover_wrench, drag=a.drag, **scale)
            answer = v.worst(kind)
        else:
            rotors = robot.rotors
            t = thrust_margins(
                a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench, **scale
            )
            answer = t.worst("attitude_altitude")
        if not np.all(np.isfinite(answer)):
            raise MissionError(f"{robot.name} has no {kind} margin in this posture.")
        return -np.asarray(answer, float)
    part = KINDS[kind] if virtual else slice(2, 6)
    unit = np.repeat([robot.force_scale, robot.torque_scale], 3)
    unit = unit if part.stop - part.start > 3 else np.ones(6)
    bounds = _bounds(robot, controller, q, link)
    matrix = _map(robot, controller, a)

    def reach(e: Floats) -> float:
        push = np.zeros(6)
        push[part] = e / np.linalg.norm(e)
        t = _printed(robot, virtual, matrix, a.hover_wrench, push * unit, bounds).t
        return t if np.isfinite(t) else 1e9

    best = _least(reach, part.stop - part.start)
    push = np.zeros(6)
    push[part] = best / np.linalg.norm(best)
    return push * unit


def _least(reach: Any, size: int) -> Floats:
    """Returns the direction of least reach: samples, then a local search from the best."""
    from scipy.optimize import minimize

    rng = np.random.default_rng(0)
    tried = rng.standard_normal((_SAMPLES // 10 if size == 3 else _SAMPLES // 4, size))
    order = np.argsort([reach(e) for e in tried])
    best, least = tried[order[0]], np.inf
    for i in order[:3]:
        found = minimize(reach, tried[i], method="Nelder-Mead", options={"xatol": 1e-6})
        if found.fun < least:
            best, least = found.x, found.fun
    return np.asarray(best, float)


def _aimed(robot: Robot, controller: Controller, q: Floats, forces: Floats) -> Floats:
    """Returns q with the gimbals turned to apparatus forces (3Ñ,) in root-link axes."""
    base, origin = robot.base_pose(q)
    angles = robot.angles(q)
    frame = cog_frame(controller, angles, base, origin)
    turn = frame.axes.T @ base
    flat = (forces.reshape(-1, 3) @ turn.T).ravel()
    gimbals, law, m = robot.gimbals, controller.law, frame.mounts
    held = np.zeros((controller.apparatuses, 2))
    for j in range(len(held)):
        for k, body in enumerate((gimbals.roll_body[j], gimbals.pitch_body[j])):
            held[j, k] = angles[body - 1] if body >= 0 else 0.0
    turned, thrust = joint_order(m, held), np.zeros(len(held))
    lower, upper = joint_order(m, law.gimbal_lower), joint_order(m, law.gimbal_upper)
    aim_forces(m, np.ascontiguousarray(flat), lower, upper, thrust, turned)
    out, back = np.array(q), joint_order(m, turned)
    for j, apparatus in enumerate(robot.modules.apparatuses):
        for k, name in enumerate((apparatus.roll, apparatus.pitch)):
            if name is not None:
                set_angle(robot, out, name, float(back[j, k]))
    return out


def _given_way(
    robot: Robot, controller: Controller, q: Floats, reach: Reach, push: Floats, link: str
) -> Floats:
    """Returns q with every servo behind its command by torque over stiffness."""
    thrust = reach.x
    if controller.mode == VIRTUAL:
        sizes = np.linalg.norm(reach.x.reshape(-1, 3), axis=1)
        count = np.bincount(robot.rotors.apparatus)
        thrust = (sizes / count)[robot.rotors.apparatus]
    base, _ = robot.base_pose(q)
    poses = forward(robot.tree, *robot.base_pose(q), robot.angles(q))
    _, cog = centre_of_gravity(robot.tree, *poses)
    body, _, origin = robot.body_of_link(link)
    lever = cog - (poses[1][body] + poses[0][body] @ origin)
    pushed = reach.t * np.concatenate([base @ push[:3], base @ push[3:]])
    torque = joint_torques(
        robot, q, terms="static", thrust=thrust, wrenches={link: move_wrench(pushed, lever)}
    )[6:]
    out, angles = np.array(q), robot.angles(q)
    for servo in robot.modules.servos:
        i = robot.joint_names.index(servo.joint)
        if servo.stiffness > 0:
            set_angle(robot, out, servo.joint, float(angles[i] - torque[i] / servo.stiffness))
    return out


def _names(robot: Robot, controller: Controller, reach: Reach) -> tuple[str, ...]:
    """Returns what stops a reach, by the names of rotors, apparatuses and joints."""
    driven = {s.joint for s in robot.modules.servos}
    joints = [n for n in robot.chain_joints if n in driven]
    rotors = [r.link for a in robot.modules.apparatuses for r in a.rotors]
    out = []
    for item in reach.stopped:
        what, _, number = item.partition(" ")
        i = int(number)
        if what == "joint":
            out.append(joints[i])
        else:
            out.append(f"apparatus {i + 1}" if controller.mode == VIRTUAL else rotors[i])
    return tuple(out)
