"""Certified margins of vectored apparatuses as a result: bounds, twists, directions, limits."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.margins.limited_margins import span_columns
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.limited import ray_bounds

Floats = NDArray[np.float64]
NAMES = ("wrench", "force", "torque")


@dataclass(frozen=True, repr=False)
class VectoredMargins:
    """Margins of one posture, or of m postures (then every array has m in front).

    Attributes:
        bounds: (3, 2) certified lower and upper bound of `wrench`, `force`, `torque`; `wrench` is
            negative, and the others nan, where hover is out of reach. Where the sets are not
            convex the upper bounds are those of their hulls, the lower ones those of convex
            pieces, and hover within the hull that no pieces hold has a negative lower `wrench`.
        rank: of S Q_force over the span of the sets, scaled by limits; tolerance 1e-6 σ₁.
        twists: (3, 6) directions (linear; angular, scaled) at which the upper bounds are
            reached; the lost direction where a margin is 0 for lack of rank.
        calls: (2,) support calls that the force and the torque search took.
        tolerance: asked relative gap ``(upper - lower)/upper``.
        sets: what the apparatuses push with.
        hover_wrench, scale: what was asked, as arrays.
    """

    bounds: Floats
    rank: NDArray[np.int64]
    twists: Floats
    calls: NDArray[np.int64]
    tolerance: float
    sets: ForceSets
    hover_wrench: Floats
    scale: Floats

    def __repr__(self) -> str:
        """Returns the margins in one line; of a batch, how many postures there are."""
        return inputs.margins_text("VectoredMargins", self.wrench, self.force, self.torque)

    @property
    def points(self) -> Floats:
        """(n, 3) m, where the forces act."""
        return self.sets.points

    @property
    def limits(self) -> Floats:
        """(n,) N, largest force of each apparatus."""
        return self.sets.strengths

    @property
    def hull(self) -> bool:
        """True where some set is not convex: upper bounds are then those of the sets' hulls."""
        return not bool(self.sets.convex.all())

    @property
    def wrench(self) -> Floats:
        """Radius of the ball round hover, scaled: the lower bound; minus the distance outside."""
        return self.bounds[..., 0, 0]

    @property
    def force(self) -> Floats:
        """Largest force ball with torque held, N: the lower bound; nan where infeasible."""
        return self.bounds[..., 1, 0]

    @property
    def torque(self) -> Floats:
        """Largest torque ball with force held, N·m: the lower bound; nan where infeasible."""
        return self.bounds[..., 2, 0]

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
        """Whether forces of the sets were found that give the hover wrench."""
        return self.wrench >= 0.0

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Whether force and torque bounds agree to the tolerance, or hover is out of reach."""
        low, high = self.bounds[..., 1:, 0], self.bounds[..., 1:, 1]
        met = (high - low <= self.tolerance * high) | (high == 0.0)
        return met.all(axis=-1) | (self.bounds[..., 0, 1] < 0.0)

    @cached_property
    def singular_values(self) -> Floats:
        """Singular values of S Q_force over the sets' spans, scaled by limits, largest first."""
        hull, spans = self.sets.hull((self.scale[0], self.scale[3])), self.sets.spans
        values = [
            np.linalg.svd(
                span_columns(hull._replace(points=p, frames=turn), spans), compute_uv=False
            )
            for p, turn in zip(*self.sets.stacked(self.scale), strict=True)
        ]
        return np.array(values).reshape(*self.sets.points.shape[:-2], -1)

    def __len__(self) -> int:
        if self.sets.points.ndim == 2:
            raise TypeError("margins of one posture have no length")
        return len(self.sets.points)

    def __getitem__(self, posture: int) -> "VectoredMargins":
        """Returns the margins of one posture of a batch."""
        if self.sets.points.ndim == 2:
            raise TypeError("margins of one posture cannot be indexed")
        at = int(posture)
        return VectoredMargins(
            self.bounds[at],
            self.rank[at],
            self.twists[at],
            self.calls[at],
            self.tolerance,
            self.sets.posture(at),
            self.hover_wrench[at],
            self.scale,
        )

    def directional(self, u: ArrayLike) -> Floats:
        """Returns the largest t with ``hover_wrench + t u`` within reach: the lower bound.

        Args:
            u: (6,) wrench, N and N·m; need not be a unit vector.

        Returns:
            t, one for each posture; 0 along a lost direction, nan where hover is infeasible.

        Raises:
            AnalysisError: `u` is zero, not finite or of another shape.
        """
        return self.directional_bounds(u)[..., 0]

    def directional_bounds(self, u: ArrayLike) -> Floats:
        """Returns (…, 2) lower and upper bound of `directional`."""
        direction = inputs.array("u", u, (6,)) / self.scale
        if not direction.any():
            raise AnalysisError("u is zero: a direction needs a length.")
        hover = (self.hover_wrench / self.scale).reshape(-1, 6)
        feasible = np.reshape(self.feasible, -1)
        out = np.full((len(hover), 2), np.nan)
        for i in np.flatnonzero(feasible):
            sets = self.sets if self.sets.points.ndim == 2 else self.sets.posture(int(i))
            out[i] = ray_bounds(sets, direction, hover[i], self.scale, self.tolerance)
        return out if self.sets.points.ndim == 3 else out[0]

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
        others, or pulls it back to its least thrust. Both are empty where a direction is lost:
        then no limit is what stops the robot.
        """
        if self.sets.points.ndim == 3:
            raise AnalysisError("saturated() takes one posture: index the batch first.")
        at = _index(margin)
        twist = self.twists[at]
        if self.bounds[at, 1] == 0.0 or not np.isfinite(twist).all():
            return [], []
        placed = self.sets.stacked(self.scale)[0][0]
        speed = twist[:3] + np.cross(twist[3:], placed[:, :3]) + placed[:, 3:] * twist[3:]
        work = [d @ self.sets.strongest(j, d) for j, d in enumerate(speed)]
        able = self.sets.strengths > 0.0
        full = (np.array(work) > 1e-6 * max(work, default=0.0)) & able
        return np.flatnonzero(full).tolist(), np.flatnonzero(~full & able).tolist()


def _index(margin: str) -> int:
    if margin not in NAMES:
        raise AnalysisError(f"there is no margin {margin!r}; there are {', '.join(NAMES)}.")
    return NAMES.index(margin)
