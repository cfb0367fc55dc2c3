"""Exact margins of a set of fixed rotors (dual-rotor mode): zonotope facets, THEORY A4."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.margins import zonotope as kernel
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.plain import zonotope

Floats = NDArray[np.float64]
NAMES = ("wrench", "force", "torque", "attitude_altitude")
SATURATED = 1e-9  # a rotor whose product with the facet normal is below this share is free
TIED = 1e-9  # of h(d): a hover this near to the middle is as far from the opposite facet


@dataclass(frozen=True, repr=False)
class ThrustMargins:
    """Margins of one posture, or of m postures (then every array has m in front).

    Attributes:
        wrench: radius of the largest ball round hover, scaled; minus the distance to the set
            where hover is infeasible; 0 where the set is flat.
        force: largest force ball with torque held, N; nan where hover is infeasible.
        torque: largest torque ball with force held, N·m; nan where hover is infeasible.
        attitude_altitude: the wrench ball of the rows ``[f_z; τ]`` alone, scaled and signed.
        rank: dimensions of the set (the rank of S Q diag(upper - lower), tolerance 1e-6 σ₁).
        normals: (4, 6) in the order of `NAMES`: facet normals, scaled, at which each margin is
            reached; the lost direction where the margin is 0 for lack of rank.
        allocation, lower, upper, hover_wrench, scale: what was asked, as arrays.
    """

    wrench: Floats
    force: Floats
    torque: Floats
    attitude_altitude: Floats
    rank: NDArray[np.int64]
    normals: Floats
    allocation: Floats
    lower: Floats
    upper: Floats
    hover_wrench: Floats
    scale: Floats

    def __repr__(self) -> str:
        """Returns the margins in one line; of a batch, how many postures there are."""
        return inputs.margins_text("ThrustMargins", self.wrench, self.force, self.torque)

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether some thrust within the limits gives the hover wrench."""
        return self.wrench >= 0.0

    @cached_property
    def singular_values(self) -> Floats:
        """Singular values of the scaled matrix S Q diag(upper), largest first."""
        scaled = self.allocation * self.upper / self.scale[:, None]
        return np.asarray(np.linalg.svd(scaled, compute_uv=False), np.float64)

    def __len__(self) -> int:
        if self.allocation.ndim == 2:
            raise TypeError("margins of one posture have no length")
        return len(self.allocation)

    def __getitem__(self, posture: int) -> "ThrustMargins":
        """Returns the margins of one posture of a batch."""
        if self.allocation.ndim == 2:
            raise TypeError("margins of one posture cannot be indexed")
        at = int(posture)
        return ThrustMargins(
            self.wrench[at],
            self.force[at],
            self.torque[at],
            self.attitude_altitude[at],
            self.rank[at],
            self.normals[at],
            self.allocation[at],
            self.lower,
            self.upper,
            self.hover_wrench[at],
            self.scale,
        )

    def directional(self, u: ArrayLike) -> Floats:
        """Returns the largest t with ``hover_wrench + t u`` within reach.

        Args:
            u: (6,) wrench, N and N·m; need not be a unit vector.

        Returns:
            t, one for each posture; 0 along a lost direction, nan where the line through hover
            along u misses the set.

        Raises:
            AnalysisError: `u` is zero, not finite or of another shape.
        """
        direction = inputs.array("u", u, (6,))
        if not direction.any():
            raise AnalysisError("u is zero: a direction needs a length.")
        stack = (
            np.atleast_3d(self.allocation) if self.allocation.ndim == 3 else self.allocation[None]
        )
        hover = self.hover_wrench.reshape(-1, 6)
        live = self.upper > self.lower
        half, middle = 0.5 * (self.upper - self.lower), 0.5 * (self.upper + self.lower)
        out = np.empty(len(stack))
        for i, (q, w) in enumerate(zip(stack, hover, strict=True)):
            fixed = w - q[:, ~live] @ middle[~live]
            columns = np.ascontiguousarray(q[:, live])
            out[i] = kernel.along(
                columns, half[live], middle[live], fixed, self.scale, direction / self.scale
            )
        # where hover is within reach so is t = 0, whatever rounding says
        out = np.where(np.reshape(self.feasible, -1), np.maximum(out, 0.0), out)
        return out if self.allocation.ndim == 3 else out[0]

    def worst(self, margin: str) -> Floats:
        """Returns the direction (…, 6) in which `margin` is reached: a wrench, N and N·m.

        Scaled length 1 for ``wrench`` and ``attitude_altitude``, 1 N or 1 N·m for the slices;
        where hover is infeasible, the direction from the set to the hover wrench; where rank is
        lacking, a direction that no thrust can move along. nan where the margin is undefined.
        """
        normal = self._normal(margin) * _shown(margin)
        with np.errstate(invalid="ignore", divide="ignore"):
            unit = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        unit = np.where(np.abs(unit) < 1e-12, 0.0, unit)  # rounding, which would read as a part
        return unit if margin in ("force", "torque") else unit * self.scale

    def _normal(self, margin: str) -> Floats:
        """Returns the normals (…, 6), where d and -d tie the one that `worst` shows as positive."""
        normal = self.normals[..., _index(margin), :]
        middle = 0.5 * (self.upper + self.lower)
        spread = 0.5 * (self.upper - self.lower)
        product = np.einsum("...i,...ij->...j", normal / self.scale, self.allocation)
        along = np.sum(normal * self.hover_wrench / self.scale, axis=-1) - product @ middle
        tied = np.abs(along) <= TIED * (np.abs(product) @ spread + np.linalg.norm(normal, axis=-1))
        size = np.abs(normal) * _shown(margin)
        first = np.argmax(size > 1e-6 * size.max(axis=-1, keepdims=True), axis=-1)
        sign = np.sign(np.take_along_axis(normal, first[..., None], axis=-1))
        return np.asarray(np.where(tied[..., None] & (sign < 0), -normal, normal), np.float64)

    def saturated(self, margin: str) -> tuple[list[int], list[int]]:
        """Returns the rotors at their upper and at their lower limit where `margin` is reached.

        One posture only (index a batch first). Rotors in neither list are free there; both are
        empty where a direction is lost: then no limit is what stops the robot.
        """
        if self.allocation.ndim == 3:
            raise AnalysisError("saturated() takes one posture: index the batch first.")
        product = (self._normal(margin) / self.scale) @ self.allocation
        product = product * (self.upper - self.lower)
        size = np.abs(product).max(initial=0.0)
        free = SATURATED * np.linalg.norm(self.allocation / self.scale[:, None]) * self.upper.max()
        if size <= free:
            return [], []
        at_upper, at_lower = product > SATURATED * size, product < -SATURATED * size
        return np.flatnonzero(at_upper).tolist(), np.flatnonzero(at_lower).tolist()


