"""Change between dual-rotor and virtual-single-rotor mode, which ZN23 leaves as future work.

The tick blends thrusts and gimbals over `law.blend_time` along ``3 s² - 2 s³`` and corrects the
thrusts so that ``[f_z; τ]`` is met throughout. Before that a rank test says whether the mode to
come can hold the posture at all.

In virtual-single-rotor mode J_w alone does not say so: with an offset o it reaches rank 6 through
∂p/∂φ, which moves thrust points a few centimetres and no further, while forces at the points
(eq 34) leave an axis without torque. Two apparatuses always do, and bodies in a line.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.describe_motion import body_axis, motions
from snakegen.control import fully_actuated, underactuated
from snakegen.control.controller import Controller, ControlRefused
from snakegen.control.dual_allocation import level_axes, rotor_map
from snakegen.control.frame import CogFrame, cog_frame
from snakegen.control.gains import Floats
from snakegen.control.lost_motion import frame_loss
from snakegen.control.vectored_allocation import confinement, point_map
from snakegen.kernels.allocation.mode_blending import DUAL_SIGMA_MIN
from snakegen.kernels.control.types import DUAL, VIRTUAL
from snakegen.robot.gimbal_geometry import joint_order, thrust_line

UNMET = 1e-3  # of the weight, and of it times a link's length: a hover's residual


@dataclass(frozen=True, eq=False)
class SwitchCheck:
    """Whether a mode can hold a posture in hover.

    Attributes:
        allowed: True if it can.
        sigma_min: scaled, of J_w (virtual) or Q_trunc (dual), at its hover gimbals.
        threshold: what `sigma_min` is compared with.
        saturated: True when hover itself needs thrusts or gimbal angles beyond their limits.
        map_sigma_min: scaled, of Q_force at the thrust points (virtual); NaN in dual-rotor mode.
    """

    allowed: bool
    sigma_min: float
    threshold: float
    saturated: bool
    map_sigma_min: float = float("nan")


def check_mode(
    controller: Controller, mode: int, angles: Any, rotation: Any = None, last: Any = None
) -> SwitchCheck:
    """Returns the rank test of `mode` at a posture.

    Args:
        controller: the controller.
        mode: VIRTUAL or DUAL.
        angles: (n-1,) rad, every joint of the tree.
        rotation: (3, 3) attitude of body 0; level if not given.
        last: (Ñ, 2) rad, gimbals now.
    """
    frame = cog_frame(controller, angles, rotation)
    reach = float("nan")
    if mode == VIRTUAL:
        threshold = controller.law.sigma_min
        a = fully_actuated.allocate(controller, frame, frame.hover_wrench, last, force=True)
        most, rotors = controller.gimbals.limit, controller.rotors
        least = np.zeros(controller.apparatuses)
        np.add.at(least, rotors.apparatus, rotors.thrust_min)
        reach = force_sigma_min(controller, frame, a.gimbals)
    else:
        threshold = DUAL_SIGMA_MIN
        target = frame.axes
        turns = underactuated.gimbals_for(controller, frame, np.zeros(3), target, last)
        a = underactuated.allocate(controller, frame, frame.hover_wrench, turns, target, force=True)
        most, least = controller.rotors.thrust_max, controller.rotors.thrust_min
    gap = (frame.scale * (a.given - frame.hover_wrench))[0 if mode == VIRTUAL else 2 :]
    saturated = bool(np.any(a.thrust > most + 1e-9) or np.any(a.thrust < least - 1e-9))
    saturated |= bool(np.linalg.norm(gap) > UNMET)
    low, high = controller.law.gimbal_lower, controller.law.gimbal_upper
    saturated |= bool(np.any(a.gimbals < low - 1e-6) or np.any(a.gimbals > high + 1e-6))
    allowed = a.sigma_min >= threshold and not saturated and not reach < threshold
    return SwitchCheck(allowed, a.sigma_min, threshold, saturated, reach)


def force_sigma_min(controller: Controller, frame: CogFrame, gimbals: Any) -> float:
    """Returns σ_min of ``S Q_force diag(λ_max)`` at the thrust points: eq 34, THEORY A3.

    Apparatuses with fewer than two gimbal axes count with the forces that they can turn to.

    Args:
        controller: limits.
        frame: the posture.
        gimbals: (Ñ, 2) rad, where the thrust points are taken.
    """
    m = frame.mounts
    angles = joint_order(m, np.array(gimbals, float))
    reach = point_map(m, angles, confinement(m, angles))
    reach = frame.scale[:, None] * reach * np.repeat(controller.gimbals.limit, 3)
    sigma = np.linalg.svd(reach, compute_uv=False)
    return float(sigma[5]) if len(sigma) > 5 else 0.0


def out_of_grip(controller: Controller, frame: CogFrame, gimbals: Any) -> str:
    """Returns the motions that forces at the thrust points hardly work on, and what would help.

    Arguments as in `force_sigma_min`.
    """
    m, limit = frame.mounts, controller.gimbals.limit
    angles = joint_order(m, np.array(gimbals, float))
    allowed = confinement(m, angles)
    reach = frame.scale[:, None] * point_map(m, angles, allowed) * np.repeat(limit, 3)
    left, sigma, _ = np.linalg.svd(reach)
    strength = np.zeros(6)
    strength[: len(sigma)] = sigma
    weak = strength < controller.law.sigma_min
    points = np.array([thrust_points(m, j, x) for j, x in enumerate(angles)])
    length = float(frame.scale[0] / frame.scale[3])
    names = "; ".join(motions(frame.scale[:, None] * left[:, weak], length, points))
    directions = int(round(float(np.trace(allowed, axis1=1, axis2=2).sum())))
    works = []
    if controller.apparatuses < 3:
        works.append("give it three apparatuses or more")
    elif directions < 6:
        works.append(f"its gimbals turn forces in {directions} directions, six are needed")
    elif body_axis(points) is not None:
        works.append("bend the body so that they do not stand in a line")
    if len(controller.rotors.body) > controller.apparatuses > 1:
        works.append("fly it in dual-rotor mode (control.mode=dual_rotor)")
    remedy = f"; {', or '.join(works)}" if works else ""
    return (
        f"scaled σ_min(Q_force) = {round(float(strength[5]), 9):.2g} at the thrust points is below "
        f"{controller.law.sigma_min:g}: forces there hardly work on {names}, if at all{remedy}."
    )


def thrust_points(m: Floats, j: int, angles: Floats) -> Floats:
    """Returns the thrust point (3,) [m] of apparatus j at angles (2,), joint order."""
    u, p = np.empty(3), np.empty(3)
    thrust_line(m, j, angles, u, p)
    return p


def require_mode(
    controller: Controller, mode: int, angles: Any, rotation: Any = None, last: Any = None
) -> SwitchCheck:
    """Returns `check_mode`'s answer when it allows the mode; arguments as there.

    Raises:
        ControlRefused: the mode cannot hold the posture, with the reason.
    """
    check = check_mode(controller, mode, angles, rotation, last)
    if check.allowed:
        return check
    name = {DUAL: "dual-rotor mode", VIRTUAL: "virtual-single-rotor mode"}[mode]
    why = _refusal(controller, mode, check, angles, rotation, last)
    raise ControlRefused(f"{name} refused: {why}.")


def mode_refusal(
    controller: Controller, mode: int, angles: Any, rotation: Any = None, last: Any = None
) -> str:
    """Returns why a mode cannot hold a posture, "" where it can; arguments as in `check_mode`."""
    check = check_mode(controller, mode, angles, rotation, last)
    return "" if check.allowed else _refusal(controller, mode, check, angles, rotation, last)


def _refusal(
    controller: Controller, mode: int, check: SwitchCheck, angles: Any, rotation: Any, last: Any
) -> str:
    """Returns the reason of a check that failed, without a full stop."""
    if mode == VIRTUAL and check.map_sigma_min < check.threshold:
        return _grip_loss(controller, angles, rotation, last)  # no answer beyond this one counts
    if check.sigma_min >= check.threshold:
        return "hover would need thrusts outside their limits"
    below = f"is below {check.threshold:g} in this posture"
    if mode == VIRTUAL:
        return f"scaled σ_min(J_w) = {check.sigma_min:.2g} {below}"
    frame = cog_frame(controller, angles, rotation)
    turns = underactuated.gimbals_for(controller, frame, np.zeros(3), frame.axes, last)
    full = rotor_map(frame.mounts, frame.rotors, joint_order(frame.mounts, turns))
    loss = frame_loss(full, controller.rotors, frame.scale, level_axes(frame.axes))
    why = f"; {loss}" if loss else ""
    return f"scaled σ_min(Q_trunc) = {check.sigma_min:.2g} {below}{why}"


def _grip_loss(controller: Controller, angles: Any, rotation: Any, last: Any) -> str:
    """Returns `out_of_grip` of a posture at its hover gimbals, without a full stop."""
    frame = cog_frame(controller, angles, rotation)
    a = fully_actuated.allocate(controller, frame, frame.hover_wrench, last, force=True)
    return out_of_grip(controller, frame, a.gimbals).rstrip(".")


def hover_gimbals(controller: Controller, angles: Any, rotation: Any = None) -> Floats:
    """Returns gimbals (Ñ, 2) [rad] that make every thrust vertical at a posture."""
    frame = cog_frame(controller, angles, rotation)
    return underactuated.gimbals_for(controller, frame, np.zeros(3), frame.axes)
