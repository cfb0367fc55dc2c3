"""Margins of one design with its joint torques within limits, over many postures, and the torques.

A disturbance acts on the root link, which loads no joint. Of free gimbals, whose force sets are
balls; `wrench_margins.joint_limited` says how the bounds come about.
"""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.design_search.posture_margins import PlacedDesign, certify
from snakegen.errors import AnalysisError
from snakegen.kernels.core.types import Mechanism
from snakegen.kernels.dynamics.posture_loads import load_postures
from snakegen.kernels.margins import joint_limited_slice
from snakegen.robot.robot import GRAVITY

RANK = 1e-9  # of the largest singular value
DIGITS = 11  # of scaled numbers: a search takes one path of a design and of its rebuilt twin


def joint_maps(placed: PlacedDesign) -> tuple[Floats, Floats]:
    """Returns (m, k, n, 3) joint torque per newton of each force, and (m, k) of the weight, N·m."""
    arrays, m = placed.arrays, len(placed.samples)
    n, k = placed.points.shape[1], len(arrays.efforts)
    rows, bias = np.empty((m, k, 3 * n)), np.empty((m, k))
    load_postures(
        Mechanism(arrays.tree, arrays.rotors, arrays.gimbals), (arrays.low, arrays.high),
        placed.indices, np.ascontiguousarray(placed.samples), GRAVITY, placed.indices + 1, rows,
        bias,
    )  # fmt: skip
    return rows.reshape(m, k, n, 3), bias


def force_maps(placed: PlacedDesign) -> Floats:
    """Returns (m, n, 3, 6): what a twist about the CoG moves each thrust point by."""
    x, y, z = np.moveaxis(placed.points, -1, 0)
    c = placed.arrays.shapes.drag
    out = np.zeros((*placed.points.shape, 6))
    out[..., [0, 1, 2], [0, 1, 2]] = 1.0
    out[..., [0, 1, 2], [3, 4, 5]] = c[:, None]
    out[..., 0, 4], out[..., 0, 5] = z, -y
    out[..., 1, 3], out[..., 1, 5] = -z, x
    out[..., 2, 3], out[..., 2, 4] = y, -x
    return out


def hover_joint_torques(placed: PlacedDesign) -> Floats:
    """Returns (m, k) N·m of the joints at hover, by the forces of least norm (ZN23 eq 22)."""
    m, n = placed.points.shape[:2]
    scale = np.repeat(placed.arrays.scale, 3)
    whole = (force_maps(placed) / scale).transpose(0, 3, 1, 2).reshape(m, 6, 3 * n)
    forces = np.linalg.pinv(whole, rcond=RANK) @ (placed.hover / scale)[..., None]
    rows, bias = joint_maps(placed)
    return np.asarray(bias + (rows.reshape(m, -1, 3 * n) @ forces)[..., 0])


def joint_limited_values(
    placed: PlacedDesign, kind: str, tolerance: float, lost: int = -1
) -> Floats:
    """Returns (m,) certified lower bounds of a joint-limited margin, N or N·m; -inf: no hover.

    Args:
        placed: the design.
        kind: "force" or "torque".
        tolerance: of the bounds, relative.
        lost: an apparatus that pushes nothing.

    Raises:
        AnalysisError: gimbals with limits or least thrusts, whose sets are not balls.
    """
    arrays = placed.arrays
    if not arrays.shapes.balls.all():
        raise AnalysisError(
            "joint-limited margins of designs need gimbals without limits and no least thrust."
        )
    force, torque = arrays.scale
    free = certify(placed, (kind,), tolerance, lost)[kind].bounds
    size = force if kind == "force" else torque
    rows, bias = joint_maps(placed)
    live = np.arange(placed.points.shape[1]) != lost
    scale = np.repeat([force, torque], 3)
    moves = _rounded(force_maps(placed)[:, live] * (force / scale))
    bends = _rounded(rows[:, :, live].transpose(0, 2, 3, 1) * (force / torque))
    limit = _rounded(np.r_[arrays.shapes.strengths[live] / force, arrays.efforts / torque])
    hover, bounds = _rounded(placed.hover / scale), np.empty((len(free), 2))
    joint_limited_slice.batch(
        kind == "torque", moves, bends, limit, hover, _rounded(bias / torque),
        np.ascontiguousarray(free / size), tolerance, bounds,
    )  # fmt: skip
    return np.where(np.isnan(bounds[:, 0]), -np.inf, bounds[:, 0] * size)


def _rounded(x: Floats) -> Floats:
    return np.ascontiguousarray(np.round(x, DIGITS))
