"""Certified margins of one design over many postures, exact where they can be, and their forces."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.design_search.body_arrays import BodyArrays
from snakegen.kernels.core.types import Ints, Mechanism
from snakegen.kernels.margins import one_slice, saddle_point
from snakegen.kernels.margins.posture_batch import PlacedPostures, hover_postures
from snakegen.robot.robot import GRAVITY
from snakegen.wrench_margins.gradients import UNIT
from snakegen.wrench_margins.thrust import thrust_margins
from snakegen.wrench_margins.vectored import set_margins

ROW = {"force": 1, "torque": 2}


@dataclass(frozen=True, eq=False)
class PlacedDesign:
    """Thrust points and load of a design at m postures, thrusts pointed up, root-link axes.

    Attributes:
        arrays: of the design.
        points: (m, n, 3) m, from the CoG.
        frames: (m, n, 3, 3) of `kernels.mounts`.
        hover: (m, 6) N, N·m.
        dual: (m, 6, n_rotors) wrench per newton of each rotor.
        spine: (m, L, 2, 3) m, ends of the links, from the root link's origin.
        discs: (m, n_rotors, 3) m, rotor centres, likewise.
        samples: (m, k) rad, the postures, and
        indices: (k,) which of the tree's angles they are.
    """

    arrays: BodyArrays
    points: Floats
    frames: Floats
    hover: Floats
    dual: Floats
    spine: Floats
    discs: Floats
    samples: Floats
    indices: Ints

    def rows(self, which: Any) -> "PlacedDesign":
        """Returns the same at some of the postures."""
        named = ("points", "frames", "hover", "dual", "spine", "discs", "samples")
        taken: Any = {n: np.ascontiguousarray(getattr(self, n)[which]) for n in named}
        return replace(self, **taken)


@dataclass(frozen=True, eq=False)
class Certified:
    """One margin at m postures.

    Attributes:
        values: (m,) N or N·m: exact where `solved`, else the certified lower bound; -inf where
            hover is out of reach.
        bounds: (m, 2) certified bounds; nan where hover is out of reach.
        twists: (m, 6) of the worst direction, unit of the margin per N and N·m.
        forces: (m, n, 3) N, that reach it.
        solved: (m,) whether value, twist and forces are exact.
    """

    values: Floats
    bounds: Floats
    twists: Floats
    forces: Floats
    solved: Ints


def place_design(arrays: BodyArrays, samples: Floats, indices: Ints) -> PlacedDesign:
    """Returns a design at m postures.

    Args:
        arrays: of the design.
        samples: (m, k) rad.
        indices: (k,) which of the tree's angles they are.
    """
    m, n, rotors = len(samples), arrays.gimbals.limit.size, arrays.rotors.body.size
    points, frames = np.empty((m, n, 3)), np.empty((m, n, 3, 3))
    dual, hover = np.empty((m, 6, rotors)), np.empty((m, 6))
    rods = arrays.rods
    spine, discs = np.empty((m, len(rods.bodies), 2, 3)), np.empty((m, rotors, 3))
    hover_postures(
        Mechanism(arrays.tree, arrays.rotors, arrays.gimbals), (arrays.low, arrays.high),
        np.eye(3), indices, np.ascontiguousarray(samples), GRAVITY,
        (rods.bodies, rods.ends),
        PlacedPostures(dual, points, frames, hover, spine, discs),
    )  # fmt: skip
    return PlacedDesign(
        arrays, points, frames, hover, dual, spine, discs, np.asarray(samples), indices
    )


def dual_values(placed: PlacedDesign, kind: str, lost: int = -1) -> Floats:
    """Returns (m,) exact margins in dual-rotor mode, gimbals held pointed up; -inf: no hover.

    Args:
        placed: the design.
        kind: "torque" [N·m] or "attitude_altitude" [1].
        lost: an apparatus that pushes nothing.
    """
    rotors, (force, torque) = placed.arrays.rotors, placed.arrays.scale
    live = rotors.apparatus != lost
    found = thrust_margins(
        placed.dual, np.where(live, rotors.thrust_min, 0.0),
        np.where(live, rotors.thrust_max, 0.0), placed.hover, force_scale=force,
        torque_scale=torque,
    )  # fmt: skip
    values = np.asarray(getattr(found, kind), float)
    return np.where(values >= 0.0, values, -np.inf)


def certify(
    placed: PlacedDesign, kinds: tuple[str, ...], tolerance: float, lost: int = -1
) -> dict[str, Certified]:
    """Returns the margins of `kinds` ("force", "torque"), apparatus `lost` pushing nothing."""
    shapes = placed.arrays.shapes
    if lost >= 0:
        shapes = shapes.without([lost])
    live = shapes.strengths > 0.0
    force, torque = placed.arrays.scale
    if not shapes.balls[live].all():
        return _limited(placed, kinds, tolerance, lost)
    scale = np.repeat([force, torque], 3)
    m, n = placed.points.shape[:2]
    stack = np.zeros((m, n, 4))
    stack[..., :3], stack[..., 3] = placed.points, shapes.drag
    stack = np.ascontiguousarray(stack[:, live] * (force / torque))
    limit, hover = shapes.strengths[live] / force, placed.hover / scale
    out = {}
    for kind in kinds:
        size = force if kind == "force" else torque
        mine, worst = np.empty((m, 2)), np.empty((m, 6))
        one_slice.batch(kind == "torque", stack, limit, hover, tolerance, mine, worst)
        values, solved = np.empty(m), np.empty(m, np.int64)
        part = np.zeros((m, stack.shape[1], 3))
        saddle_point.batch(stack, limit, hover, UNIT[kind], mine, worst, values, part, solved)
        values = np.where(solved > 0, values, mine[:, 0])
        values = np.where(np.isfinite(mine[:, 0]), values, -np.inf)
        forces = np.zeros((m, n, 3))
        forces[:, live] = part * force
        out[kind] = Certified(values * size, mine * size, worst * size / scale, forces, solved)
    return out


def _limited(
    placed: PlacedDesign, kinds: tuple[str, ...], tolerance: float, lost: int
) -> dict[str, Certified]:
    """The same for sets that are not balls: lower bounds, and nothing exact."""
    shapes = placed.arrays.shapes
    sets = replace(shapes, points=placed.points, frames=placed.frames @ shapes.frames)
    force, torque = placed.arrays.scale
    found = set_margins(
        sets.without([lost]) if lost >= 0 else sets, placed.hover, tolerance=tolerance,
        force_scale=force, torque_scale=torque,
    )  # fmt: skip
    m, n = placed.points.shape[:2]
    out = {}
    for kind in kinds:
        bounds = found.bounds[:, ROW[kind]]
        values = np.where(np.isfinite(bounds[:, 0]), bounds[:, 0], -np.inf)
        none = np.full((m, 6), np.nan), np.full((m, n, 3), np.nan), np.zeros(m, np.int64)
        out[kind] = Certified(values, bounds, *none)
    return out
