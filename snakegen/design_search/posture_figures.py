"""Figures of a design by posture besides its margins: wake, joint torques, size in space."""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.design_search.joint_limited import hover_joint_torques
from snakegen.design_search.posture_margins import PlacedDesign, certify, place_design
from snakegen.robot.rotor_streams import SPREAD, mean_inflow, thrust_kept

STREAM = 2.0  # m downstream within which a stream counts, as in `analyze wake`
HEADINGS = 72  # of half a turn, at which a body goes through an opening
FOLDED = (1.0, 0.75, 0.5, 0.25)  # shares of each posture's angles that are tried as well
AT_ONCE = 16  # postures whose margins are asked for at a time, the widest reach first


@dataclass(frozen=True, eq=False)
class Best:
    """The posture of a set at which a figure is best.

    Attributes:
        value: m; -inf where no posture keeps the torque margin.
        angles: (k,) rad of the joints that shape the body; nan where there is none.
        heading: rad, of an opening's normal from the root link's x axis.
    """

    value: float
    angles: Floats
    heading: float = 0.0


def wake_losses(placed: PlacedDesign) -> Floats:
    """Returns (m,) the largest share of its thrust that a rotor loses in another's stream.

    Thrusts are pointed up, all discs equally loaded; what `analyze wake` says of each pair.
    """
    axes = placed.dual[:, :3].transpose(0, 2, 1)
    axes = axes / np.linalg.norm(axes, axis=2, keepdims=True)
    radius = 0.5 * placed.arrays.diameters
    away = placed.discs[:, None] - placed.discs[:, :, None]  # (m, source, hit, 3)
    down = -np.einsum("mshc,msc->msh", away, axes)
    square = (away**2).sum(axis=3) - down**2
    offset = np.sqrt(np.maximum(square, 0.0))
    touched = offset < radius[:, None] + SPREAD * down + radius
    met = (down > 1e-6) & (down <= STREAM) & touched
    flow = mean_inflow(down, offset, radius[:, None], radius, SPREAD)
    lost = np.where(met, 1.0 - thrust_kept(np.where(met, flow, 0.0)), 0.0)
    return np.asarray(lost.max(axis=(1, 2)))


def joint_torques(placed: PlacedDesign) -> Floats:
    """Returns (m,) the largest joint torque at hover, N·m."""
    return np.asarray(np.abs(hover_joint_torques(placed)).max(axis=1))


def joint_loads(placed: PlacedDesign) -> Floats:
    """Returns (m,) the largest joint torque at hover as a share of its joint's limit."""
    shares = np.abs(hover_joint_torques(placed)) / placed.arrays.efforts
    return np.asarray(shares.max(axis=1))


def body_reach(placed: PlacedDesign, holding: float) -> Best:
    """Returns the largest distance [m] between both ends of the body.

    Args:
        placed: the design; each posture is tried folded less as well.
        holding: N·m, torque margin that a posture must keep.
    """
    folded = _folded(placed)
    spans = np.linalg.norm(folded.spine[:, -1, 1] - folded.spine[:, 0, 0], axis=1)
    return _first_that_holds(folded, spans, holding)


def opening_clearance(placed: PlacedDesign, width: float, height: float, holding: float) -> Best:
    """Returns the room [m] at each side with which some posture goes through an opening.

    The body goes level and straight through an upright rectangle and keeps its posture; links are
    rods and rotors balls of their radii. Negative where the narrowest is too wide.

    Args:
        placed: the design; each posture is tried folded less as well.
        width, height: m, of the opening.
        holding: N·m, torque margin that a posture must keep.
    """
    folded = _folded(placed)
    m = len(folded.spine)
    ends = folded.spine.reshape(m, -1, 3)
    points = np.concatenate([ends, folded.discs], axis=1)
    arrays = placed.arrays
    radii = np.concatenate([np.repeat(arrays.rods.radii, 2), 0.5 * arrays.diameters])
    high = (points[..., 2] + radii).max(axis=1) - (points[..., 2] - radii).min(axis=1)
    best, at = np.full(m, -np.inf), np.zeros(m)
    for heading in np.arange(HEADINGS) * np.pi / HEADINGS:
        across = points[..., 1] * np.cos(heading) - points[..., 0] * np.sin(heading)
        wide = (across + radii).max(axis=1) - (across - radii).min(axis=1)
        room = 0.5 * np.minimum(width - wide, height - high)
        at = np.where(room > best, heading, at)
        best = np.maximum(best, room)
    return _first_that_holds(folded, best, holding, at)


def _folded(placed: PlacedDesign) -> PlacedDesign:
    samples = np.concatenate([share * placed.samples for share in FOLDED])
    return place_design(placed.arrays, samples, placed.indices)


def _first_that_holds(
    placed: PlacedDesign, values: Floats, holding: float, headings: Floats | None = None
) -> Best:
    """Returns the posture of the largest value that keeps a torque margin."""
    order = np.argsort(-values, kind="stable")
    for first in range(0, len(order), AT_ONCE):
        some = order[first : first + AT_ONCE]
        held = certify(placed.rows(some), ("torque",), 1e-3)["torque"].values >= holding
        if held.any():
            k = int(some[np.argmax(held)])
            heading = 0.0 if headings is None else float(headings[k])
            return Best(float(values[k]), placed.samples[k], heading)
    return Best(-np.inf, np.full(placed.samples.shape[1], np.nan))
