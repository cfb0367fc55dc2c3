"""The printed allocator's answer brought within limits, internal forces eased in (eqs 29-47)."""

import numpy as np

from snakegen.kernels.balls import least_forces
from snakegen.kernels.confined import CALMLY, LEAST, NEAR, bounded_forces
from snakegen.kernels.control_types import Body, Law
from snakegen.kernels.fully_actuated import confinement, forces_of, point_map, wrench_into
from snakegen.kernels.jit import jit
from snakegen.kernels.joint_loads import JointLoads, force_loads, overloaded
from snakegen.kernels.linear import turn_back_into, turn_into
from snakegen.kernels.tree import Floats, Gimbals, Tree

LIMIT_SLACK = 1e-9  # N and rad, by which an answer may pass a limit unnoticed
ROUNDS = 20  # of bounded allocation and aiming


@jit
def bounded_answer(
    m: Floats,
    limit: Floats,
    wrench: Floats,
    rows: Floats,
    last: Floats,
    lower: Floats,
    upper: Floats,
    beyond: bool,
    loads: JointLoads,
    share: Floats,
    thrust: Floats,
    angles: Floats,
    internal: Floats,
    reached: Floats,
) -> None:
    """Holds an answer of `least_answer` within limits, and writes the wrench (6,) within reach.

    The constrained allocator takes over where the printed one passes a limit; elsewhere both give
    the least-norm answer. Angles are in joint order; `loads` bounds forces in CoG axes.

    At a limit the bounded answer moves forces ten times as far as the pseudo-inverse for the same
    change of wrench, farther than motors and gimbals follow inside the attitude loop, which then
    swings up. So what sets it apart from the pseudo-inverse, forces against one another that add
    nothing to the wrench, is eased in, and the pseudo-inverse meets the wrench beside them.

    Args:
        beyond: of the answer on entry.
        share: (2,) of the way to the internal forces wanted now; 1 goes there at once.
        thrust, angles: (Ñ,) and (Ñ, 2), the answer.
        internal: (2, Ñ, 3) N, link axes, those forces: for the joints' limits, then for thrusts'
            and gimbals' too; of the tick before on entry, NaN for none as yet.
        reached: (6,)
    """
    n = limit.shape[0]
    goal = np.zeros(3 * n)
    best, turns = thrust.copy(), angles.copy()
    if beyond or overloaded(loads, forces_of(m, thrust, angles)):
        best, turns = bounded_forces(
            m, wrench, rows, limit, lower, upper, last, ROUNDS, loads, goal, LEAST
        )
        goal = apart_from_least(m, wrench, rows, limit, best, turns)
    kept = np.empty_like(internal)
    apart = eased(m, goal, internal[0], share[0], kept[0])
    if apart > LIMIT_SLACK:
        best, turns = bounded_forces(
            m, wrench, rows, limit, lower, upper, last, ROUNDS, loads, in_cog_axes(m, kept[0]), NEAR
        )
        goal = apart_from_least(m, wrench, rows, limit, best, turns)
    wrench_into(m, best, turns, reached)
    apart = eased(m, goal, internal[1], share[1], kept[1])
    if apart > LIMIT_SLACK:
        best, turns = bounded_forces(
            m,
            wrench,
            rows,
            limit,
            lower,
            upper,
            last,
            ROUNDS,
            loads,
            in_cog_axes(m, kept[1]),
            CALMLY,
        )
    thrust[:], angles[:], internal[:] = best, turns, kept


@jit
def apart_from_least(
    m: Floats, wrench: Floats, rows: Floats, limit: Floats, thrust: Floats, angles: Floats
) -> Floats:
    """Returns what an answer's forces (3Ñ,), CoG axes, have beyond the pseudo-inverse's."""
    q = point_map(m, angles, confinement(m, angles))
    return forces_of(m, thrust, angles) - least_forces(q, wrench, rows, limit)


@jit
def eased(m: Floats, goal: Floats, now: Floats, share: float, out: Floats) -> float:
    """Writes forces (Ñ, 3), link axes, `share` of the way from `now` to `goal` into `out`.

    Returns how far [N] they still are from it. A body that bends carries them along.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`.
        goal: (3Ñ,) N, CoG axes.
        now: (Ñ, 3) N, link axes; NaN takes the goal.
        share: 0 … 1.
        out: (Ñ, 3) N, link axes.
    """
    apart = 0.0
    for j in range(now.shape[0]):
        turn_back_into(m[j], goal[3 * j : 3 * j + 3], out[j])
        for k in range(3):
            gap = now[j, k] - out[j, k]
            if gap == gap:
                out[j, k] += (1.0 - share) * gap
                apart = max(apart, abs((1.0 - share) * gap))
    return apart


@jit
def in_cog_axes(m: Floats, forces: Floats) -> Floats:
    """Returns forces (3Ñ,) in CoG axes of forces (Ñ, 3) in link axes."""
    out = np.empty(forces.size)
    for j in range(forces.shape[0]):
        turn_into(m[j], forces[j], out[3 * j : 3 * j + 3])
    return out


@jit
def keep_limits(
    tree: Tree,
    gimbals: Gimbals,
    law: Law,
    body: Body,
    m: Floats,
    wrench: Floats,
    rows: Floats,
    last: Floats,
    lower: Floats,
    upper: Floats,
    beyond: bool,
    dt: float,
    pushes: Floats,
    angles: Floats,
    internal: Floats,
    reached: Floats,
) -> None:
    """Brings an answer of `least_answer` within limits, joints' too: see `bounded_answer`."""
    held_up = force_loads(
        tree,
        gimbals,
        m,
        last,
        body.rotation,
        body.position,
        body.cog,
        body.axes,
        law.gravity,
        law.joints,
        law.joint_limit,
    )
    bounded_answer(
        m,
        gimbals.limit,
        wrench,
        rows,
        last,
        lower,
        upper,
        beyond,
        held_up,
        dt / (dt + law.internal_time),
        pushes,
        angles,
        internal,
        reached,
    )
