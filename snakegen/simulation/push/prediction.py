"""Prediction of a push: the margin that `analyze margin` prints, and the limit of the loaded body.

The rigid prediction comes first: margin and weakest direction of the commanded posture, for the
allocator and mode that fly; with the constrained allocator, what least forces hold along that
direction when gimbals turn to what they carry. It shares thrust limits, servo limits, masses and
drag ratio with the plant, and nothing else. The loaded prediction is that of the same push on the
body in its quasi-static equilibrium: servos deflected by τ/k, thrust points where the gimbals take
them; it shares the servos' stiffness with the plant too. In dual-rotor mode, whose yaw is drag
alone, a deflection of a hundredth of a radian changes the limit by a quarter, and the loaded one
is judged.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.analysis.push_margins import (
    allocator_margin,
    followed,
    push_margins,
    servo_bounds,
)
from snakegen.control.controller import Controller
from snakegen.errors import MissionError
from snakegen.kernels.control.types import VIRTUAL
from snakegen.robot.robot import Robot
from snakegen.simulation.push.limit_search import LoadedReach, farthest, follow
from snakegen.simulation.push.quasi_static import Load, load_on
from snakegen.statics.largest_push import largest_push
from snakegen.statics.vectored_body import vectored_body
from snakegen.wrench_margins.controller import vectored_controller
from snakegen.wrench_margins.inputs import force_map
from snakegen.wrench_margins.push_margin import PushMargin, PushMargins
from snakegen.wrench_margins.rays import Reach, thrust_ray, vectored_ray
from snakegen.wrench_margins.thrust import ThrustMargins, thrust_margins
from snakegen.wrench_margins.vectored import VectoredMargins, set_margins

Floats = NDArray[np.float64]
KINDS = ("force", "torque", "wrench")
TOLERANCE = 1e-3  # relative gap of the certified margins


@dataclass(frozen=True, eq=False)
class Forecast:
    """A push and the limit that is predicted for it.

    Attributes:
        push: (6,) unit of the push on the robot, N and N·m, root-link axes, about the CoG.
        held: multiple of it at the rigid prediction, thrust and servos within limits; gimbals
            turned to what they carry for the constrained allocator (`push_margins.followed`).
        printed_margin: multiple of it at the printed margin, gimbals as they hover.
        thrust_only: the same margin without servo limits, in its own weakest direction.
        loaded: multiple of the push at the limit of the loaded body; nan where none was found.
        any_forces: multiple of the push that least forces within all limits hold, whichever
            allocator flies; nan but for the pseudo-inverse with limited gimbals.
        stopped: what is at its limit at `held`.
        stopped_loaded: what is at its limit at `loaded`.
        link: that carries it.
        margin: which of the printed margins the prediction is.
    """

    push: Floats
    held: float
    printed_margin: float
    thrust_only: float
    loaded: float
    any_forces: float
    stopped: tuple[str, ...]
    stopped_loaded: tuple[str, ...]
    link: str
    margin: str

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; values that are not finite are null."""
        numbers = {
            "held": self.held,
            "printed_margin": self.printed_margin,
            "thrust_only": self.thrust_only,
            "held_loaded": self.loaded,
            "any_forces": self.any_forces,
        }
        plain = {k: v if np.isfinite(v) else None for k, v in numbers.items()}
        return plain | {
            "push": self.push.tolist(),
            "stopped": list(self.stopped),
            "stopped_loaded": list(self.stopped_loaded),
            "link": self.link,
            "margin": self.margin,
        }


