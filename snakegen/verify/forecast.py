"""What the analysis promises before a push: how much of it this allocator holds, on this link.

Two figures: that of the posture as it is commanded, and that of the body as it stands under the
push, its servos behind their commands by τ/k and its thrust points where the gimbals take them. In
dual-rotor mode, whose yaw is drag alone, servos that give way by a hundredth of a radian change
the reach by a quarter and more. The paper's allocator promises the second; the constrained one,
whose second figure is the most that any answer could hold, the lesser of both.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.analysis.wrench_margin import thrust_margins, vectored_margins
from snakegen.control.controller import Controller
from snakegen.errors import MissionError
from snakegen.kernels.control_types import VIRTUAL
from snakegen.kinetostatics.joint_loads import joint_loads
from snakegen.margins.inputs import force_map
from snakegen.margins.rays import Bounds, Reach, inverse_ray, thrust_ray, vectored_ray
from snakegen.robot import Robot
from snakegen.verify.loaded import Load, load_on
from snakegen.verify.reach_loaded import LoadedReach, farthest, follow

Floats = NDArray[np.float64]
KINDS = {"force": slice(0, 3), "torque": slice(3, 6), "wrench": slice(0, 6)}
_SAMPLES = 3000  # directions tried for the weakest of a pseudo-inverse, then refined


@dataclass(frozen=True, eq=False)
class Forecast:
    """A push and how far it can be held.

    Attributes:
        push: (6,) unit of the push on the robot, N and N m, root-link axes, about the CoG.
        held: multiple of it that is promised, thrust and joints within limits.
        thrust_only: the same at the commanded posture without the joints' limits.
        at_posture: what the commanded posture holds (the analysis' own number).
        loaded: what the body holds as it gives way under the push; nan where no answer was found.
        stopped: what is at its limit at `held`.
        link: that carries it.
    """

    push: Floats
    held: float
    thrust_only: float
    at_posture: float
    loaded: float
    stopped: tuple[str, ...]
    link: str

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; values that are not finite are null."""
        numbers = {
            "held": self.held,
            "thrust_only": self.thrust_only,
            "held_at_posture": self.at_posture,
            "held_loaded": self.loaded,
        }
        plain = {k: v if np.isfinite(v) else None for k, v in numbers.items()}
        return plain | {
            "push": self.push.tolist(),
            "stopped": list(self.stopped),
            "link": self.link,
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
    rigid = _reach(robot, controller, q, direction, name)
    if not 0 < rigid.t < np.inf:
        raise MissionError(
            f"{robot.name} holds no push in this posture: its margin is 0 or not defined."
        )
    free = _reach(robot, controller, q, direction, name, joints=False)
    load = load_on(robot, controller, q, direction, name)
    if controller.law.constrained:
        bent = farthest(load, _unknowns(load, rigid))
    else:
        bent = follow(load, rigid.t)
    rigid_is_less = controller.law.constrained and rigid.t <= bent.t
    if rigid_is_less or not np.isfinite(bent.t):
        held, stopped = rigid.t, _names(robot, controller, rigid)
    else:
        held, stopped = bent.t, _names_loaded(load, bent)
    return Forecast(direction, held, free.t, rigid.t, bent.t, stopped, name)


def _unknowns(load: Load, reach: Reach) -> Floats:
    """Returns the first guess of `farthest`: the forces at the end of a ray, world axes, and t."""
    if not load.virtual:
        return np.concatenate([reach.x, np.zeros(2), [reach.t]])
    base = load.robot.base_pose(load.q)[0]
    return np.append((reach.x.reshape(-1, 3) @ base.T).ravel(), reach.t)


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


def _names_loaded(load: Load, reach: LoadedReach) -> tuple[str, ...]:
    """Returns what stops a reach of the body that gives way, by name."""
    rotors = [r.link for a in load.robot.modules.apparatuses for r in a.rotors]
    out = []
    for what, i in reach.stopped:
        if what == "servo":
            out.append(load.servos[i])
        else:
            out.append(f"apparatus {i + 1}" if load.virtual else rotors[i])
    return tuple(dict.fromkeys(out))
