"""Dual-rotor allocation with gimbal-servo compliance: unequal thrusts deflect the gimbal.

A servo stands off its command by its load over its stiffness. A hundredth of a radian tilts m g by
as much torque as rotor drag has to give about yaw, so an allocator that plans with the commanded
angles stops short of what the robot can hold, by a fifth and more, with the wrong rotors at their
limits.
"""

import numpy as np

from snakegen.kernels.allocation.dual_rotor import dual_answer
from snakegen.kernels.allocation.gimbals import swing_into, turned_into
from snakegen.kernels.allocation.types import RotorBounds
from snakegen.kernels.allocation.underactuated import rotor_map_into, truncated_into
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, dot, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats

ROUNDS = 4  # of allocation; the map changes by some per cent, so each round gains two digits
MOVED = 1e-3  # share of a thrust limit that ends the rounds


@bare
def twists_into(
    m: Floats, rotor: Floats, angles: Floats, give: Floats, turn: Floats, slope: Floats
) -> None:
    """Writes what a newton of each rotor does to its gimbals, and what a turn does to a newton.

    Args:
        m, rotor: from `vectoring.mounts`.
        angles: (Ñ, 2) rad, joint order.
        give: (Ñ, 2) rad/(N·m), joint order: 1 over the servos' stiffness.
        turn: (n, 2) rad/N, ``give a · ((p - o) × u + c u)`` about the two gimbal joints.
        slope: (n, 2, 6) ∂q/∂x, N and N·m per newton and radian.
    """
    u, p, axis, arm = scratch(3), scratch(3), scratch(3), scratch(3)
    du, dp, a, b = scratch(3), scratch(3), scratch(3), scratch(3)
    once, twice, elbow = scratch((3, 3)), scratch((3, 3)), scratch(3)
    for r in range(rotor.shape[0]):
        j, ratio = int(rotor[r, 2, 1]), rotor[r, 2, 0]
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        turn_into(twice, rotor[r, 1], u)
        turn_into(twice, rotor[r, 0], p)
        for k in range(3):
            p[k] += elbow[k]
        for kind in range(2):
            swing_into(m, j, kind, (once, elbow), u, p, axis, arm, du, dp)
            cross_into(arm, u, a)
            turn[r, kind] = give[j, kind] * (dot(axis, a) + ratio * dot(axis, u))
            cross_into(dp, u, a)
            cross_into(p, du, b)
            for k in range(3):
                slope[r, kind, k] = du[k]
                slope[r, kind, 3 + k] = a[k] + b[k] + ratio * du[k]


@jit
def twists(m: Floats, rotor: Floats, angles: Floats, give: Floats) -> tuple[Floats, Floats]:
    """Returns turn (n, 2) and slope (n, 2, 6) of `twists_into`."""
    turn, slope = np.empty((rotor.shape[0], 2)), np.empty((rotor.shape[0], 2, 6))
    twists_into(m, rotor, angles, give, turn, slope)
    return turn, slope


@bare
def twisted_into(rotor: Floats, angles: Floats, turn: Floats, thrust: Floats, out: Floats) -> None:
    """Writes the angles (Ñ, 2) at which gimbals stand under thrusts (n,)."""
    for j in range(angles.shape[0]):
        for kind in range(2):
            out[j, kind] = angles[j, kind]
    for r in range(thrust.shape[0]):
        j = int(rotor[r, 2, 1])
        for kind in range(2):
            out[j, kind] += turn[r, kind] * thrust[r]


@bare
def yielding_map_into(
    rotor: Floats, turn: Floats, slope: Floats, thrust: Floats, full: Floats
) -> None:
    """Adds the twist to a map (6, n): ``∂w/∂λ_r = q_r + Σ_s λ_s (∂q_s/∂x)(∂x/∂λ_r)``.

    The sum is over the rotors s of the same gimbals as r.
    """
    for r in range(thrust.shape[0]):
        for s in range(thrust.shape[0]):
            if int(rotor[r, 2, 1]) != int(rotor[s, 2, 1]):
                continue
            for kind in range(2):
                for k in range(6):
                    full[k, r] += thrust[s] * slope[s, kind, k] * turn[r, kind]


@bare
def yielding_answer(
    m: Floats,
    rotor: Floats,
    angles: Floats,
    give: Floats,
    tilt: Floats,
    wanted: Floats,
    rows: Floats,
    bounds: RotorBounds,
    thrust: Floats,
    stands: Floats,
) -> float:
    """Writes thrusts (n,) within limits for ``[f_z; τ]`` as the gimbals will stand; returns σ_min.

    Rounds of ``J λ = w - w(λ_k) + J λ_k``, J the map with the gimbals' twist in it.

    Args:
        m, rotor, angles, give: as `twists_into`.
        tilt: (3, 3) of the target, see `truncated_into`.
        wanted: (4,) ``[f_z; τ]``.
        rows: (4,) their scale.
        bounds: of thrusts and joints.
        thrust: (n,) N.
        stands: (Ñ, 2) rad, joint order, where the gimbals will stand.
    """
    n = rotor.shape[0]
    full, q, bent, goal = scratch((6, n)), scratch((4, n)), scratch((4, n)), scratch(4)
    turn, slope = scratch((n, 2)), scratch((n, 2, 6))
    drawn, before = scratch((n, 2)), scratch(n)
    rotor_map_into(m, rotor, angles, full)
    truncated_into(full, tilt, q)
    sigma = dual_answer(q, wanted, rows, bounds, thrust)
    twists_into(m, rotor, angles, give, turn, slope)
    for _ in range(ROUNDS):
        twisted_into(rotor, angles, turn, thrust, stands)
        twists_into(m, rotor, stands, give, drawn, slope)
        rotor_map_into(m, rotor, stands, full)
        truncated_into(full, tilt, q)
        yielding_map_into(rotor, turn, slope, thrust, full)
        truncated_into(full, tilt, bent)
        for k in range(4):
            goal[k] = wanted[k]
            for r in range(n):
                goal[k] += (bent[k, r] - q[k, r]) * thrust[r]
        for r in range(n):
            before[r] = thrust[r]
        dual_answer(bent, goal, rows, bounds, thrust)
        moved = 0.0
        for r in range(n):
            moved = max(moved, abs(thrust[r] - before[r]) / max(bounds.most[r], 1e-9))
        if moved < MOVED:
            break
    twisted_into(rotor, angles, turn, thrust, stands)
    return sigma


@jit
def yielding_thrusts(
    m: Floats,
    rotor: Floats,
    angles: Floats,
    give: Floats,
    tilt: Floats,
    wanted: Floats,
    rows: Floats,
    bounds: RotorBounds,
) -> tuple[Floats, Floats, float]:
    """Returns thrusts (n,), angles (Ñ, 2) and σ_min of `yielding_answer`."""
    thrust, stands = np.empty(rotor.shape[0]), np.empty(angles.shape)
    sigma = yielding_answer(m, rotor, angles, give, tilt, wanted, rows, bounds, thrust, stands)
    return thrust, stands, sigma
