"""Joint-limited margins of apparatuses with limited force sets, bounded from both sides.

A slice's support with joint torques within limits is a linear program over mixtures of forces,
whose columns are found one by one: of the sets' hulls from above, of convex pieces from below.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.kernels.margins.force_sets import piece_support
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.inner_ball import inner_ball
from snakegen.wrench_margins.joint_limited import (
    FORCE,
    TORQUE,
    JointLimitedMargins,
    LimitedProblem,
    held_rows,
    joints_at_limit,
    limited_problem,
    vectored_joint_limited,
)
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.set_exits import pieces_near
from snakegen.wrench_margins.vectored import set_margins

Floats = NDArray[np.float64]
Farthest = Callable[[int, Floats], Floats]
ROUNDS, MOST = 60, 60  # of column generation; of directions
PENALTY = 1e3  # of a held row that no mixture gives


def sets_joint_limited(
    sets: ForceSets,
    hover_wrench: ArrayLike,
    bounds: Bounds,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
) -> JointLimitedMargins:
    """Returns margins with joint torques within limits; the lower bounds hold for the sets.

    Args:
        sets: of one posture.
        hover_wrench, force_scale, torque_scale, tolerance: as `set_margins`.
        bounds: as `vectored_joint_limited`.

    Raises:
        AnalysisError: as `set_margins`; joint arrays of other shapes; a limit that is 0.
    """
    if sets.balls.all():
        return vectored_joint_limited(
            sets.points,
            sets.strengths,
            hover_wrench,
            bounds,
            force_scale=force_scale,
            torque_scale=torque_scale,
            tolerance=tolerance,
            drag=sets.drag,
        )
    n = len(sets)
    hover, scale = inputs.hover(hover_wrench, None), inputs.scale(force_scale, torque_scale)
    m = inputs.array("joint_torque", bounds.rows, (None, n, 3))
    q = inputs.force_map(sets.points, sets.drag)
    problem = limited_problem(q, hover, scale, m.reshape(len(m), -1), bounds)
    convex = pieces_near(sets, np.tile(hover[:3], (n, 1)))

    def piece(j: int, d: Floats) -> Floats:
        out = np.empty(3)
        piece_support(j, np.ascontiguousarray(d), convex, out)
        return out

    free = set_margins(
        sets, hover, force_scale=force_scale, torque_scale=torque_scale, wrench_starts=0
    )
    found: list[tuple[Floats, Floats, list[int]]] = []
    for part, ends in ((FORCE, free.force_bounds), (TORQUE, free.torque_bounds)):
        unit = scale[part][0]
        known = ends / unit
        if np.isnan(known).any() or known[1] == 0.0:
            found.append((ends.copy(), np.full(3, np.nan), []))
            continue

        def support(e: Floats, part: slice = part) -> tuple[float, Floats]:
            above, forces = _support(problem, e, part, n, piece)
            return above, (problem.map @ forces - problem.hover)[part]

        low, high, e = inner_ball(support, max(tolerance, 5e-3), MOST)
        above, forces = _support(problem, e, part, n, sets.strongest)
        both = np.array([min(np.fmax(low, 0.0), known[0]), min(above, known[1])])
        if above < 0.0:
            both = np.full(2, np.nan)
        elif high < 0.0:  # the pieces do not hold hover within the joints' limits, the hulls may
            both[0] = 0.0
        found.append((both * unit, e, joints_at_limit(problem, forces)))
    (force, along, bent), (turn, about, twisted) = found
    known = float(free.force), float(free.torque)
    return JointLimitedMargins(force, turn, along, about, bent, twisted, *known, tolerance)


def _support(
    problem: LimitedProblem, e: Floats, part: slice, n: int, farthest: Farthest
) -> tuple[float, Floats]:
    """Returns an upper bound of the slice's support along e, and forces (3n,) that near it."""
    from scipy.optimize import linprog

    held, k = held_rows(part), len(problem.limit)
    columns = [farthest(j, problem.hover[:3]) for j in range(n)]
    owner, above = list(range(n)), np.inf
    forces = np.zeros(3 * n)
    for _ in range(ROUNDS):
        whole = np.zeros((3 * n, len(owner)))
        for c, (j, f) in enumerate(zip(owner, columns, strict=True)):
            whole[3 * j : 3 * j + 3, c] = f
        maps, rows = problem.map @ whole, problem.rows @ whole
        loose = np.hstack([np.eye(3), -np.eye(3)])
        mixture = np.array([[float(j == o) for o in owner] for j in range(n)])
        found = linprog(
            np.r_[-(e @ maps[part]), np.full(6, PENALTY)],
            A_ub=np.block([[rows, np.zeros((k, 6))], [-rows, np.zeros((k, 6))]]),
            b_ub=np.r_[problem.limit - problem.bias, problem.limit + problem.bias],
            A_eq=np.block([[maps[held], loose], [mixture, np.zeros((n, 6))]]),
            b_eq=np.r_[problem.hover[held], np.ones(n)],
        )
        if found.x is None:  # these forces overload a joint in any mixture
            return -np.inf, forces
        z, mu = found.eqlin.marginals[:3], found.ineqlin.marginals
        cost = np.zeros(3 * n) + e @ problem.map[part]
        cost += z @ problem.map[held] - (mu[k:] - mu[:k]) @ problem.rows
        forces = whole @ found.x[: len(owner)]
        best = [farthest(j, cost[3 * j : 3 * j + 3]) for j in range(n)]
        value = sum(cost[3 * j : 3 * j + 3] @ f for j, f in enumerate(best))
        bound = value - z @ problem.hover[held] - e @ problem.hover[part]
        bound -= mu @ np.r_[problem.limit - problem.bias, problem.limit + problem.bias]
        above = min(above, float(bound))
        if above - (-found.fun - e @ problem.hover[part]) <= 1e-4 * abs(above) or above < 0.0:
            break
        owner += list(range(n))
        columns += best
    return above, forces
