"""The printed allocator's answer brought within limits, internal forces eased in (eqs 29-47)."""

from snakegen.kernels.allocation.ball_allocation import least_forces_into
from snakegen.kernels.allocation.confinement import confinement_into
from snakegen.kernels.allocation.fully_actuated import forces_into, wrench_into
from snakegen.kernels.allocation.gimbal_limits import (
    CALMLY,
    LEAST,
    NEAR,
    bounded_forces,
    turning_map_into,
)
from snakegen.kernels.allocation.types import Limits, Previous, Task, VirtualAnswer
from snakegen.kernels.control.types import Law
from snakegen.kernels.core.mat3 import turn_back_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Body, Floats, Mechanism
from snakegen.kernels.dynamics.joint_loads import JointLoads, force_loads_into, overloaded

LIMIT_SLACK = 1e-9  # N and rad, by which an answer may pass a limit unnoticed


@bare(no_cpython_wrapper=True)
def bounded_answer(
    m: Floats,
    task: Task,
    limits: Limits,
    last: Previous,
    beyond: bool,
    loads: JointLoads,
    share: Floats,
    answer: VirtualAnswer,
) -> None:
    """Holds an answer of `least_answer` within limits, and writes the wrench (6,) within limits.

    The constrained allocator takes over where the printed one passes a limit; elsewhere both give
    the least-norm answer. Angles are in joint order; `loads` bounds forces in CoG axes.

    At a limit the bounded answer moves forces ten times as far as the pseudo-inverse for the same
    change of wrench, farther than motors and gimbals follow inside the attitude loop, which then
    swings up. So what sets it apart from the pseudo-inverse, forces against one another that add
    nothing to the wrench, is eased in, and the pseudo-inverse meets the wrench beside them.

    Args:
        m: (Ñ, 10, 3) from `mounts`.
        task, limits, last: as `bounded_forces`.
        beyond: whether the answer on entry passes a limit.
        loads: bounds of the joints.
        share: (2,) of the way to the internal forces wanted now; 1 goes there at once.
        answer: thrust and angles to bound; its internal forces, for the joints' limits, then for
            thrusts' and gimbals' too, are of the tick before on entry, NaN for none as yet.
    """
    n, thrust, angles = limits.thrust.shape[0], answer.thrust, answer.angles
    goal, forces = scratch(3 * n), scratch(3 * n)
    for c in range(3 * n):
        goal[c] = 0.0
    forces_into(m, thrust, angles, forces)
    wanted = beyond or overloaded(loads, forces)
    for near in range(CALMLY + 1):  # one call of what is long to compile
        if near != LEAST:
            apart = ease(m, goal, share[near - NEAR], answer.internal[near - NEAR], forces)
            wanted = apart > LIMIT_SLACK
        if wanted:
            bounded_forces(m, task, limits, last, loads, forces, near, thrust, angles)
            if near != CALMLY:
                apart_from_least_into(m, task, limits.thrust, thrust, angles, goal)
        if near == NEAR:
            wrench_into(m, thrust, angles, answer.reached)


@bare
def apart_from_least_into(
    m: Floats, task: Task, limit: Floats, thrust: Floats, angles: Floats, out: Floats
) -> None:
    """Writes what an answer's forces (3Ñ,), CoG axes, have beyond the pseudo-inverse's."""
    n = limit.shape[0]
    allowed, q, least = scratch((n, 3, 3)), scratch((6, 3 * n)), scratch(3 * n)
    confinement_into(m, angles, allowed)
    forces_into(m, thrust, angles, out)
    turning_map_into(m, angles, out, allowed, q)
    least_forces_into(q, task.wrench, task.rows, limit, least)
    for c in range(3 * n):
        out[c] -= least[c]


@bare
def ease(m: Floats, goal: Floats, share: float, now: Floats, out: Floats) -> float:
    """Moves forces (Ñ, 3), link axes, `share` of the way to `goal`, and writes them in CoG axes.

    Returns how far [N] they still are from it. A body that bends carries them along.

    Args:
        m: (Ñ, 10, 3) from `vectoring.mounts`.
        goal: (3Ñ,) N, CoG axes.
        share: 0 … 1.
        now: (Ñ, 3) N, link axes, moved; NaN takes the goal.
        out: (3Ñ,) N, CoG axes.
    """
    apart, wanted = 0.0, scratch(3)
    for j in range(now.shape[0]):
        turn_back_into(m[j], goal[3 * j : 3 * j + 3], wanted)
        for k in range(3):
            gap = now[j, k] - wanted[k]
            left = (1.0 - share) * gap if gap == gap else 0.0
            now[j, k] = wanted[k] + left
            apart = max(apart, abs(left))
        turn_into(m[j], now[j], out[3 * j : 3 * j + 3])
    return apart


@bare(no_cpython_wrapper=True)
def keep_limits(
    mechanism: Mechanism,
    law: Law,
    body: Body,
    m: Floats,
    task: Task,
    limits: Limits,
    last: Previous,
    beyond: bool,
    dt: float,
    answer: VirtualAnswer,
) -> None:
    """Brings an answer of `least_answer` within limits, joints' too: see `bounded_answer`."""
    k, share = law.joints.shape[0], scratch(2)
    loads = JointLoads(scratch((k, 3 * m.shape[0])), scratch(k), law.joint_limit)
    force_loads_into(
        mechanism.tree, mechanism.gimbals, body, m, last.angles, law.gravity, law.joints,
        loads.rows, loads.bias,
    )  # fmt: skip
    for i in range(k):
        loads.bias[i] += last.external[i]
    for i in range(2):
        share[i] = dt / (dt + law.internal_time[i])
    bounded_answer(m, task, limits, last, beyond, loads, share, answer)
