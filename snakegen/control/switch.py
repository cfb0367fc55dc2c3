"""Change between dual-rotor and virtual-single-rotor mode, which ZN23 leaves as future work.

The tick blends thrusts and gimbals over `law.blend_time` along ``3 s² - 2 s³`` and corrects the
thrusts so that ``[f_z; τ]`` is met throughout. Before that a rank test says whether the mode to
come can hold the posture at all.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.control import fully_actuated, underactuated
from snakegen.control.controller import Controller, ControlRefused
from snakegen.control.frame import cog_frame
from snakegen.control.gains import Floats
from snakegen.kernels.control_types import DUAL, VIRTUAL
from snakegen.kernels.mode_allocation import DUAL_SIGMA_MIN


@dataclass(frozen=True, eq=False)
class SwitchCheck:
    """Whether a mode can hold a posture in hover.

    Attributes:
        allowed: True if it can.
        sigma_min: scaled, of J_w (virtual) or Q_trunc (dual), at its hover gimbals.
        threshold: what `sigma_min` is compared with.
        saturated: True when hover itself needs more thrust than there is.
    """

    allowed: bool
    sigma_min: float
    threshold: float
    saturated: bool


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
    if mode == VIRTUAL:
        threshold = controller.law.sigma_min
        a = fully_actuated.allocate(controller, frame, frame.hover_wrench, last, force=True)
        most, least = controller.gimbals.limit, np.zeros(controller.apparatuses)
    else:
        threshold = DUAL_SIGMA_MIN
        target = frame.axes
        turns = underactuated.gimbals_for(controller, frame, np.zeros(3), target, last)
        a = underactuated.allocate(controller, frame, frame.hover_wrench, turns, target, force=True)
        most, least = controller.rotors.thrust_max, controller.rotors.thrust_min
    saturated = bool(np.any(a.thrust > most + 1e-9) or np.any(a.thrust < least - 1e-9))
    allowed = a.sigma_min >= threshold and not saturated
    return SwitchCheck(allowed, a.sigma_min, threshold, saturated)


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
    raise ControlRefused(
        f"{name} refused: scaled σ_min({map_name}) = {check.sigma_min:.2g} is below "
        f"{check.threshold:g} in this posture."
    )


def hover_gimbals(controller: Controller, angles: Any, rotation: Any = None) -> Floats:
    """Returns gimbals (Ñ, 2) [rad] that make every thrust vertical at a posture."""
    frame = cog_frame(controller, angles, rotation)
    return underactuated.gimbals_for(controller, frame, np.zeros(3), frame.axes)
