"""What each apparatus of a body can push with: balls, discs, segments, sectors, and mixtures.

Apparatus j pushes with f = λ R_j u(φ, θ), ``u = Rx(φ) Ry(θ) e_z = [sinθ, -sinφ cosθ, cosφ cosθ]``,
λ, φ and θ each within their range (THEORY A1, A4). Two free gimbals make a ball, one tilt axis a
disc (θ fixed), none a segment, which is a reversible rotor's where the least λ is negative; limits
of gimbals make a spherical sector and a least thrust cuts its core out.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.margins import force_sets as kernel
from snakegen.wrench_margins import inputs

Floats = NDArray[np.float64]
WHOLE = 2.0 * np.pi * (1.0 - 1e-12)  # a range of φ as wide as this is all of it
EVEN = 2e-3  # rad: limits of ±3.14 or ±1.57 are meant as all the way round, or a right angle


@dataclass(frozen=True, eq=False)
class ForceSets:
    """The forces of n apparatuses about the CoG, in CoG axes, for one posture or a stack of m.

    Points of application are those of the posture's gimbal angles: what moves with φ behind an
    offset stays where the posture has it.

    Attributes:
        points: (n, 3) or (m, n, 3) m, points of application from the CoG.
        frames: (n, 3, 3) or (m, n, 3, 3), the set's own axes R_j in CoG axes.
        low, high: (n,) N, least and largest λ; a negative least one is a reversible rotor's.
        phi, theta: (n, 2) rad, ranges [lo, hi] of φ and θ; lo = hi where that joint is absent.
        drag: (n,) m, torque on the body along the force per newton, -κ s.
    """

    points: Floats
    frames: Floats
    low: Floats
    high: Floats
    phi: Floats
    theta: Floats
    drag: Floats

    @staticmethod
    def checked(
        points: ArrayLike,
        frames: ArrayLike,
        low: ArrayLike,
        high: ArrayLike,
        phi: ArrayLike,
        theta: ArrayLike,
        drag: ArrayLike = 0.0,
    ) -> "ForceSets":
        """Returns force sets, shapes and ranges checked; one number serves all apparatuses.

        Raises:
            AnalysisError: wrong shapes, NaN, a range whose ends are the wrong way round, frames
                that are no rotations.
        """
        p = inputs.array("points", points, (None, 3), (None, None, 3))
        n = p.shape[-2]
        turn = inputs.array("frames", frames, (n, 3, 3), (*p.shape[:-1], 3, 3))
        product = np.einsum("...ik,...jk->...ij", turn, turn)
        if np.abs(product - np.eye(3)).max(initial=0.0) > 1e-6:
            raise AnalysisError("frames must hold one rotation matrix (3, 3) for each apparatus.")
        least, most = (
            np.broadcast_to(inputs.array(name, value, (), (n,)), (n,))
            for name, value in (("low", low), ("high", high))
        )
        angles = []
        for name, value in (("phi", phi), ("theta", theta)):
            angles.append(np.broadcast_to(inputs.array(name, value, (2,), (n, 2)), (n, 2)))
            _ordered(name, angles[-1][:, 0], angles[-1][:, 1])
        _ordered("thrust", least, most)
        if (most < 0.0).any():
            raise AnalysisError(f"high[{int(np.argmax(most < 0))}] is negative: turn its axis.")
        out = (p, turn, least, most, *angles, inputs.drags(drag, n))
        return ForceSets(*(np.ascontiguousarray(x, float) for x in out))

    @staticmethod
    def free(points: ArrayLike, limits: ArrayLike, drag: ArrayLike = 0.0) -> "ForceSets":
        """Returns balls ``‖f‖ ≤ L``: apparatuses of two gimbals without limits.

        Args:
            points: (n, 3) or (m, n, 3) m.
            limits: L, N, one number or (n,).
            drag: m, one number or (n,).
        """
        n = np.shape(points)[-2] if np.ndim(points) > 1 else 0
        whole = np.array([-np.pi, np.pi])
        frames = np.broadcast_to(np.eye(3), (n, 3, 3))
        low = np.zeros(n)
        return ForceSets.checked(
            points, frames, low, inputs.per_unit("limits", limits, n), whole, whole, drag
        )

    def __len__(self) -> int:
        return self.low.size

    @cached_property
    def patches(self) -> tuple[tuple[Floats, ...], ...]:
        """For each apparatus its patches [φ0, φ1, θ0, θ1, λ0, λ1, side], |θ| ≤ π/2, λ ≥ 0."""
        rows = zip(self.phi, self.theta, self.low, self.high, strict=True)
        return tuple(_patches(*row) for row in rows)

    @cached_property
    def balls(self) -> NDArray[np.bool_]:
        """(n,) which sets are whole balls: any direction, from 0."""
        whole = [any(_round(p) and p[4] == 0.0 for p in of) for of in self.patches]
        return np.array(whole, bool) & (self.low <= 0.0)

    @cached_property
    def convex(self) -> NDArray[np.bool_]:
        """(n,) which sets equal their hulls: balls, segments, discs, planar sectors up to half."""
        flat = (self.theta == 0.0).all(axis=1)
        width = self.phi[:, 1] - self.phi[:, 0]
        whole = width >= 2.0 * np.pi - 2.0 * EVEN
        disc = flat & (self.low <= 0.0) & (whole | ((width <= np.pi) & (self.low == 0.0)))
        line = (width == 0.0) & (self.theta[:, 0] == self.theta[:, 1])
        return self.balls | line | disc

    @cached_property
    def strengths(self) -> Floats:
        """(n,) N, largest thrust either way."""
        return np.maximum(self.high, -self.low)

    @cached_property
    def spans(self) -> Floats:
        """(n, 3, 3) orthonormal columns that span each set, its own axes; 0 where it has fewer."""
        out = np.zeros((len(self), 3, 3))
        for j, (phi, theta) in enumerate(zip(self.phi, self.theta, strict=True)):
            start = np.array([0.0, -np.sin(phi[0]), np.cos(phi[0])])
            if phi[0] == phi[1] and theta[0] == theta[1]:
                out[j, :, 0] = np.cos(theta[0]) * start + [np.sin(theta[0]), 0.0, 0.0]
            elif phi[0] == phi[1]:
                out[j, :, 0], out[j, 0, 1] = start, 1.0
            elif (theta == 0.0).all():
                out[j, 1, 0], out[j, 2, 1] = 1.0, 1.0
            else:
                out[j] = np.eye(3)
        return out

    def stacked(self, scale: Floats) -> tuple[Floats, Floats]:
        """Returns scaled points and drags (m, n, 4) and frames (m, n, 3, 3) for kernels."""
        n = len(self)
        points = self.points.reshape(-1, n, 3)
        out = np.empty((len(points), n, 4))
        out[..., :3], out[..., 3] = points, self.drag
        out *= scale[0] / scale[3]
        turn = np.broadcast_to(self.frames, (len(points), n, 3, 3))
        return out, np.ascontiguousarray(turn)

    def strongest(self, j: int, d: ArrayLike) -> Floats:
        """Returns the force (3,) of apparatus j that lies farthest along d (3,), CoG axes.

        Over each patch φ is clamped to its range first and θ second; the largest λ where d · u > 0,
        the least otherwise. The kernel's twin (`kernels.force_sets.hull_farthest`).
        """
        local = self.frames[j].T @ np.asarray(d, float)
        best = [_farthest(local, *patch[:6]) for patch in self.patches[j]]
        return np.asarray(self.frames[j] @ max(best, key=lambda f: float(local @ f)))

    def hull(self, scale: tuple[float, float] = (1.0, 1.0)) -> kernel.Sets:
        """Returns the sets' hulls as kernels take them, scaled by F0 and T0; a stack's first."""
        rows = [patch_row(p, scale[0]) for of in self.patches for p in of]
        count = [len(of) for of in self.patches]
        n = len(self)
        one = self if self.points.ndim == 2 else self.posture(0)
        return kernel.Sets(
            one.stacked(np.repeat(scale, 3))[0][0],
            one.frames,
            np.array(rows).reshape(-1, kernel.PATCH),
            np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
            np.full(n, kernel.HULL),
            np.zeros((n, 1, 3)),
            np.zeros((n, 3)),
            self.low / scale[0],
            self.high / scale[0],
            np.zeros(n, np.int64),
            np.zeros((n, 1, 3)),
        )

    def without(self, lost: ArrayLike) -> "ForceSets":
        """Returns the sets with the apparatuses `lost` (indices) pushing nothing."""
        gone = np.isin(np.arange(len(self)), lost)
        low, high = np.where(gone, 0.0, self.low), np.where(gone, 0.0, self.high)
        return replace(self, low=low, high=high)

    def weakened(self, share: float) -> "ForceSets":
        """Returns the sets that every thrust limit within ± `share` of the nominal one allows."""
        low = self.low * np.where(self.low > 0.0, 1.0 + share, 1.0 - share)
        return replace(self, low=np.minimum(low, self.high), high=self.high * (1.0 - share))

    def posture(self, i: int) -> "ForceSets":
        """Returns the sets of posture i of a stack."""
        turn = self.frames[i] if self.frames.ndim == 4 else self.frames
        return replace(self, points=self.points[i], frames=turn)


def _ordered(name: str, low: Floats, high: Floats) -> None:
    if (low > high).any():
        at = int(np.argmax(low > high))
        raise AnalysisError(f"{name}[{at}]: the range {low[at]:g} … {high[at]:g} is reversed.")


def _round(patch: Floats) -> bool:
    """Tells whether a patch holds every direction."""
    return bool(patch[1] - patch[0] >= WHOLE and patch[3] - patch[2] >= np.pi - EVEN)


def _patches(phi: Floats, theta: Floats, low: float, high: float) -> tuple[Floats, ...]:
    """Returns the patches of one apparatus: u(φ, θ) = u(φ + π, π - θ), -u(φ, θ) = u(φ + π, -θ)."""
    start, width = float(phi[0]), float(phi[1] - phi[0])
    if width >= 2.0 * np.pi - 2 * EVEN:
        start, width = -np.pi, 2.0 * np.pi
    ends = theta
    if theta[1] - theta[0] >= 2.0 * np.pi - 2 * EVEN:
        ends = np.array([-np.pi, np.pi])
    found = []
    for k in range(int(np.floor(ends[0] / np.pi + 0.5)), int(np.ceil(ends[1] / np.pi - 0.5)) + 1):
        a, b = np.clip(ends - k * np.pi, -0.5 * np.pi, 0.5 * np.pi)
        if k % 2:
            a, b = -b, -a
        at = start + k * np.pi
        if high > 0.0 or low > 0.0:
            found.append(np.array([at, at + width, a, b, max(low, 0.0), high, 1.0]))
        if low < 0.0:
            found.append(np.array([at + np.pi, at + np.pi + width, -b, -a, 0.0, -low, -1.0]))
    if not found:
        found.append(np.array([start, start + width, 0.0, 0.0, 0.0, 0.0, 1.0]))
    return _merged(found)


def _merged(found: list[Floats]) -> tuple[Floats, ...]:
    """Returns patches without those that another holds; two half balls are a ball."""
    halves = [p for p in found if p[3] - p[2] >= np.pi - EVEN and p[1] - p[0] >= np.pi - EVEN]
    for a in halves:
        for b in halves:
            apart = (b[0] - a[0]) % (2.0 * np.pi)
            joined = apart <= a[1] - a[0] + EVEN and apart + b[1] - b[0] >= 2.0 * np.pi - EVEN
            if a is not b and joined and (a[4:6] == b[4:6]).all():
                found = [np.r_[-np.pi, np.pi, a[2:]], *found]
    kept: list[Floats] = []
    for p in sorted(found, key=lambda p: (-(p[1] - p[0]) * (p[3] - p[2] + 1.0), -p[5])):
        if not any(_holds(q, p) for q in kept):
            kept.append(p)
    return tuple(kept)


def _holds(a: Floats, b: Floats) -> bool:
    """Tells whether patch a holds patch b."""
    after = (b[0] - a[0]) % (2.0 * np.pi)
    after = 0.0 if after > 2.0 * np.pi - 1e-12 else after
    turned = a[1] - a[0] >= WHOLE or after + b[1] - b[0] <= a[1] - a[0] + 1e-12
    return bool(turned and a[2] <= b[2] and b[3] <= a[3] and a[4] <= b[4] and b[5] <= a[5])


def _farthest(
    d: Floats, p0: float, p1: float, t0: float, t1: float, low: float, high: float
) -> Floats:
    """Returns the force of a patch that lies farthest along d, the set's own axes."""
    peak = np.arctan2(-d[1], d[2])
    turns = np.array([p0, p1])
    if (peak - p0) % (2.0 * np.pi) <= p1 - p0:
        turns = np.append(turns, peak)
    across = -d[1] * np.sin(turns) + d[2] * np.cos(turns)
    phi, level = turns[np.argmax(across)], across.max()
    tilts = np.array([t0, t1, np.clip(np.arctan2(d[0], level), t0, t1)])
    along = d[0] * np.sin(tilts) + level * np.cos(tilts)
    theta, best = tilts[np.argmax(along)], along.max()
    u = [np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    return np.array(u) * (high if best > 0.0 else low)


def patch_row(patch: Floats, force: float) -> Floats:
    """Returns the constants of a patch as the kernel reads them."""
    p0, p1, t0, t1, low, high, side = patch
    middle, half = 0.5 * (p0 + p1), 0.5 * (p1 - p0)
    return np.array(
        [
            *(np.sin(middle), np.cos(middle), -1.0 if half >= np.pi - EVEN else np.cos(half)),
            *(np.sin(p0), np.cos(p0), np.sin(p1), np.cos(p1)),
            *(np.sin(t0), np.cos(t0), np.sin(t1), np.cos(t1)),
            *(low / force, high / force),
            *(p0, p1, t0, t1, side),
        ]
    )
