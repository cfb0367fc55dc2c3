"""What a worker of a sweep runs: arrays in, margins out.

A worker imports this module alone: no Pinocchio, pyarrow or scipy, a third of the memory that
reading the robot takes.
"""

from dataclasses import dataclass, replace

import numpy as np

from snakegen import __version__
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.kernels.core.types import Gimbals, Ints, Mechanism, Rotors, Tree
from snakegen.kernels.margins.posture_batch import PlacedPostures, hover_postures, self_distances
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.thrust import thrust_margins
from snakegen.wrench_margins.vectored import set_margins

CHUNK = 4096  # postures at a time inside a batch: bounds the memory
NUMBERS = (
    "wrench_margin",
    "force_margin",
    "force_margin_upper",
    "torque_margin",
    "torque_margin_upper",
    "closed",
    "dual_attitude_altitude_margin",
    "dual_wrench_margin",
    "dual_force_margin",
    "dual_torque_margin",
    "self_distance",
    "wrench_margin_upper",
)


@dataclass(frozen=True, eq=False)
class Task:
    """A robot and a question as plain arrays: all that a worker needs, in any process.

    Attributes:
        tree, rotors, gimbals: the robot.
        shapes: what its apparatuses can push with, in any posture.
        low, high: (n-1,) rad, limits of all joints.
        indices: (k,) which of the tree's angles are sampled.
        base: (3, 3) attitude of the root link.
        bodies, ends, rods: (L,), (L, 2, 3) m, (L,) m: body, ends and radius of each link's rod.
        radii, owners: (n_rotors,) m and index of the link that carries each rotor.
        force_scale, torque_scale: N and N·m.
        tolerance: of the certified margins.
        gravity: m/s².
        held, held_angles: (h,) which angles stay, and where [rad]; joints in neither are at 0.
        version: of snakegen, which a worker elsewhere must share.
    """

    tree: Tree
    rotors: Rotors
    gimbals: Gimbals
    shapes: ForceSets
    low: Floats
    high: Floats
    indices: Ints
    base: Floats
    bodies: Ints
    ends: Floats
    rods: Floats
    radii: Floats
    owners: Ints
    force_scale: float
    torque_scale: float
    tolerance: float
    gravity: float
    held: Ints
    held_angles: Floats
    version: str = __version__


def work(task: Task, samples: Floats) -> Floats:
    """Returns (m, 12), a row per posture, in the order of `NUMBERS`.

    Args:
        task: robot, joints, tolerance.
        samples: (m, k) rad.

    Raises:
        AnalysisError: this worker has another version of snakegen than the sweep.
    """
    if task.version != __version__:
        raise AnalysisError(
            f"a worker has snakegen {__version__}, the sweep {task.version}: install one version."
        )
    out = np.empty((len(samples), len(NUMBERS)))
    for i in range(0, len(samples), CHUNK):
        _chunk(task, np.ascontiguousarray(samples[i : i + CHUNK]), out[i : i + CHUNK])
    return out


def _chunk(task: Task, samples: Floats, out: Floats) -> None:
    m, rotors, limit = len(samples), task.rotors, task.gimbals.limit
    indices = np.concatenate([task.indices, task.held])
    samples = np.hstack([samples, np.tile(task.held_angles, (m, 1))])
    dual, hover = np.empty((m, 6, rotors.body.size)), np.empty((m, 6))
    frames = np.empty((m, limit.size, 3, 3))
    points, discs = np.empty((m, limit.size, 3)), np.empty((m, rotors.body.size, 3))
    spine, distance = np.empty((m, len(task.rods), 2, 3)), np.empty(m)
    hover_postures(
        Mechanism(task.tree, rotors, task.gimbals), (task.low, task.high), task.base, indices,
        samples, task.gravity, (task.bodies, task.ends),
        PlacedPostures(dual, points, frames, hover, spine, discs),
    )  # fmt: skip
    self_distances(spine, discs, task.rods, task.radii, task.owners, distance)
    exact = thrust_margins(
        dual, rotors.thrust_min, rotors.thrust_max, hover,
        force_scale=task.force_scale, torque_scale=task.torque_scale,
    )  # fmt: skip
    sets = replace(task.shapes, points=points, frames=frames @ task.shapes.frames)
    free = set_margins(
        sets, hover, tolerance=task.tolerance,
        force_scale=task.force_scale, torque_scale=task.torque_scale,
    )  # fmt: skip
    out[:, 0], out[:, 11] = free.wrench_bounds.T
    out[:, 1:3], out[:, 3:5] = free.force_bounds, free.torque_bounds
    out[:, 5] = free.closed
    out[:, 6], out[:, 7] = exact.attitude_altitude, exact.wrench
    out[:, 8], out[:, 9] = exact.force, exact.torque
    out[:, 10] = distance
