"""Certified margins of vectored apparatuses (virtual-single-rotor mode), THEORY A4."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels import shoot, vectored
from snakegen.margins import inputs, sector
from snakegen.margins.wrench_search import refine, restrict

Floats = NDArray[np.float64]
NAMES = ("wrench", "force", "torque")
STARTS = 16  # of the wrench search, where the caller does not say


@dataclass(frozen=True)
class VectoredMargins:
    """Margins of one posture, or of m postures (then every array has m in front).

    Attributes:
        bounds: (3, 2) lower and upper bound of `wrench`, `force`, `torque` (see the properties);
            with `hull` they bound the convex hull's margin, and the lower ones are nan.
        rank: rank of S Q_force diag(L), tolerance 1e-6 σ₁.
        twists: (3, 6) directions (linear; angular, scaled) at which the upper bounds are
            reached; the lost direction where a margin is 0 for lack of rank.
        calls: (2,) support calls that the force and the torque search took.
        tolerance: asked relative gap ``(upper - lower)/upper``.
        hull: True where gimbal limits or a minimum thrust make the set non-convex: every margin
            is then that of its convex hull, an **upper bound** of the true one.
        points, limits, drag, hover_wrench, scale: what was asked, as arrays.
    """

    bounds: Floats
    rank: NDArray[np.int64]
    twists: Floats
    calls: NDArray[np.int64]
    tolerance: float
    hull: bool
    points: Floats
    limits: Floats
    drag: Floats
    hover_wrench: Floats
    scale: Floats

    @property
    def wrench(self) -> Floats:
        """Radius of the ball round hover, scaled: the least found; minus the distance outside."""
        return self.bounds[..., 0, 1]

    @property
    def force(self) -> Floats:
        """Largest force ball with torque held, N: the upper bound; nan where infeasible."""
        return self.bounds[..., 1, 1]

    @property
    def torque(self) -> Floats:
        """Largest torque ball with force held, N·m: the upper bound; nan where infeasible."""
        return self.bounds[..., 2, 1]

    @property
    def wrench_bounds(self) -> Floats:
        """(…, 2) certified lower and upper bound of `wrench`."""
        return self.bounds[..., 0, :]

    @property
    def force_bounds(self) -> Floats:
        """(…, 2) certified lower and upper bound of `force`, N."""
        return self.bounds[..., 1, :]

    @property
    def torque_bounds(self) -> Floats:
        """(…, 2) certified lower and upper bound of `torque`, N·m."""
        return self.bounds[..., 2, :]

    @property
    def attitude_altitude(self) -> Floats:
        """nan: the margin of under-actuated models is not defined for vectored sets."""
        return np.full(self.wrench.shape, np.nan)[()]

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether some forces within the limits give the hover wrench."""
        return self.wrench >= 0.0

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Whether the force and torque bounds agree to the asked tolerance."""
        low, high = self.bounds[..., 1:, 0], self.bounds[..., 1:, 1]
        met = (high - low <= self.tolerance * high) | (high == 0.0)
        return (met.all(axis=-1) | ~self.feasible) & (not self.hull)

    @cached_property
    def singular_values(self) -> Floats:
        """Singular values of S Q_force diag(L), largest first."""
        values = [
            np.linalg.svd(vectored.columns(p, self.limits / self.scale[0]), compute_uv=False)
            for p in _stack(self.points, self.drag, self.scale)
        ]
        return np.array(values).reshape(*self.points.shape[:-2], -1)

    def __len__(self) -> int:
        if self.points.ndim == 2:
            raise TypeError("margins of one posture have no length")
        return len(self.points)

    def __getitem__(self, posture: int) -> "VectoredMargins":
        """Returns the margins of one posture of a batch."""
        if self.points.ndim == 2:
            raise TypeError("margins of one posture cannot be indexed")
        at = int(posture)
        return VectoredMargins(
            self.bounds[at],
            self.rank[at],
            self.twists[at],
            self.calls[at],
            self.tolerance,
            self.hull,
            self.points[at],
            self.limits,
            self.drag,
            self.hover_wrench[at],
            self.scale,
        )

    def directional(self, u: ArrayLike) -> Floats:
        """Returns the largest t with ``hover_wrench + t u`` within reach (proved from below).

        Args:
            u: (6,) wrench, N and N·m; need not be a unit vector.

        Returns:
            t, one for each posture; 0 along a lost direction, nan where hover is infeasible.

        Raises:
            AnalysisError: `u` is zero, not finite or of another shape; or a hull was asked.
        """
        direction = inputs.array("u", u, (6,)) / self.scale
        if not direction.any():
            raise AnalysisError("u is zero: a direction needs a length.")
        if self.hull:
            raise AnalysisError("directional() is for sets without gimbal limits or minimum.")
        force = self.scale[0]
        hover = (self.hover_wrench / self.scale).reshape(-1, 6)
        stack = _stack(self.points, self.drag, self.scale)
        feasible = np.reshape(self.feasible, -1)
        out = np.full(len(stack), np.nan)
        for i in np.flatnonzero(feasible):
            lost = vectored.subspace(
                vectored.columns(stack[i], self.limits / force), vectored.RANK_TOLERANCE
            )[1]
            if np.abs(lost.T @ direction).max(initial=0.0) > 1e-9 * np.linalg.norm(direction):
                out[i] = 0.0
                continue
            twist = np.empty(6)
            low, _ = shoot.shoot(direction, stack[i], self.limits / force, hover[i], twist)
            out[i] = max(low, 0.0)
        return out if self.points.ndim == 3 else out[0]

    def worst(self, margin: str) -> Floats:
        """Returns the direction (…, 6) in which `margin` is reached: a wrench, N and N·m.

        Scaled length 1 for ``wrench``, 1 N or 1 N·m for the slices; a direction that no force
        can move along where rank is lacking; nan where the margin is undefined.
        """
        twist = self.twists[..., _index(margin), :].copy()
        if margin == "force":
            twist[..., 3:] = 0.0
        elif margin == "torque":
            twist[..., :3] = 0.0
        with np.errstate(invalid="ignore", divide="ignore"):
            unit = twist / np.linalg.norm(twist, axis=-1, keepdims=True)
        return unit if margin in ("force", "torque") else unit * self.scale

    def saturated(self, margin: str) -> tuple[list[int], list[int]]:
        """Returns the apparatuses at their limit and those with room where `margin` is reached.

        One posture only (index a batch first). An apparatus has room where the worst twist does
        no work on its force (without drag: it lies on the axis), which then only balances the
        others. Both are empty where a
        direction is lost: then no limit is what stops the robot.
        """
        if self.points.ndim == 3:
            raise AnalysisError("saturated() takes one posture: index the batch first.")
        at = _index(margin)
        twist = self.twists[at]
        if self.bounds[at, 1] == 0.0 or not np.isfinite(twist).all():
            return [], []
        placed = _stack(self.points, self.drag, self.scale)[0]
        speed = twist[:3] + np.cross(twist[3:], placed[:, :3]) + placed[:, 3:] * twist[3:]
        speeds = np.linalg.norm(speed, axis=1)
        full = (speeds > 1e-6 * speeds.max(initial=0.0)) & (self.limits > 0.0)
        return np.flatnonzero(full).tolist(), np.flatnonzero(~full & (self.limits > 0)).tolist()


def _stack(points: Floats, drag: Floats, scale: Floats) -> Floats:
    """Returns (m, n, 4): points of application and drags, scaled, as the kernels take them."""
    out = np.empty((points.size // (3 * drag.size) if drag.size else 1, drag.size, 4))
    out[..., :3], out[..., 3] = points.reshape(-1, drag.size, 3), drag
    out *= scale[0] / scale[3]
    return out


def _index(margin: str) -> int:
    if margin not in NAMES:
        raise AnalysisError(f"there is no margin {margin!r}; there are {', '.join(NAMES)}.")
    return NAMES.index(margin)


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
    wrench_starts: int | None = None,
) -> VectoredMargins:
    """Returns certified margins of ``W = {Σ (f_j, p_j × f_j + c_j f_j), ‖f_j‖ ≤ L_j}`` round hover.

    Its support is ``h(v, ω) = Σ L_j ‖v + ω × p_j + c_j ω‖``; force and torque margins are inner
    radii of slices, bracketed by a polytope of attained points and by support planes. `wrench` is
    the best of a search from many starts, with ``a b/√(a² + b²)`` of the slices below it.

    Args:
        points: p, (n, 3), or (m, n, 3) for a batch: points of application from the CoG, m, at
            the posture's gimbal angles.
        limits: L, largest force of each apparatus, N, one number or (n,).
        hover_wrench: w0 = ``[m g Rᵀẑ; 0]``, (6,) or (m, 6), N and N·m.
        force_scale, torque_scale: F0 = m g, N, and T0 = m g · link length, N·m.
        tolerance: relative gap (upper - lower)/upper at which a search counts as closed.
        drag: c, m, one number or (n,): torque on the body along each force per newton, -κ s for a
            single rotor, the mean of its rotors' for an apparatus; 0 for a counter-rotating pair.
        minimum: smallest force of each apparatus, N, one number or (n,).
        gimbal_limits: largest |φ| and |θ|, rad, (2,) or (n, 2). With these or a minimum above 0
            the set is non-convex: `hull` is set and every margin is its hull's, an upper bound.
        rotations: (n, 3, 3) link axes in CoG axes, in which gimbal limits hold; one posture only.
        wrench_starts: starts of the wrench search; by default 16 for one posture and 0 for a
            batch, where `wrench` is the least of the slices' twists.

    Raises:
        AnalysisError: NaN, infinite entries, wrong shapes, negative limits.

    Source: THEORY A2 (drag), A4; ZN23 eqs 34–36.
    """
    p = inputs.array("points", points, (None, 3), (None, None, 3))
    limit = inputs.per_unit("limits", limits, p.shape[-2])
    spin = inputs.drags(drag, p.shape[-2])
    hover = inputs.hover(hover_wrench, len(p) if p.ndim == 3 else None)
    scale = inputs.scale(force_scale, torque_scale)
    inputs.positive("tolerance", tolerance)
    starts = wrench_starts if wrench_starts is not None else (STARTS if p.ndim == 2 else 0)
    live = limit > 0.0
    stack = np.ascontiguousarray(_stack(p, spin, scale)[:, live])
    wrenches, m = np.ascontiguousarray((hover / scale).reshape(-1, 6)), len(stack)
    bounds, twists = np.empty((m, 3, 2)), np.empty((m, 3, 6))
    rank, calls = np.empty(m, np.int64), np.empty((m, 2), np.int64)
    strength = limit[live] / scale[0]
    vectored.batch(stack, strength, wrenches, tolerance, bounds, twists, rank, calls)
    for i in np.flatnonzero((bounds[:, 0, 1] < 0.0) | (starts > 0)):
        refine(stack[i], strength, wrenches[i], bounds[i], twists[i], int(rank[i]), starts)
    low, gimbal, turn = sector.checked(p.shape[-2], minimum, limit, gimbal_limits, rotations)
    hull = gimbal_limits is not None or bool(low.any())
    if hull:
        bounds[..., 0] = np.nan
    if gimbal_limits is not None:
        if p.ndim == 3:
            raise AnalysisError("gimbal_limits are for one posture at a time: rotations differ.")
        restrict(
            sector.hull_bounds(
                stack[0, :, :3],
                strength,
                wrenches[0],
                tolerance,
                low[live] / scale[0],
                gimbal[live],
                turn[live],
                stack[0, :, 3],
            ),
            bounds[0],
            twists[0],
        )
    bounds[:, 1] *= scale[0]
    bounds[:, 2] *= scale[3]
    if p.ndim == 2:
        bounds, rank, twists, calls = bounds[0], rank[0], twists[0], calls[0]
    return VectoredMargins(
        bounds, rank, twists, calls, tolerance, hull, p, limit, spin, hover, scale
    )
