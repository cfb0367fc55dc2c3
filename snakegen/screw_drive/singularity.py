"""Shapes in which a screw drive loses hold: found by search, proved absent, and described.

Row i of the no-slip rows measures velocity along wheel i's axle, so a twist is free when every
axle line goes through its centre (concurrent axles) or all stand across it (parallel axles).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.screw.shape_search import certify, sigma_squared, smallest_sigma
from snakegen.screw_drive.kinematics import ScrewGeometry

Floats = NDArray[np.float64]
RANK_TOLERANCE = 1e-6


@dataclass(frozen=True)
class DriveHold:
    """How firmly the wheels hold the body in one shape."""

    shape: Floats  # (m - 1,) rad
    sigma: Floats  # scaled singular values of the no-slip rows, largest first; n = 2 has two
    rank: int
    kind: str  # "held", "parallel axles", "concurrent axles" or "one line": both at once
    direction: float | None  # rad in P's axes, of the free translation
    point: Floats | None  # (2,) m in P's axes, where the axle lines meet

    @property
    def text(self) -> str:
        """One line for people."""
        if self.direction is not None:
            way = f"slides freely at {math.degrees(self.direction):.1f}° to link 1"
            return f"{self.kind}: {way}"
        if self.point is not None:
            x, y = self.point
            return f"{self.kind}: turns freely about ({x:.3f}, {y:.3f}) m in link 1's axes"
        return f"{self.kind}: σ₃ = {self.sigma[-1]:.3g}"


def drive_hold(
    geometry: ScrewGeometry, shape: ArrayLike, tolerance: float = RANK_TOLERANCE
) -> DriveHold:
    """Returns rank, scaled singular values and, where a twist is free, what is free about it.

    Levers are scaled by the mean link length L; the rank tolerance is relative to σ₁. The
    free twist [v, ω] is a turn about ``[-v_y, v_x]/ω``, or a slide where L|ω| < 1e-6 |v|. When the
    rank is 1 the axles share one line: the body slides across it and turns about any point of it.
    """
    bent = np.ascontiguousarray(shape, float)
    rows = geometry.rows(bent, geometry.scale)
    _, sigma, right = np.linalg.svd(rows)
    rank = int((sigma > tolerance * sigma[0]).sum())
    if rank == 3:
        return DriveHold(bent, sigma, rank, "held", None, None)
    if rank == 1:
        across = math.atan2(rows[0, 0], -rows[0, 1])
        return DriveHold(bent, sigma, rank, "one line", across, None)
    free = right[2]
    turn = free[2] / geometry.scale
    if abs(free[2]) < 1e-6 * math.hypot(free[0], free[1]):
        across = math.atan2(free[1], free[0]) % math.pi
        return DriveHold(bent, sigma, rank, "parallel axles", across, None)
    centre = np.array([-free[1], free[0]]) / turn
    return DriveHold(bent, sigma, rank, "concurrent axles", None, centre)


@dataclass(frozen=True)
class HoldSearch:
    """What a search of the whole joint range found."""

    weakest: DriveHold  # the shape of smallest σ₃
    singular: tuple[DriveHold, ...]  # distinct singular shapes, if any; often samples of a family
    certified: float | None  # σ₃ is proved to be at least this everywhere; None: search only
    boxes: int  # boxes the proof took
    sampled: int = 0  # shapes tried
    descended: int = 0  # of these, shapes that σ₃ was descended from


def _slopes(geometry: ScrewGeometry) -> Floats:
    """Returns by how much the rows' Frobenius norm can change per radian of each joint, (m - 1,).

    Joint k moves the rows of units behind it: a direction by 1, a lever by Σ_{j≤k} ℓ_ij / L.
    """
    _, link, _, lengths = geometry.arrays
    reach = np.cumsum(lengths)[:-1] / geometry.scale
    behind = (link[None, :] > np.arange(lengths.size - 1)[:, None]).sum(axis=1)
    return np.sqrt(behind * (1 + reach**2))


def _distinct(shapes: list[Floats], apart: float = 0.05) -> list[Floats]:
    """Returns those shapes that are at least `apart` [rad] from every earlier one."""
    kept: list[Floats] = []
    for shape in shapes:
        if all(np.abs(shape - other).max() > apart for other in kept):
            kept.append(shape)
    return kept


def _seeds(low: Floats, high: Floats, samples: int, seed: int) -> Floats:
    """Returns first shapes: Sobol samples, corners of the range (to 10 joints), straight."""
    from scipy.stats import qmc

    d = low.size
    unit = qmc.Sobol(d, seed=seed).random(samples)
    if d <= 10:
        unit = np.vstack([unit, np.array(np.meshgrid(*[[0.0, 1.0]] * d)).reshape(d, -1).T])
    return np.vstack([low + unit * (high - low), np.clip(np.zeros(d), low, high)])


def _prove(geometry: ScrewGeometry, low: Floats, high: Floats, bound: float, budget: int) -> int:
    """Returns how many boxes proved σ₃ ≥ bound on the whole joint range, 0 where it failed."""
    known = (*geometry.arrays, geometry.scale)
    return max(int(certify(low, high, bound, _slopes(geometry), *known, budget)), 0)


def search_hold(
    geometry: ScrewGeometry,
    lower: ArrayLike,
    upper: ArrayLike,
    samples: int = 2048,
    starts: int = 24,
    budget: int = 200_000,
    seed: int = 0,
) -> HoldSearch:
    """Searches all shapes within joint limits for the smallest σ₃, and proves a bound if it can.

    Sobol samples, the corners of the range and the straight shape seed bounded quasi-Newton
    descents of σ₃². Where nothing singular turns up, branch and bound then tries to prove
    σ₃ ≥ half of the smallest value found, within `budget` boxes. Beyond four units it is the first
    four, or three, of which that is proved: more rows can only raise σ₃.

    Args:
        geometry: the drive.
        lower, upper: joint limits (m - 1,) [rad].
        samples, starts: how many shapes are tried and how many of them are descended from.
        budget: most boxes of the proof.
        seed: of the Sobol scramble.

    Raises:
        AnalysisError: limits of the wrong size or with lower > upper.
    """
    g, n, d = geometry, geometry.units, len(geometry.lengths) - 1
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    if low.shape != (d,) or high.shape != (d,) or not (low <= high).all():
        raise AnalysisError(
            f"{d + 1} links need {d} joint limits with lower ≤ upper; got {low}, {high}."
        )
    if n < 3 or d == 0:
        only = drive_hold(g, np.clip(np.zeros(d), low, high))
        return HoldSearch(only, () if only.rank == 3 else (only,), None, 0)
    known = (*g.arrays, g.scale)
    shapes = _seeds(low, high, samples, seed)
    best = shapes[np.argsort(smallest_sigma(shapes, *known))[:starts]]
    ends = [_descend(shape, known, low, high) for shape in best]
    holds = sorted((drive_hold(g, end) for end in ends), key=lambda hold: hold.sigma[-1])
    lost = _distinct([hold.shape for hold in holds if hold.rank < 3])
    if lost:
        found = tuple(drive_hold(g, shape) for shape in lost)
        return HoldSearch(holds[0], found, None, 0, len(shapes), len(best))
    if n <= 4:
        bound = 0.5 * float(holds[0].sigma[-1])
        boxes = _prove(g, low, high, bound, budget)
        return HoldSearch(holds[0], (), bound if boxes else None, boxes)
    for m in (4, 3):
        last = g.link[m - 1]
        first = ScrewGeometry(g.alpha[:m], g.r, g.link[:m], g.offset[:m], g.lengths[: last + 1])
        part = search_hold(first, low[:last], high[:last], samples, starts, budget, seed)
        if part.certified is not None:
            return HoldSearch(holds[0], (), part.certified, part.boxes)
    return HoldSearch(holds[0], (), None, 0)


def _descend(shape: Floats, known: tuple, low: Floats, high: Floats) -> Floats:
    """Returns the shape at which a bounded descent of σ₃² from `shape` ends."""
    from scipy.optimize import minimize

    found = minimize(
        sigma_squared,
        shape,
        args=known,
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(low, high, strict=True)),
        options={"ftol": 1e-17, "gtol": 1e-10, "maxiter": 300},
    )
    return np.ascontiguousarray(found.x)
