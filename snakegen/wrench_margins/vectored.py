"""Certified margins of vectored apparatuses (virtual-single-rotor mode), THEORY A4."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.plain_first import plain_first
from snakegen.errors import AnalysisError
from snakegen.kernels.margins import force_sets as kernel
from snakegen.kernels.margins import limited_margins, vectored
from snakegen.kernels.margins.set_distance import distance
from snakegen.kernels.margins.wrench_subspace import OFF
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.branching.directions import branch
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.limited import certify_wrench, refine_limited
from snakegen.wrench_margins.plain import ball_margins, ball_support
from snakegen.wrench_margins.plain.ball_certificate import certify_balls
from snakegen.wrench_margins.vectored_result import VectoredMargins
from snakegen.wrench_margins.wrench_search import refine

Floats = NDArray[np.float64]
SHARP = 0.1  # of the tolerance, at which balls are measured where the wrench is searched
FEW = 12  # postures of some 0.1 s each, before a kernel that takes 15 s to compile
FINEST = 1e-5  # that plain NumPy closes: it rounds norms by 1e-7
FEWER = 4  # certificates of up to a second each, before kernels that take 8 s
STARTS = 16  # of the wrench search, where the caller does not say


def vectored_margins(
    points: ArrayLike,
    limits: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
    drag: ArrayLike = 0.0,
    minimum: ArrayLike = 0.0,
    gimbal_limits: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
) -> VectoredMargins:
    """Returns certified margins of apparatuses that push within their gimbal and thrust limits.

    Args:
        points: p, (n, 3), or (m, n, 3) for a batch: points of application from the CoG, m, at
            the posture's gimbal angles.
        limits: L, N, largest force of each apparatus, one number or (n,).
        hover_wrench, force_scale, torque_scale, tolerance: as `set_margins`.
        drag: c, m, one number or (n,): torque on the body along each force per newton, -κ s for a
            single rotor, the mean of its rotors' for an apparatus; 0 for a counter-rotating pair.
        minimum: least force of each apparatus, N, one number or (n,); negative: reversible.
        gimbal_limits: largest |φ| and |θ|, rad, one number, (2,) or (n, 2); free if absent.
        rotations: (n, 3, 3), or (m, n, 3, 3), link axes in CoG axes, in which gimbal limits hold.

    Raises:
        AnalysisError: NaN, infinite entries, wrong shapes, negative limits, a minimum above its
            limit.

    Source: THEORY A2 (drag), A4; ZN23 eqs 34–36.
    """
    return set_margins(
        apparatus_sets(points, limits, drag, minimum, gimbal_limits, rotations),
        hover_wrench,
        force_scale=force_scale,
        torque_scale=torque_scale,
        tolerance=tolerance,
    )


def apparatus_sets(
    points: ArrayLike,
    limits: ArrayLike,
    drag: ArrayLike = 0.0,
    minimum: ArrayLike = 0.0,
    gimbal_limits: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
) -> ForceSets:
    """Returns the force sets of apparatuses; arguments and errors as of `vectored_margins`."""
    p = inputs.array("points", points, (None, 3), (None, None, 3))
    n = p.shape[-2]
    limit = inputs.per_unit("limits", limits, n)
    low = np.broadcast_to(inputs.array("minimum", minimum, (), (n,)), (n,))
    if (low > limit).any():
        at = int(np.argmax(low > limit))
        raise AnalysisError(f"minimum[{at}] = {low[at]:g} is above limits[{at}] = {limit[at]:g}.")
    given = np.pi if gimbal_limits is None else gimbal_limits
    angles = np.broadcast_to(inputs.array("gimbal_limits", given, (), (2,), (n, 2)), (n, 2))
    if (angles < 0.0).any():
        raise AnalysisError("gimbal_limits must not be negative: largest |φ| and |θ|, rad.")
    turn = np.broadcast_to(np.eye(3), (n, 3, 3)) if rotations is None else rotations
    phi, theta = (np.stack([-angles[:, k], angles[:, k]], axis=1) for k in range(2))
    return ForceSets.checked(p, turn, low, limit, phi, theta, drag)


@plain_first(vectored.batch, calls=FEW)
def one_posture(
    points: Floats,
    limit: Floats,
    hover: Floats,
    tolerance: float,
    bounds: Floats,
    directions: Floats,
    ranks: NDArray[np.int64],
    counts: NDArray[np.int64],
) -> None:
    """Fills what `kernels.margins.vectored.batch` fills, for one posture of ball sets."""
    bounds[0], directions[0], ranks[0], counts[0] = ball_margins.margins(
        points[0], limit, hover[0], tolerance
    )


@plain_first(certify_wrench, calls=FEWER)
def certify_one(
    hull: kernel.Sets, hover: Floats, bounds: Floats, twists: Floats, tolerance: float
) -> None:
    """Raises the lower bound of the wrench margin of ball sets, as `certify_wrench` does."""
    certify_balls(hull.points, hull.high, hover, bounds, twists, tolerance)


def set_margins(
    sets: ForceSets,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
    wrench_starts: int | None = None,
) -> VectoredMargins:
    """Returns certified margins of ``W = {Σ (f_j, p_j × f_j + c_j f_j), f_j ∈ S_j}`` round hover.

    With balls its support is ``h(v, ω) = Σ L_j ‖v + ω × p_j + c_j ω‖``; force and torque margins
    are inner radii of slices, bracketed by a polytope of attained points and by support planes.
    Other sets are bounded by their hulls from above and by convex pieces from below. `wrench` has
    ``a b/√(a² + b²)`` of the slices below it, in a batch, or a certificate over all directions,
    and the least of a search from many starts above.

    Args:
        sets: of one posture, or of a stack of m.
        hover_wrench: w0 = ``[m g Rᵀẑ; 0]``, (6,) or (m, 6), N and N·m.
        force_scale, torque_scale: F0 = m g, N, and T0 = m g · link length, N·m.
        tolerance: relative gap (upper - lower)/upper at which a search counts as closed.
        wrench_starts: starts of the wrench search; by default 16 for one posture and 0 for a
            batch, where the bound above is the least of the slices' twists.

    Raises:
        AnalysisError: NaN, infinite entries, wrong shapes.
    """
    one = sets.points.ndim == 2
    hover = inputs.hover(hover_wrench, None if one else len(sets.points))
    scale = inputs.scale(force_scale, torque_scale)
    inputs.positive("tolerance", tolerance)
    starts = wrench_starts if wrench_starts is not None else (STARTS if one else 0)
    placed, frames = sets.stacked(scale)
    hull = sets.hull((scale[0], scale[3]))
    wrenches, m = np.ascontiguousarray((hover / scale).reshape(-1, 6)), len(placed)
    bounds, twists = np.empty((m, 3, 2)), np.empty((m, 3, 6))
    rank, calls = np.empty(m, np.int64), np.empty((m, 2), np.int64)
    live = sets.strengths > 0.0
    if sets.balls[live].all():
        strength = sets.strengths[live] / scale[0]
        stack = np.ascontiguousarray(placed[:, live])
        fine = tolerance * (SHARP if starts > 0 else 1.0)
        measure = one_posture if one and fine >= FINEST else vectored.batch
        measure(stack, strength, wrenches, fine, bounds, twists, rank, calls)
        for i in np.flatnonzero((bounds[:, 1:] == 0.0).all(axis=(1, 2))):  # no slice has been tried
            here, apart = hull._replace(points=placed[i], frames=frames[i]), np.empty(6)
            if one:
                low, _, apart = ball_support.distance(stack[i], strength, wrenches[i])
            else:
                low, _ = distance(here, wrenches[i], apart)
            if low > OFF:
                bounds[i], bounds[i, 0], twists[i, 0] = np.nan, (-np.inf, -1.0), apart
        for i in np.flatnonzero((bounds[:, 0, 1] < 0.0) | (starts > 0)):
            refine(stack[i], strength, wrenches[i], bounds[i], twists[i], int(rank[i]), starts)
    else:
        limited_margins.batch(
            hull, placed, frames, sets.spans, wrenches, tolerance, bounds, twists, rank, calls
        )
        if one and bounds[0, 0, 1] > 0.0 and not sets.convex.all():
            branch(hull._replace(points=placed[0], frames=frames[0]), *wrenches, *bounds, *twists)
        for i in np.flatnonzero((bounds[:, 0, 1] > 0.0) & (starts > 0)):
            here = hull._replace(points=placed[i], frames=frames[i])
            refine_limited(here, wrenches[i], bounds[i], twists[i], tolerance, starts)
    for i in np.flatnonzero((bounds[:, 0, 0] >= 0.0) & (rank == 6) & (starts > 0)):
        here = hull._replace(points=placed[i], frames=frames[i])
        raise_bound = certify_one if sets.balls.all() else certify_wrench
        raise_bound(here, wrenches[i], bounds[i], twists[i], tolerance)
    bounds[:, 1] *= scale[0]
    bounds[:, 2] *= scale[3]
    if one:
        bounds, rank, twists, calls = bounds[0], rank[0], twists[0], calls[0]
    return VectoredMargins(bounds, rank, twists, calls, tolerance, sets, hover, scale)