def _shown(margin: str) -> Floats:
    return np.repeat([margin != "torque", margin != "force"], 3).astype(np.float64)


def _index(margin: str) -> int:
    if margin not in NAMES:
        raise AnalysisError(f"there is no margin {margin!r}; there are {', '.join(NAMES)}.")
    return NAMES.index(margin)


def compiled(
    columns: Floats, half: Floats, middle: Floats, hover: Floats, scale: Floats
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Returns margins (m, 4), normals (m, 4, 6) and ranks (m,) of m postures, scaled.

    Args:
        columns: (m, 6, n) wrench per newton.
        half, middle: (n,) N, of the limits.
        hover: (m, 6) N and N·m.
        scale: (6,)
    """
    m = len(columns)
    margins, normals, rank = np.empty((m, 4)), np.empty((m, 4, 6)), np.empty(m, np.int64)
    wrench = np.array(hover, order="C")  # one that can be written: else a compile of its own
    kernel.batch(columns, half, middle, wrench, scale, margins, normals, rank)
    return margins, normals, rank


def one_posture(
    columns: Floats, half: Floats, middle: Floats, hover: Floats, scale: Floats
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Returns `compiled`'s results of one posture: ``{A x, |x_j| ≤ ½}``, A = S Q diag(2 half)."""
    a = columns[0] * (2.0 * half) / scale[:, None]
    y = (hover[0] - columns[0] @ middle) / scale
    margins, normals, rank = zonotope.margins(a, y)
    return margins[None], normals[None], np.array([rank])


def thrust_margins(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
) -> ThrustMargins:
    """Returns the exact margins of ``W = {Q λ, lower ≤ λ ≤ upper}`` round the hover wrench.

    With ``slack(d) = Σ max(d·q λ_min, d·q λ_max) - d·w0`` over W's facet normals d, the margins
    are min slack/‖d‖ (wrench, scaled), slack/‖d_f‖ (force) and slack/‖d_τ‖ (torque).

    Args:
        allocation: Q, (6, n), or (m, 6, n) for a batch: wrench per newton about the CoG.
        lower, upper: thrust limits, N, one number or (n,).
        hover_wrench: w0 = ``[m g Rᵀẑ; 0]``, (6,) or (m, 6), N and N·m.
        force_scale, torque_scale: F0 = m g, N, and T0 = m g · link length, N·m.

    Raises:
        AnalysisError: NaN, infinite entries, wrong shapes, negative limits, lower > upper.

    Source: THEORY A4; the wrench sets of ZN23 (eqs 7–13) in dual-rotor mode.
    """
    q = inputs.array("Q", allocation, (6, None), (None, 6, None))
    n = q.shape[-1]
    low, high = inputs.limits(lower, upper, n)
    hover = inputs.hover(hover_wrench, len(q) if q.ndim == 3 else None)
    scale = inputs.scale(force_scale, torque_scale)
    stack, wrench = (q, hover) if q.ndim == 3 else (q[None], hover[None])
    live = high > low
    if not live.all():  # rotors without freedom only shift the set
        wrench = wrench - stack[:, :, ~live] @ low[~live]
    columns = stack if live.all() else np.ascontiguousarray(stack[:, :, live])
    limits = (0.5 * (high - low)[live], 0.5 * (high + low)[live])
    measure = one_posture if q.ndim == 2 and zonotope.small(columns.shape[2]) else compiled
    margins, normals, rank = measure(columns, *limits, wrench, scale)
    margins[:, 1] *= scale[0]
    margins[:, 2] *= scale[3]
    whole = ThrustMargins(
        margins[:, 0],
        margins[:, 1],
        margins[:, 2],
        margins[:, 3],
        rank,
        normals,
        stack,
        low,
        high,
        hover.reshape(-1, 6),
        scale,
    )
    return whole if q.ndim == 3 else whole[0]
