"""Why rotors with held gimbals leave altitude or attitude without control, in one clause."""

from collections.abc import Callable

import numpy as np

from snakegen.base.describe_motion import body_axis, motions
from snakegen.base.geometry import Floats
from snakegen.kernels.allocation.mode_blending import DUAL_SIGMA_MIN
from snakegen.kernels.core.types import Rotors

_ASSUMED_DRAG = 0.015  # m, with which rotors without a drag ratio are tried


def dual_loss(
    dual: Floats, rotors: Rotors, *, up: Floats, length: float, weight: float, least: float
) -> str:
    """Returns the motions of [f_z; τ] that no rotor thrust works on, and the reason.

    A reason that names drag or spins is given only where the rank, computed again with other
    drag ratios or spins, is full.

    Args:
        dual: (6, n) rotor thrusts to wrench about the CoG.
        rotors: their limits, drag and apparatuses.
        up: (3,) unit, vertical in the axes of `dual`.
        length: m, lever of the torque scale.
        weight: N, the force scale.
        least: scaled σ_min of [f_z; τ] below which a motion counts as lost.

    Returns:
        One clause, as in ``no thrust works on yaw: every drag ratio is 0``; "" if nothing is lost.
    """
    size = np.array([1.0, *np.full(3, 1.0 / length)]) / weight
    limits = np.maximum(np.abs(rotors.thrust_min), np.abs(rotors.thrust_max))
    axes, drag = dual[:3].T, rotors.torque_ratio
    arms = dual[3:].T - drag[:, None] * axes  # p × u

    def lost(ratios: Floats) -> Floats:
        torque = arms + ratios[:, None] * axes
        matrix = size[:, None] * np.vstack([axes @ up, torque.T]) * limits
        left, sigma, _ = np.linalg.svd(matrix)
        strength = np.zeros(4)
        strength[: len(sigma)] = sigma
        return np.asarray(size[:, None] * left[:, strength < least])

    none = lost(drag)
    if none.shape[1] == 0:
        return ""
    points = np.cross(axes, arms)  # where the thrust lines pass the CoG
    names = "; ".join(motions(np.vstack([np.outer(up, none[0]), none[1:]]), length, points))
    return f"no thrust works on {names}{_reason(lost, points, rotors)}"


def frame_loss(
    dual: Floats, rotors: Rotors, scale: Floats, tilt: Floats, least: float = DUAL_SIGMA_MIN
) -> str:
    """Returns `dual_loss` in the CoG frame of a controller, whose scale (6,) and tilt it has."""
    length = float(scale[0] / scale[3])
    return dual_loss(
        dual, rotors, up=tilt[2], length=length, weight=float(1.0 / scale[0]), least=least
    )


def _reason(lost: Callable[[Floats], Floats], points: Floats, rotors: Rotors) -> str:
    """Returns the reason as a clause with its colon; "" where none of the known ones holds."""
    count, drag, apparatus = len(points), rotors.torque_ratio, rotors.apparatus
    if count < 4:
        have = "1 rotor sets" if count == 1 else f"{count} rotors set"
        return f": {have} at most {count} of the four that altitude and attitude need"
    place = np.array([int(np.sum(apparatus[:k] == a)) for k, a in enumerate(apparatus)])
    within, between = 1.0 - 2.0 * (place % 2), 1.0 - 2.0 * (apparatus % 2)
    sizes: Floats = np.abs(drag) if np.any(drag) else np.full(count, _ASSUMED_DRAG)
    if any(lost(sizes * spins).shape[1] == 0 for spins in (between * within, between)):
        if not np.any(drag):
            return ": every drag ratio κ is 0; yaw needs κ ≠ 0 and spins that alternate"
        return ": its torque is that of another motion; spins that alternate would part the two"
    if body_axis(points) is not None:
        return ": all rotors are on one line, seen along the thrust; bend the body"
    return ""