def forecast(
    robot: Robot, controller: Controller, q: Floats, kind: str = "force", link: str | None = None
) -> Forecast:
    """Returns the weakest push of a kind at a hover posture, and the limit predicted for it.

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
    name, a = link or robot.root_link, allocation(robot, q)
    virtual, constrained = controller.mode == VIRTUAL, bool(controller.law.constrained)
    exact = _exact(robot, q, a, virtual)
    found = push_margins(robot, q, a, name, exact, TOLERANCE)
    if virtual and kind == "wrench":
        found = _with_wrench(robot, q, a, found, exact)
    kind = kind if virtual else "attitude_altitude"
    allocator = "constrained" if constrained else "paper"
    key, margin = found.prediction(kind, allocator)
    if virtual:
        one = followed(robot, q, PushMargins(name, {kind: found.kinds[kind]}), allocator)
        key, margin = one.prediction(kind, allocator)
    if not 0 < margin.value < np.inf:
        raise MissionError(
            f"{robot.name} holds no push in this posture: its margin is 0 (a singular posture) or "
            "not defined (hover itself exceeds a limit)."
        )
    free = found.kinds[kind][key.replace("servo", "thrust")].value
    push = np.array(margin.push)
    load = load_on(robot, controller, q, push, name)
    if constrained and virtual:
        bent = LoadedReach(float("nan"), q, ())  # seconds of work for a body that hardly differs
    elif constrained:
        bent = farthest(load, _unknowns(load, _exact_ray(robot, q, a, push, name, virtual)))
    else:
        bent = follow(load, margin.value)
    stopped = _names_loaded(load, bent)
    most = float("nan")
    low, high, _ = robot.limits(sorted(robot.gimbal_names))
    if virtual and not constrained and np.any(high - low < 2.0 * np.pi - 1e-6):
        # past its first gimbal at a limit this law goes on by its integrals
        most = largest_push(vectored_body(robot, q, push, name), margin.value).t
    held = (margin.predicted, margin.value, free, bent.t, most)
    return Forecast(push, *held, margin.at_limit, stopped, name, key)


def _exact(
    robot: Robot, q: Floats, a: Allocation, virtual: bool
) -> VectoredMargins | ThrustMargins:
    """Returns the exact margins of a mode within thrust limits."""
    scale: dict[str, Any] = {
        "force_scale": robot.force_scale,
        "torque_scale": robot.torque_scale,
    }
    if virtual:
        return set_margins(robot.force_sets(q), a.hover_wrench, tolerance=TOLERANCE, **scale)
    rotors = robot.rotors
    return thrust_margins(a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench, **scale)


def _with_wrench(
    robot: Robot, q: Floats, a: Allocation, found: PushMargins, exact: Any
) -> PushMargins:
    """Returns the margins with those of scaled force and torque together: kind ``wrench``.

    The exact one within servo limits is the least reach along the weakest directions of the
    others: a figure of that direction, not a certified margin.
    """
    sets, scale = robot.force_sets(q), [robot.force_scale, robot.torque_scale]
    bounds, joints = servo_bounds(robot, q, found.link, True)
    labels = [*robot.apparatus_names, *joints]
    units: dict[str, Any] = {"force_scale": scale[0], "torque_scale": scale[1]}
    units |= {"drag": sets.drag, "weights": robot.gimbals.limit, "sets": sets}
    given = (sets.points, robot.gimbals.limit, a.hover_wrench)
    out = {}
    for key, kept in (("pseudo_inverse_thrust", None), ("pseudo_inverse_servo", bounds)):
        mine = vectored_controller(*given, bounds=kept, **units)
        out[key] = allocator_margin(mine.slices["wrench"], labels)
    low, high = (float(x) for x in exact.wrench_bounds)
    whole = PushMargin(low, (low, high), tuple(-exact.worst("wrench")), ())
    pushes = [np.array(whole.push)]
    pushes += [
        np.array(found.kinds[kind]["exact_servo"].push) * unit
        for kind, unit in zip(("force", "torque"), scale, strict=True)
        if "exact_servo" in found.kinds[kind]
    ]
    rays = [_exact_ray(robot, q, a, push, found.link, True) for push in pushes]
    i = int(np.argmin([ray.t for ray in rays]))
    out |= {
        "exact_thrust": whole,
        "exact_servo": PushMargin(rays[i].t, (0.0, rays[i].t), tuple(pushes[i]), ()),
    }
    return PushMargins(found.link, found.kinds | {"wrench": out})


def _exact_ray(
    robot: Robot, q: Floats, a: Allocation, push: Floats, link: str, virtual: bool
) -> Reach:
    """Returns the exact reach along `push` at q, thrust and servos within limits."""
    bounds, rotors = servo_bounds(robot, q, link, virtual)[0], robot.rotors
    if virtual:
        matrix = force_map(a.thrust_points, a.drag)
        return vectored_ray(matrix, robot.gimbals.limit, a.hover_wrench, push, bounds)
    limits = (rotors.thrust_min, rotors.thrust_max)
    return thrust_ray(a.dual, *limits, a.hover_wrench, push, bounds, part=slice(2, 6))


def _unknowns(load: Load, reach: Reach) -> Floats:
    """Returns the first guess of `farthest`: the forces at the end of a ray, world axes, and t."""
    if not load.virtual:
        return np.concatenate([reach.x, np.zeros(2), [reach.t]])
    base = load.robot.base_pose(load.q)[0]
    return np.append((reach.x.reshape(-1, 3) @ base.T).ravel(), reach.t)


def _names_loaded(load: Load, reach: LoadedReach) -> tuple[str, ...]:
    """Returns what is at its limit at the end of a loaded push, by name."""
    rotors = [r.label for a in load.robot.modules.apparatuses for r in a.rotors]
    out = []
    for what, i in reach.stopped:
        if what == "servo":
            out.append(load.servos[i])
        else:
            out.append(load.robot.apparatus_names[i] if load.virtual else rotors[i])
    return tuple(dict.fromkeys(out))
