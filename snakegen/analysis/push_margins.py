"""Push margins of a robot: exact and pseudo-inverse allocator, thrust and servo limits.

All of them are of the rigid body in its commanded posture. What flies shares thrust limits, servo
limits and drag ratio with them, but neither the stiffness of servos nor the allocator's code.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from snakegen.analysis.allocation import Allocation
from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot
from snakegen.statics.joint_loads import joint_loads
from snakegen.statics.largest_push import largest_push
from snakegen.statics.vectored_body import vectored_body
from snakegen.wrench_margins.controller import (
    AllocatorMargin,
    truncated_controller,
    vectored_controller,
)
from snakegen.wrench_margins.joint_limited import JointLimitedMargins
from snakegen.wrench_margins.joint_limited_rotors import truncated_joint_limited
from snakegen.wrench_margins.joint_limited_sets import sets_joint_limited
from snakegen.wrench_margins.push_margin import PushMargin, PushMargins
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.thrust import ThrustMargins
from snakegen.wrench_margins.vectored import VectoredMargins

VIRTUAL_MODE, DUAL_MODE = "virtual_single_rotor", "dual_rotor"


def servo_bounds(robot: Robot, q: Floats, link: str, virtual: bool) -> tuple[Bounds, list[str]]:
    """Returns the joint torque limits at q for a push on `link`, and the joints that have one.

    Args:
        robot: floating, with apparatuses.
        q: (nq,) posture.
        link: that carries the push.
        virtual: rows for apparatus forces (3Ñ), else for rotor thrusts (n).

    Raises:
        DescriptionError: no such link.
    """
    loads = joint_loads(robot, q, link)
    kept = np.flatnonzero(np.isfinite(loads.limit) & (loads.limit > 0.0))
    columns = 3 * robot.gimbals.limit.size
    rows = loads.forces.reshape(len(loads.limit), columns) if virtual else loads.rotors
    bounds = Bounds(rows[kept], loads.bias[kept], loads.disturbance[kept], loads.limit[kept])
    return bounds, [loads.names[i] for i in kept]


def push_margins(
    robot: Robot,
    q: Floats,
    a: Allocation,
    link: str,
    found: VectoredMargins | ThrustMargins,
    tolerance: float,
) -> PushMargins:
    """Returns the push margins of one mode.

    Args:
        robot: floating, with apparatuses.
        q: (nq,) posture, gimbals as they hover.
        a: allocation at q.
        link: that carries the push.
        found: exact margins within thrust limits: vectored for virtual-single-rotor mode, of
            rotors for dual-rotor mode.
        tolerance: relative gap of the certified margins.
    """
    if isinstance(found, VectoredMargins):
        return PushMargins(link, _virtual(robot, q, a, link, found, tolerance))
    return PushMargins(link, _dual(robot, q, a, link, found, tolerance))


def followed(robot: Robot, q: Floats, found: PushMargins, allocator: str) -> PushMargins:
    """Returns the margins with `PushMargin.followed` of the constrained allocator's predictions.

    The exact margins take thrust points and centre of gravity at the hover's gimbal angles. The
    constrained allocator's gimbals turn by up to a radian before a push is lost, and what they
    carry with them changes the limit by up to 11 %. The pseudo-inverse meets its first limit
    before they have turned far: its closed form is left as it is.

    Args:
        robot, q, found: of virtual-single-rotor mode.
        allocator: ``paper`` or ``constrained``.
    """
    if allocator != "constrained":
        return found
    kinds = {}
    for kind, margins in found.kinds.items():
        key, margin = found.prediction(kind, allocator)
        kinds[kind] = dict(margins)
        if 0.0 < margin.value < np.inf:
            body = vectored_body(robot, q, np.array(margin.push), found.link)
            t = largest_push(body, margin.value).t
            kinds[kind][key] = replace(margin, followed=t if np.isfinite(t) else None)
    return replace(found, kinds=kinds)


def _virtual(
    robot: Robot, q: Floats, a: Allocation, link: str, found: VectoredMargins, tolerance: float
) -> dict[str, dict[str, PushMargin]]:
    """Returns force and torque margins of virtual-single-rotor mode."""
    limit = robot.gimbals.limit
    bounds, joints = servo_bounds(robot, q, link, True)
    labels = list(robot.apparatus_names)
    given: dict[str, Any] = {"drag": a.drag} | _scale(robot)
    points = (a.thrust_points, limit, a.hover_wrench)
    sets, given = found.sets, given | {"sets": found.sets}
    weights = np.where(limit > 0.0, limit, 0.0)
    free = vectored_controller(*points, weights=weights, **given)
    out = {}
    limited = None
    if joints:
        by_force = replace(bounds, rows=bounds.rows.reshape(len(joints), -1, 3))
        limited = sets_joint_limited(
            sets, a.hover_wrench, by_force, tolerance=tolerance, **_scale(robot)
        )
    held = vectored_controller(*points, weights=weights, bounds=bounds, **given)
    for kind in ("force", "torque"):
        full, _ = found.saturated(kind)
        low, high = (float(x) for x in getattr(found, f"{kind}_bounds"))
        push = tuple(float(-x) for x in found.worst(kind))
        mine = {"exact_thrust": PushMargin(low, (low, high), push, _named(labels, full))}
        if limited is not None:
            mine["exact_servo"] = _limited(limited, kind, mine["exact_thrust"], joints)
        mine["pseudo_inverse_thrust"] = allocator_margin(free.slices[kind], labels)
        if joints:
            mine["pseudo_inverse_servo"] = allocator_margin(held.slices[kind], labels + joints)
        out[kind] = mine
    return out


def _dual(
    robot: Robot, q: Floats, a: Allocation, link: str, found: ThrustMargins, tolerance: float
) -> dict[str, dict[str, PushMargin]]:
    """Returns the margins over [f_z; τ] of dual-rotor mode."""
    kind, rotors = "attitude_altitude", robot.rotors
    bounds, joints = servo_bounds(robot, q, link, False)
    labels = [r.label for m in robot.modules.apparatuses for r in m.rotors]
    scale: dict[str, Any] = _scale(robot)
    given = (a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench)
    value = float(found.attitude_altitude)
    value = value if value >= 0.0 else float("nan")
    push = tuple(float(-x) for x in found.worst(kind))
    full, idle = found.saturated(kind)
    mine = {"exact_thrust": PushMargin(value, (value, value), push, _named(labels, full + idle))}
    if joints:
        (low, high), e, stopped = truncated_joint_limited(
            *given, bounds, tolerance=tolerance, **scale
        )
        unit = np.repeat([robot.force_scale, robot.torque_scale], 3)
        weakest = tuple(float(-x) for x in np.r_[0.0, 0.0, e] * unit)
        limited = PushMargin(
            float(low), (float(low), float(high)), weakest, _named(joints, stopped)
        )
        mine["exact_servo"] = _smaller(limited, mine["exact_thrust"])
    free = truncated_controller(*given, **scale)
    mine["pseudo_inverse_thrust"] = allocator_margin(free, labels)
    if joints:
        held = truncated_controller(*given, bounds=bounds, **scale)
        mine["pseudo_inverse_servo"] = allocator_margin(held, labels + joints)
    return {kind: mine}


def _limited(
    found: JointLimitedMargins, kind: str, free: PushMargin, joints: list[str]
) -> PushMargin:
    """Returns the exact margin of a kind within servo limits; `free` where no servo limits it."""
    low, high = (float(x) for x in getattr(found, f"{kind}_bounds"))
    e = getattr(found, f"{kind}_direction")
    push = np.r_[-e, np.zeros(3)] if kind == "force" else np.r_[np.zeros(3), -e]
    stopped = _named(joints, getattr(found, f"{kind}_joints"))
    limited = PushMargin(low, (low, high), tuple(float(x) for x in push), stopped)
    return _smaller(limited, free)


def _smaller(limited: PushMargin, free: PushMargin) -> PushMargin:
    """Returns the margin within servo limits, `free` where that is none; names what limits it."""
    if not free.value > 0.0:
        return free
    if limited.bounds[1] >= free.bounds[0] * (1.0 - 1e-6):  # no servo limits it
        return replace(limited, push=free.push, at_limit=free.at_limit)
    return limited


def allocator_margin(found: AllocatorMargin, labels: list[str]) -> PushMargin:
    """Returns the margin of an allocator; `labels` name its rotors or apparatuses, then joints."""
    at = () if found.limiting < 0 else (labels[found.limiting],)
    push = tuple(float(x) for x in found.push)
    return PushMargin(found.value, (found.value, found.value), push, at)


def _scale(robot: Robot) -> dict[str, float]:
    return {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}


def _named(labels: list[str], which: list[int]) -> tuple[str, ...]:
    return tuple(labels[i] for i in which)
