"""Margins of the pseudo-inverse allocator (THEORY A4, `controller`): thrust and servo limits.

``x = D (Q D)^# (w0 - d)`` is affine in the disturbance d, and so are the joint torques: every limit
is a quadric of d, and the margin is the least distance to one of them. The disturbance at that
point is the weakest push.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.rounding import least
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.quadric import leaves_ball, leaves_plane
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.set_exits import leaves_sets

Floats = NDArray[np.float64]
SLICES = {"wrench": slice(0, 6), "force": slice(0, 3), "torque": slice(3, 6)}
EVEN = 1e-9  # share of a limit within which a torque counts as none
LOST = 1e-9  # the allocator misses more than this share of a direction: it cannot hold it


@dataclass(frozen=True, eq=False)
class AllocatorMargin:
    """Margin of one slice of disturbances.

    Attributes:
        value: N, N·m or scaled; 0 where a direction is out of the map's range, nan where the
            allocator's own hover is beyond a limit.
        push: (6,) weakest disturbance on the robot, of margin 1: ``value * push`` meets the
            limit, N and N·m; nan where the margin is 0 or nan.
        limiting: index of the rotor or apparatus that limits it; the number of them plus the
            index of the joint; -1 where none does.
    """

    value: float
    push: Floats
    limiting: int


@dataclass(frozen=True, eq=False)
class ControllerMargins:
    """Largest disturbance that the allocator answers without saturation, in every direction.

    Attributes:
        slices: by name, of `SLICES`.
        hover: thrusts (n,), or forces (n, 3), that the allocator commands at hover, N.
    """

    slices: dict[str, AllocatorMargin]
    hover: Floats

    @property
    def wrench(self) -> float:
        """Scaled margin of force and torque together."""
        return self.slices["wrench"].value

    @property
    def force(self) -> float:
        """Force margin, N."""
        return self.slices["force"].value

    @property
    def torque(self) -> float:
        """Torque margin, N·m."""
        return self.slices["torque"].value

    @property
    def limiting(self) -> tuple[int, int, int]:
        """Limiting index of wrench, force and torque; see `AllocatorMargin`."""
        found = [self.slices[name].limiting for name in SLICES]
        return found[0], found[1], found[2]


def ball_reach(start: ArrayLike, gain: ArrayLike, limit: float) -> float:
    """Returns the largest r with ``‖f0 + K d‖ ≤ L`` for all ‖d‖ ≤ r.

    Args:
        start: f0, (k,), N.
        gain: K, (k, l): N per unit of d.
        limit: L, N.

    Returns:
        r; inf where K = 0, nan where ‖f0‖ > L.
    """
    f0, k = np.atleast_1d(np.asarray(start, float)), np.atleast_2d(np.asarray(gain, float))
    return float(np.linalg.norm(leaves_ball(f0, k, limit)))


def _least(exits: list[Floats], missed: float, part: slice, unit: Floats) -> AllocatorMargin:
    """Returns the least of `exits`, scaled disturbances; 0 where a direction is `missed`."""
    reach = np.array([np.linalg.norm(d) for d in exits])
    push = np.full(6, np.nan)
    if np.isnan(reach).any():
        return AllocatorMargin(float("nan"), push, int(np.argmax(np.isnan(reach))))
    if missed > LOST:
        return AllocatorMargin(0.0, push, -1)
    first = least(reach)
    value = float(reach[first])
    if 0.0 < value < np.inf:
        push = np.zeros(6)
        push[part] = exits[first] / value * unit[part]
    size = float(unit[part][0]) if part.stop - part.start == 3 else 1.0  # N or N·m, else scaled
    return AllocatorMargin(value * size, push / size, first)


def _joint_exits(bounds: Bounds | None, start: Floats, gain: Floats, acts: Floats) -> list[Floats]:
    """Returns the disturbances at which each joint meets its limit; x = start + gain d."""
    if bounds is None:
        return []
    torque, rate = bounds.bias + bounds.rows @ start, bounds.rows @ gain + acts
    exits = []
    for t, g, most in zip(torque, rate, bounds.limit, strict=True):
        # a torque of 0 is as near to both limits: round-off does not choose
        room, sign = most - abs(t), 1.0 if t >= -EVEN * most else -1.0
        exits.append(leaves_plane(sign * g, float(room)))
    return exits


def _box_exits(start: Floats, gain: Floats, low: Floats, high: Floats) -> list[Floats]:
    """Returns the disturbances at which each rotor meets the nearer of its limits."""
    slack = 1e-12 * max(float(high.max(initial=0.0)), 1e-300)
    exits = []
    for x, g, a, b in zip(start, gain, low, high, strict=True):
        ends = (leaves_plane(g, _room(b - x, slack)), leaves_plane(-g, _room(x - a, slack)))
        exits.append(min(ends, key=lambda d: -1.0 if np.isnan(d).any() else np.linalg.norm(d)))
    return exits


def _room(left: float, slack: float) -> float:
    return 0.0 if -slack <= left < 0.0 else float(left)


def thrust_controller(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    weights: ArrayLike | None = None,
    bounds: Bounds | None = None,
) -> ControllerMargins:
    """Returns the margins of ``λ = D (Q D)^# w``, D = diag(weights) (ZN23 eq 22).

    Args:
        allocation: Q, (6, n).
        lower, upper: thrust limits, N, one number or (n,).
        hover_wrench: (6,), N and N·m.
        force_scale, torque_scale: F0, N, and T0, N·m.
        weights: D, (n,); by default the upper limits.
        bounds: joint torque limits, rows (k, n), to be kept as well.

    Raises:
        AnalysisError: as `thrust_margins`.
    """
    every = slice(0, 6)
    given = (allocation, lower, upper, hover_wrench)
    scales = {"force_scale": force_scale, "torque_scale": torque_scale}
    found = _thrust(*given, every, SLICES, weights=weights, bounds=bounds, **scales)
    return ControllerMargins(*found)


def truncated_controller(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    weights: ArrayLike | None = None,
    bounds: Bounds | None = None,
) -> AllocatorMargin:
    """Returns the margin over ``[f_z; τ]`` of ``λ = D (Q_trunc D)^# w`` (ZN23 eqs 22-24).

    The allocator answers four rows and leaves the horizontal force to the attitude; arguments as
    `thrust_controller`. The margin is scaled.
    """
    part = slice(2, 6)
    given = (allocation, lower, upper, hover_wrench)
    scales = {"force_scale": force_scale, "torque_scale": torque_scale}
    found, _ = _thrust(*given, part, {"": part}, weights=weights, bounds=bounds, **scales)
    return found[""]


def _thrust(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    answered: slice,
    slices: dict[str, slice],
    *,
    force_scale: float,
    torque_scale: float,
    weights: ArrayLike | None,
    bounds: Bounds | None,
) -> tuple[dict[str, AllocatorMargin], Floats]:
    """Returns the margins of an allocator that answers the rows `answered`, and its hover."""
    q = inputs.array("Q", allocation, (6, None))
    low, high = inputs.limits(lower, upper, q.shape[1])
    hover, scale = inputs.hover(hover_wrench, None), inputs.scale(force_scale, torque_scale)
    d = high if weights is None else inputs.per_unit("weights", weights, q.shape[1])
    inverse = np.zeros((q.shape[1], 6))
    scaled = q / scale[:, None]
    inverse[:, answered] = d[:, None] * np.linalg.pinv(scaled[answered] * d, rcond=1e-6)
    thrust = inverse @ (hover / scale)
    out = {}
    for name, part in slices.items():
        gain = -inverse[:, part]
        exits = _box_exits(thrust, gain, low, high)
        acts = np.zeros(0) if bounds is None else bounds.wrench[:, part] * scale[part]
        exits += _joint_exits(bounds, thrust, gain, acts)
        missed = np.linalg.norm((scaled @ inverse - np.eye(6))[answered, part], 2)
        out[name] = _least(exits, float(missed), part, scale)
    return out, thrust


def vectored_controller(
    points: ArrayLike,
    limits: ArrayLike,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    weights: ArrayLike | None = None,
    drag: ArrayLike = 0.0,
    bounds: Bounds | None = None,
    sets: ForceSets | None = None,
) -> ControllerMargins:
    """Returns the margins of ``F = D (Q_force D)^# w`` under ‖f_j‖ ≤ L_j (ZN23 eq 36).

    The law knows no gimbal limits; with `sets` it ends where a force leaves its set, or rather the
    convex piece of it about the force at hover: a lower bound where the set is not convex.

    Args:
        points: p, (n, 3), m from the CoG.
        limits: L, N, one number or (n,).
        hover_wrench: (6,), N and N·m.
        force_scale, torque_scale: F0, N, and T0, N·m.
        weights: D, one number an apparatus, (n,); by default 1, the paper's plain pseudo-inverse.
        drag: c, m, one number or (n,), as `vectored_margins`.
        bounds: joint torque limits, rows (k, 3n), to be kept as well.
        sets: what the apparatuses can push with; balls if absent.

    Raises:
        AnalysisError: as `vectored_margins`.
    """
    p = inputs.array("points", points, (None, 3))
    limit = inputs.per_unit("limits", limits, len(p))
    hover, scale = inputs.hover(hover_wrench, None), inputs.scale(force_scale, torque_scale)
    shares = inputs.per_unit("weights", 1.0 if weights is None else weights, len(p))
    d = np.repeat(shares * (limit > 0.0), 3)
    scaled = inputs.force_map(p, inputs.drags(drag, len(p))) / scale[:, None]
    inverse = d[:, None] * np.linalg.pinv(scaled * d, rcond=1e-6)
    forces = inverse @ (hover / scale)
    out = {}
    for name, part in SLICES.items():
        gain = -inverse[:, part]
        exits = [
            leaves_ball(forces[3 * j : 3 * j + 3], gain[3 * j : 3 * j + 3], float(most))
            for j, most in enumerate(limit)
        ]
        if sets is not None and not sets.balls.all():
            exits = leaves_sets(sets, forces, gain)
        acts = np.zeros(0) if bounds is None else bounds.wrench[:, part] * scale[part]
        exits += _joint_exits(bounds, forces, gain, acts)
        missed = np.linalg.norm((scaled @ inverse - np.eye(6))[:, part], 2)
        out[name] = _least(exits, float(missed), part, scale)
    return ControllerMargins(out, forces.reshape(-1, 3))
