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

from snakegen.control import fully_actuated, underactuated
from snakegen.control.controller import Controller, ControlRefused
from snakegen.control.frame import CogFrame, cog_frame
from snakegen.control.gains import Floats
from snakegen.kernels.control_types import DUAL, VIRTUAL
from snakegen.kernels.fully_actuated import confinement, point_map
from snakegen.kernels.mode_allocation import DUAL_SIGMA_MIN
from snakegen.kernels.vectoring import joint_order


@dataclass(frozen=True, eq=False)
class SwitchCheck:
    """Whether a mode can hold a posture in hover.

    Attributes:
        allowed: True if it can.
        sigma_min: scaled, of J_w (virtual) or Q_trunc (dual), at its hover gimbals.
        threshold: what `sigma_min` is compared with.
        saturated: True when hover itself needs more thrust than there is.
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
        most, least = controller.gimbals.limit, np.zeros(controller.apparatuses)
        reach = force_sigma_min(controller, frame, a.gimbals)
    else:
        threshold = DUAL_SIGMA_MIN
        target = frame.axes
        turns = underactuated.gimbals_for(controller, frame, np.zeros(3), target, last)
        a = underactuated.allocate(controller, frame, frame.hover_wrench, turns, target, force=True)
        most, least = controller.rotors.thrust_max, controller.rotors.thrust_min
    saturated = bool(np.any(a.thrust > most + 1e-9) or np.any(a.thrust < least - 1e-9))
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


def out_of_grip(controller: Controller, reach: float) -> str:
    """Returns why forces of σ_min `reach` at the thrust points fly no body, and what would."""
    mended = "bend the body so that they do not stand in a line"
    if controller.apparatuses < 3:
        mended = "give it three apparatuses or more"
    if len(controller.rotors.body) > controller.apparatuses > 1:
        mended += ", or fly it in dual-rotor mode (control.mode=dual_rotor)"
    return (
        f"scaled σ_min(Q_force) = {round(reach, 9):.2g} at the thrust points is below "
        f"{controller.law.sigma_min:g}: forces there hardly turn the body about one axis, if at "
        f"all; {mended}."
    )


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
    name, map_name = {
        DUAL: ("dual-rotor mode", "Q_trunc"),
        VIRTUAL: ("virtual-single-rotor mode", "J_w"),
    }[mode]
    if check.saturated:
        raise ControlRefused(f"{name} refused: hover would need thrusts beyond their limits.")
    if check.sigma_min >= check.threshold:
        raise ControlRefused(f"{name} refused: {out_of_grip(controller, check.map_sigma_min)}")
    raise ControlRefused(
        f"{name} refused: scaled σ_min({map_name}) = {check.sigma_min:.2g} is below "
        f"{check.threshold:g} in this posture."
    )


def hover_gimbals(controller: Controller, angles: Any, rotation: Any = None) -> Floats:
    """Returns gimbals (Ñ, 2) [rad] that make every thrust vertical at a posture."""
    frame = cog_frame(controller, angles, rotation)
    return underactuated.gimbals_for(controller, frame, np.zeros(3), frame.axes)
