"""Feasible-wrench margins of both modes: how much a body resists, where it is weakest, and why."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.analysis.hover_obstacles import hover_obstacles
from snakegen.analysis.push_margins import DUAL_MODE, VIRTUAL_MODE, followed, push_margins
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, near
from snakegen.picture.design_steps_chart import draw_steps
from snakegen.robot.robot import Robot
from snakegen.sensitivity.design_steps import design_steps
from snakegen.statics.joint_loads import joint_loads
from snakegen.wrench_margins.controller import thrust_controller, vectored_controller
from snakegen.wrench_margins.design_steps import DesignSteps
from snakegen.wrench_margins.failure import thrust_failures, vectored_failures
from snakegen.wrench_margins.joint_limited_rotors import thrust_joint_limited
from snakegen.wrench_margins.joint_limited_sets import sets_joint_limited
from snakegen.wrench_margins.push_margin import ALLOCATORS, PushMargins
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.summary import JointLimited, Margins, Weakest
from snakegen.wrench_margins.thrust import ThrustMargins, thrust_margins
from snakegen.wrench_margins.uncertainty import guaranteed_thrust, guaranteed_vectored
from snakegen.wrench_margins.vectored import VectoredMargins, set_margins, vectored_margins

__all__ = [
    "ThrustMargins",
    "VectoredMargins",
    "analyze",
    "applies",
    "set_margins",
    "thrust_margins",
    "vectored_margins",
]

COMMAND = "margin"
EXAMPLE = "dragon4 --joint joint1_yaw=0.8 --joint joint2_yaw=0.8 --failures"
ORDER = 50


def applies(robot: Robot) -> bool:
    """A robot with rotors and a free base."""
    return bool(robot.modules.apparatuses) and robot.floating


def analyze(
    robot: Robot,
    q: Floats,
    tolerance: float = 1e-3,
    failures: bool = False,
    link: str = "",
    allocator: str = "paper",
    mass_error: float = 0.0,
    thrust_error: float = 0.0,
    sensitivity: bool = False,
    picture: str = "",
) -> Margins:
    """Returns the margins of THEORY A4 at q for both modes.

    Vectored: each apparatus pushes within its gimbals' and thrust limits (`Robot.force_sets`), at
    its point of the posture's gimbal angles, the drag of its rotors along it; the lower of two
    certified bounds is the margin. Dual-rotor: gimbals held at q's angles, exact.

    Options:
        tolerance: relative gap of the certified vectored margins
        failures: add the table of each rotor and each apparatus lost
        link: where a disturbance acts, for the joint-limited margins; the root link if empty
        allocator: whose prediction for `push` is named: paper (pseudo-inverse) or constrained
            (exact)
        mass_error: fraction: also the margins guaranteed for a mass this uncertain
        thrust_error: fraction: the same for thrust limits
        sensitivity: add what small changes of the design do, and the best of them
        picture: file.png for the picture of --sensitivity

    Raises:
        DescriptionError: no such link.
        AnalysisError: an error share outside 0…1, an unknown allocator, a picture without
            sensitivity.
    """
    if picture and not sensitivity:
        raise AnalysisError("picture is of the sensitivities: ask for sensitivity too.")
    if picture and not picture.endswith(".png"):
        raise AnalysisError(f"picture '{picture}': the file's name must end in .png.")
    if allocator not in ALLOCATORS:
        raise AnalysisError(f"allocator '{allocator}' is unknown.{near(allocator, ALLOCATORS)}")
    for option, share in (("mass_error", mass_error), ("thrust_error", thrust_error)):
        if not 0.0 <= share < 1.0:
            raise AnalysisError(f"{option} is {share:g}; it must be a fraction in [0, 1).")
    a = allocation(robot, q)
    rotors, limit = robot.rotors, robot.gimbals.limit
    scale: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    low, high = rotors.thrust_min, rotors.thrust_max
    dual = thrust_margins(a.dual, low, high, a.hover_wrench, **scale)
    names = [r.label for m in robot.modules.apparatuses for r in m.rotors]
    units = list(robot.apparatus_names)
    controller = {
        "dual_rotor": _slices(thrust_controller(a.dual, low, high, a.hover_wrench, **scale))
    }
    vectored: dict[str, Weakest] = {}
    closed, exact, obstacles = False, dict[str, Any]({DUAL_MODE: dual}), None
    if robot.gimbal_names:
        free: dict[str, Any] = {"drag": a.drag} | scale
        sets = robot.force_sets(q)
        v = set_margins(sets, a.hover_wrench, tolerance=tolerance, **scale)
        closed, exact[VIRTUAL_MODE] = bool(v.closed), v
        vectored = {n: _weakest(v, n, units) for n in ("wrench", "force", "torque")}
        if not v.feasible:
            missing = np.nan_to_num(vectored["wrench"].direction) * -float(v.wrench_bounds[1])
            obstacles = hover_obstacles(robot, q, a.hover_wrench, missing)
        controller["virtual_single_rotor"] = _slices(
            vectored_controller(
                a.thrust_points,
                limit,
                a.hover_wrench,
                weights=np.ones(limit.size),
                sets=sets,
                **free,
            )
        )
    return Margins(
        vectored,
        closed,
        {n: _weakest(dual, n, names) for n in ("wrench", "force", "torque", "attitude_altitude")},
        controller,
        _joint_limited(robot, q, a, link or robot.root_link, tolerance, scale),
        _guaranteed(robot, q, a, mass_error, thrust_error, scale),
        _failures(robot, q, a, names, units, tolerance, scale) if failures else (),
        tolerance,
        **scale,
        push=_pushes(robot, q, a, link or robot.root_link, exact, tolerance, allocator),
        mode=str(robot.modules.control.get("mode", VIRTUAL_MODE)),
        allocator=allocator,
        steps=_steps(robot, q, picture) if sensitivity else None,
        obstacles=obstacles,
    )


def _steps(robot: Robot, q: Floats, picture: str) -> DesignSteps:
    """Returns what small changes do in the mode that is flown, drawn if asked for."""
    mode = str(robot.modules.control.get("mode", VIRTUAL_MODE))
    steps = design_steps(robot, q, mode if robot.gimbal_names else DUAL_MODE)
    if picture:
        draw_steps(steps, robot.name, Path(picture))
    return steps


def _pushes(
    robot: Robot,
    q: Floats,
    a: Allocation,
    link: str,
    exact: dict[str, Any],
    tolerance: float,
    allocator: str,
) -> dict[str, PushMargins]:
    """Returns the push margins of every mode whose exact margins there are."""
    out = {mode: push_margins(robot, q, a, link, m, tolerance) for mode, m in exact.items()}
    if VIRTUAL_MODE in out and robot.modules.control.get("mode", VIRTUAL_MODE) == VIRTUAL_MODE:
        out[VIRTUAL_MODE] = followed(robot, q, out[VIRTUAL_MODE], allocator)
    return out


def _weakest(found: ThrustMargins | VectoredMargins, name: str, labels: list[str]) -> Weakest:
    value = float(getattr(found, name))
    bounds = (value, value)
    if isinstance(found, VectoredMargins):
        low, high = getattr(found, f"{name}_bounds")
        bounds = (float(low), float(high))
    full, idle = found.saturated(name)
    if isinstance(found, VectoredMargins):
        idle = []  # an apparatus with room is at no limit
    return Weakest(
        value,
        bounds,
        tuple(float(x) for x in found.worst(name)),
        tuple(labels[i] for i in full),
        tuple(labels[i] for i in idle),
    )


def _joint_limited(
    robot: Robot, q: Floats, a: Allocation, link: str, tolerance: float, scale: dict[str, Any]
) -> dict[str, JointLimited]:
    """Returns the joint-limited margins by mode; none where the body has no joints."""
    loads = joint_loads(robot, q, link)
    if not loads.names or not np.all(np.isfinite(loads.limit) & (loads.limit > 0)):
        return {}
    by_rotor = Bounds(loads.rotors, loads.bias, loads.disturbance, loads.limit)
    rotors, more = robot.rotors, {"tolerance": tolerance} | scale
    given = (a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench)
    found = {"dual_rotor": thrust_joint_limited(*given, by_rotor, **more)}
    if robot.gimbal_names:
        by_force = replace(by_rotor, rows=loads.forces)
        sets = robot.force_sets(q)
        found["virtual_single_rotor"] = sets_joint_limited(sets, a.hover_wrench, by_force, **more)
    out = {}
    for mode, m in found.items():
        force, torque = (tuple(float(x) for x in b) for b in (m.force_bounds, m.torque_bounds))
        at = tuple(loads.names[i] for i in m.force_joints)
        out[mode] = JointLimited(link, (force[0], force[1]), (torque[0], torque[1]), at)
    return out


def _guaranteed(
    robot: Robot, q: Floats, a: Allocation, mass: float, thrust: float, scale: dict[str, Any]
) -> dict[str, dict[str, float]]:
    """Returns the margins that hold for mass and thrust limits this uncertain; none if exact."""
    if mass == 0.0 and thrust == 0.0:
        return {}
    rotors = robot.rotors
    errors: dict[str, Any] = {"mass": mass, "thrust": thrust}
    dual = guaranteed_thrust(
        a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench, **scale, **errors
    )
    out = {"dual_rotor": _slices(dual) | {"attitude_altitude": float(dual.attitude_altitude)}}
    if robot.gimbal_names:
        free = guaranteed_vectored(robot.force_sets(q), a.hover_wrench, **scale, **errors)
        out["virtual_single_rotor"] = _slices(free) | {"wrench": float(free.wrench)}
    return out


def _slices(found: Any) -> dict[str, float]:
    return {"force": float(found.force), "torque": float(found.torque)}


def _failures(
    robot: Robot,
    q: Floats,
    a: Any,
    names: list[str],
    units: list[str],
    tolerance: float,
    scale: dict[str, Any],
) -> tuple[tuple[str, str, float, float, float], ...]:
    """Returns (mode, what is lost, wrench, force, torque) for each rotor and apparatus lost."""
    rotors = robot.rotors
    dual = thrust_failures(
        a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench, rotors.apparatus, **scale
    )
    out = []
    for row in dual:
        m = row.margins
        label = names[row.index] if row.part == "rotor" else units[row.index]
        out.append(("dual_rotor", label, float(m.wrench), float(m.force), float(m.torque)))
    if robot.gimbal_names:
        sets = robot.force_sets(q)
        for row in vectored_failures(sets, a.hover_wrench, tolerance=tolerance, **scale):
            m = row.margins
            out.append(
                (
                    "virtual_single_rotor",
                    units[row.index],
                    float(m.wrench),
                    float(m.force),
                    float(m.torque),
                )
            )
    return tuple(out)
