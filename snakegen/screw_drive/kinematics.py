"""What a screw drive can do: motion under an input, slip, path demands, direction cone, radii.

Everything here follows from the no-slip rows of HA eqs 3-6; motor and joint limits are the user's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.errors import AnalysisError
from snakegen.kernels.screw.constraints import follow, no_slip_rows, unit_rows
from snakegen.screw_drive.ground_paths import Path, path_length, path_pieces

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ScrewGeometry:
    """n screw units on a chain of m links, P at link 1's start; links may be bare or uneven.

    A plant's geometry may differ from what its law believes.
    """

    alpha: tuple[float, ...]  # (n,) rad, signed: positive is left-handed
    r: float  # m, from a drum's centre to the ground
    link: tuple[int, ...]  # (n,) the link of each unit, from 0, rising
    offset: tuple[float, ...]  # (n,) m, from that link's start to the drum's centre
    lengths: tuple[float, ...]  # (m,) m, of the links

    @property
    def units(self) -> int:
        """How many units n."""
        return len(self.alpha)

    @property
    def scale(self) -> float:
        """Mean link length [m], by which levers are scaled; HA's L where L0 = 0."""
        return float(np.mean(self.lengths))

    @cached_property
    def arrays(self) -> tuple[Floats, NDArray[np.int64], Floats, Floats]:
        """α, link, offset and lengths as the kernels take them."""
        return (
            np.array(self.alpha, float),
            np.array(self.link, np.int64),
            np.array(self.offset, float),
            np.array(self.lengths, float),
        )

    def no_slip(self, w: Floats) -> Floats:
        """Returns the upper block of A in state w (m + 2,), (n, m + 2)."""
        return np.asarray(no_slip_rows(w, *self.arrays))

    def rows(self, shape: ArrayLike, scale: float = 1.0) -> Floats:
        """Returns the no-slip rows by body twist in P's axes, (n, 3), levers divided by `scale`."""
        bent = np.ascontiguousarray(shape, float)
        return np.asarray(unit_rows(bent, *self.arrays, scale))

    def drive(self) -> Floats:
        """Returns ``-r sin α`` (n,) [m]; raises AnalysisError where an α of 0 makes B singular."""
        factor = -self.r * np.sin(self.alpha)
        flat = np.flatnonzero(np.abs(factor) < 1e-9 * self.r)
        if flat.size:
            raise AnalysisError(
                f"B is singular: unit {flat[0] + 1} has a helix angle of "
                f"{math.degrees(self.alpha[flat[0]]):.4g}°, whose screw drives nothing."
            )
        return factor


def hara_chain(
    alpha: Sequence[float], r: float = 0.075, L0: float = 0.0, L1: float = 0.103, L2: float = 0.123
) -> ScrewGeometry:
    """Returns HA's chain, a unit on every link: L0 + L1 to the first, then L2 + L1 on [m]."""
    n = len(alpha)
    return ScrewGeometry(
        tuple(alpha),
        r,
        tuple(range(n)),
        (L0 + L1,) + (L1,) * (n - 1),
        (L0 + L1 + L2,) + (L1 + L2,) * (n - 1),
    )


def state_rate(w: Floats, u: Floats, geometry: ScrewGeometry) -> tuple[Floats, Floats]:
    """Returns ẇ (m + 2,) under the input u, and the slip (n,) [m/s] that no motion can avoid.

    The joints turn as told; the body twist is the least-squares answer of the n no-slip rows, and
    what is left of them is slip along the wheels' axles: 0 for n ≤ 3 or a consistent input.
    """
    n, rows = geometry.units, geometry.no_slip(w)
    wanted = -geometry.r * np.sin(geometry.alpha) * u[:n] - rows[:, 3:] @ u[n:]
    twist = np.linalg.lstsq(rows[:, :3], wanted, rcond=1e-9)[0]
    return np.concatenate([twist, u[n:]]), rows[:, :3] @ twist - wanted


def slip_sensitivity(
    geometry: ScrewGeometry, shape: ArrayLike, twist: ArrayLike, error: float = 0.01
) -> dict[str, float]:
    """Returns the RMS slip [m/s] when one parameter is believed too large by the share `error`.

    Rates are worked out for `twist` [m/s, m/s, rad/s] with the wrong parameter, the motion with the
    right ones. A wrong r only changes the speed; a wrong α or length, with more than three units,
    makes wheels fight. α and offset are changed on one unit, length on one link: the figure is that
    of the unit or link with the largest slip.
    """
    g, more = geometry, 1 + error

    def each(values: tuple[float, ...]) -> list[tuple[float, ...]]:
        return [(*values[:i], x * more, *values[i + 1 :]) for i, x in enumerate(values)]

    wrong = {
        "alpha": [replace(g, alpha=alpha) for alpha in each(g.alpha)],
        "radius": [replace(g, r=g.r * more)],
        "offset": [replace(g, offset=offset) for offset in each(g.offset)],
        "length": [replace(g, lengths=lengths) for lengths in each(g.lengths)],
    }
    bent = np.asarray(shape, float)
    w = np.concatenate([np.zeros(3), bent])

    def slip_of(believed: ScrewGeometry) -> float:
        rates = believed.rows(bent) @ np.asarray(twist, float) / believed.drive()
        slip = state_rate(w, np.concatenate([rates, np.zeros(bent.size)]), g)[1]
        return float(np.sqrt(np.mean(slip**2)))

    return {name: max(map(slip_of, cases)) for name, cases in wrong.items()}


