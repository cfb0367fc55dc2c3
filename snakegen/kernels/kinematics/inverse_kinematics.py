"""Steps of inverse kinematics of a redundant chain (what ZS24 eqs 4-5 are meant to do).

Eq 4's left inverse ``(VᵀV)⁻¹Vᵀ`` does not exist for more than six joints: VᵀV is n x n and has rank
6 at most. A redundant chain has a right inverse ``Jᵀ(JJᵀ)⁻¹``, and a null space to spend; where the
rank drops the right inverse is damped, so rates stay finite and the path is left instead.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.core.types import Floats

Flags = NDArray[np.bool_]


class Step(NamedTuple):
    """A joint displacement that answers a task displacement.

    Fields:
        joints: (n,) rad (m where a joint slides).
        rank: of the task Jacobian over joints that are not held at a limit.
        sigma: (k,) its singular values, largest first.
        held: (n,) bool, joints stopped at a limit.
        damping: λ used; 0 far from singular postures.
    """

    joints: Floats
    rank: int
    sigma: Floats
    held: Flags
    damping: float


def damped_right_inverse(
    J: Floats, floor: float, most: float, rank_tolerance: float = 1e-6
) -> tuple[Floats, Floats, int, float]:
    """Returns ``Jᵀ(JJᵀ + λ²E)⁻¹`` with λ > 0 only near a loss of rank.

    ``λ² = most² (1 - (σ_min/floor)²)`` below `floor`, else 0: exact where the posture is regular.

    Args:
        J: (k, n), k ≤ n as a rule.
        floor: σ_min below which damping sets in, in J's unit.
        most: λ at σ_min = 0, same unit.
        rank_tolerance: of σ_1.

    Returns:
        inverse (n, k), singular values (k,), rank, λ.
    """
    u, s, vt = np.linalg.svd(J, full_matrices=False)
    least = s[-1] if len(s) == len(J) else 0.0
    damping = most * np.sqrt(max(0.0, 1.0 - (least / floor) ** 2)) if floor > 0 else 0.0
    rank = int(np.sum(s > rank_tolerance * max(s[0], 1e-300)))
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = np.where(s > 0, s / (s * s + damping * damping), 0.0)
    return np.asarray((vt.T * gains) @ u.T), np.asarray(s, np.float64), rank, float(damping)


def limited_step(
    J: Floats,
    wanted: Floats,
    preferred: Floats,
    below: Floats,
    above: Floats,
    floor: float,
    most: float,
) -> Step:
    """Returns the joint step ``J⁺ Δx + (E - J⁺J) Δq_0`` inside the room that the limits leave.

    A joint that would pass a limit is stopped there and the others make up for it; the preferred
    motion is added afterwards, as far as room is left: redundancy serves limits first.

    Args:
        J: (k, n) task Jacobian.
        wanted: (k,) task displacement Δx.
        preferred: (n,) joint displacement Δq_0 that is taken as far as the task leaves it free.
        below, above: (n,) room to the limits, below ≤ 0 ≤ above.
        floor, most: damping, as in `damped_right_inverse`.
    """
    n = J.shape[1]
    free, fixed = np.ones(n, bool), np.zeros(n)
    while True:
        inverse, sigma, rank, damping = damped_right_inverse(J * free, floor, most)
        step = np.where(free, inverse @ (wanted - J @ fixed), fixed)
        over = free & ((step < below - 1e-12) | (step > above + 1e-12))
        if not np.any(over):
            break
        # The worst offender only: stopping one often brings the others back.
        excess = np.where(over, np.maximum(step - above, below - step), -np.inf)
        i = int(np.argmax(excess))
        free[i] = False
        fixed[i] = above[i] if step[i] > above[i] else below[i]
    step = np.clip(step, below, above)
    if np.any(preferred):
        step = step + _spare_motion(J, preferred, free, below - step, above - step)
    return Step(np.clip(step, below, above), rank, sigma, ~free, damping)


def _spare_motion(
    J: Floats, preferred: Floats, free: Flags, below: Floats, above: Floats
) -> Floats:
    """Returns the part of the preferred motion that moves no task, no joint past its limit."""
    while True:
        held = J * free
        masked = preferred * free
        move = free * (masked - np.linalg.pinv(held, rcond=1e-6) @ (held @ masked))
        stuck = free & (((above <= 1e-12) & (move > 1e-15)) | ((below >= -1e-12) & (move < -1e-15)))
        if not np.any(stuck):
            break
        free = free & ~stuck
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(move > 0, above / move, np.where(move < 0, below / move, np.inf))
    return np.asarray(min(1.0, float(np.min(room))) * move)