def worst_slip_sensitivity(
    geometry: ScrewGeometry, shapes: Sequence[ArrayLike], twist: ArrayLike
) -> dict[str, float]:
    """Returns the largest of `slip_sensitivity` over several shapes, by parameter [m/s]."""
    found = [slip_sensitivity(geometry, shape, twist) for shape in shapes]
    return {name: max(one[name] for one in found) for name in found[0]}


@dataclass(frozen=True)
class PathDemand:
    """What following a path takes at a given speed, and the speed that the motors would allow."""

    screw_rate: float  # rad/s, largest
    joint_rate: float  # rad/s, largest
    joint_angle: float  # rad, largest
    speed: float  # m/s, asked for
    fastest: float  # m/s, where the first limit is met


def path_demand(
    geometry: ScrewGeometry,
    path: Path,
    speed: float,
    screw_rate: float = math.inf,
    joint_rate: float = math.inf,
    joint_limit: ArrayLike = math.inf,
    names: Sequence[str] = (),
    spacing: float = 0.005,
) -> PathDemand:
    """Returns the peak rates and angles of follow-the-leader along `path` at `speed` [m/s].

    Sampled every `spacing` [m] from the head's start to the tail's leaving the path.

    Args:
        geometry: the drive.
        path: what is followed.
        speed: along it [m/s], positive: the head leads.
        screw_rate, joint_rate: motor limits [rad/s].
        joint_limit: of every |angle| [rad], or lower and upper limits (2, m - 1).
        names: of the yaw joints, for messages.
        spacing: of the samples [m].

    Raises:
        AnalysisError: a speed that is not positive; a joint would have to turn beyond its limit:
            says which, where, how far.
    """
    if not (math.isfinite(speed) and speed > 0):
        raise AnalysisError(
            f"speed {speed:g} m/s: follow-the-leader needs a positive speed, the head leads."
        )
    pieces, links, n = path_pieces(path), geometry.arrays[3], geometry.units
    end = path_length(path) + float(links.sum())
    count = max(2, math.ceil(end / spacing) + 1)
    factor = geometry.drive()
    m = links.size
    states, rates = np.empty((count, m + 2)), np.empty((count, n + m - 1))
    grid = np.linspace(0.0, end, count)
    for k, s in enumerate(grid):
        states[k], slope = follow(pieces, s, links)
        rates[k] = np.concatenate([geometry.no_slip(states[k]) @ slope / factor, slope[3:]])
    rates *= speed
    bend = states[:, 3:]
    low, high = _both_limits(joint_limit, m - 1)
    beyond = np.maximum(bend - high, low - bend)
    if beyond.max(initial=-math.inf) > 0:
        k, joint = divmod(int(beyond.argmax()), bend.shape[1])
        name = names[joint] if joint < len(names) else f"yaw joint {joint + 1}"
        least = max(following_radii(links, low, high))
        raise AnalysisError(
            f"the path bends {name} to {math.degrees(bend[k, joint]):.1f}° with the head at "
            f"s = {grid[k]:.2f} m, but it turns {math.degrees(low[joint]):.1f} … "
            f"{math.degrees(high[joint]):.1f}°; arcs of radius {least:.3f} m or more can be "
            "followed."
        )
    bend = np.abs(bend)
    screw = float(np.abs(rates[:, :n]).max())
    joint_peak = float(np.abs(rates[:, n:]).max(initial=0.0))
    room = [limit / peak for limit, peak in ((screw_rate, screw), (joint_rate, joint_peak)) if peak]
    fastest = speed * min(room, default=math.inf)
    return PathDemand(screw, joint_peak, float(bend.max(initial=0.0)), speed, fastest)


def _both_limits(limit: ArrayLike, joints: int) -> tuple[Floats, Floats]:
    """Returns lower and upper limits (m - 1,) [rad] of one largest |angle|, or of (2, m - 1)."""
    given = np.asarray(limit, float)
    if given.ndim == 0:
        return np.full(joints, -given), np.full(joints, given)
    return given[0], given[1]


def following_radii(links: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> tuple[float, float]:
    """Returns the smallest arc radii [m] that a chain follows to the left and to the right.

    The body trails its head, so a left turn bends its joints to negative angles.
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    if low.size == 0:
        return math.inf, math.inf
    sides = float((-low).min()), float(high.min())
    left, right = (following_radius(links, side) if side > 0 else math.inf for side in sides)
    return left, right


def following_radius(links: ArrayLike, joint_limit: float) -> float:
    """Returns the smallest arc radius [m] that a chain follows with joints up to `joint_limit`.

    Neighbouring chords c, c' of a circle meet at ``asin(c/2R) + asin(c'/2R)``.
    """
    from scipy.optimize import brentq

    chords = np.asarray(links, float)
    if chords.size < 2 or not joint_limit > 0:
        raise AnalysisError("a turning radius needs two links and a positive joint limit.")
    tightest = float(chords.max()) / 2

    def bend(radius: float) -> float:
        half = np.arcsin(np.minimum(chords / (2 * radius), 1.0))
        return float((half[:-1] + half[1:]).max())

    if bend(tightest) <= joint_limit:
        return tightest
    return float(brentq(lambda R: bend(R) - joint_limit, tightest, 1e3 * tightest / joint_limit))
