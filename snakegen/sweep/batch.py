"""Margins of a batch of postures of one robot: hover gimbals, both modes, self-collision."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from snakegen.errors import AnalysisError
from snakegen.geometry import Floats
from snakegen.kernels.postures import hover_postures, self_distances
from snakegen.margins.thrust import thrust_margins
from snakegen.margins.vectored import vectored_margins
from snakegen.robot import GRAVITY, Robot

CHUNK = 4096  # postures at a time inside a batch: bounds the memory


@dataclass(frozen=True, eq=False)
class Body:
    """What is the same for every posture of a sweep."""

    robot: Robot
    joints: tuple[str, ...]  # that are sampled
    indices: np.ndarray
    base: Floats
    tolerance: float

    @staticmethod
    def of(robot: Robot, joints: tuple[str, ...], base: Floats, tolerance: float) -> "Body":
        """Returns the body of a sweep over `joints`.

        Raises:
            AnalysisError: a robot without apparatuses or with a fixed base.
        """
        if not robot.modules.apparatuses or not robot.floating:
            raise AnalysisError(f"{robot.name} cannot hover: a sweep of margins needs rotors.")
        indices = np.array([robot.joint_names.index(n) for n in joints], np.int64)
        return Body(robot, joints, indices, base, tolerance)


def columns(body: Body) -> list[str]:
    """Returns the names of the columns that a sweep writes."""
    return [*body.joints, *MARGINS]


MARGINS = (
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
    "self_collision",
)


def evaluate(body: Body, samples: Floats) -> pa.Table:
    """Returns a table with a row per posture: joints, certified margins of both modes, clearance.

    `force_margin` and `torque_margin` are the certified lower bounds of the vectored mode (N,
    N m); wrench margins are scaled; NaN where hover is infeasible.

    Args:
        body: robot and joints.
        samples: (m, k) rad.
    """
    parts = [_chunk(body, samples[i : i + CHUNK]) for i in range(0, len(samples), CHUNK)]
    return pa.concat_tables(parts)


def _chunk(body: Body, samples: Floats) -> pa.Table:
    robot = body.robot
    m, rotors, limit = len(samples), robot.rotors, robot.gimbals.limit
    dual = np.empty((m, 6, rotors.body.size))
    points, hover = np.empty((m, limit.size, 3)), np.empty((m, 6))
    bodies, ends, rods = _segments(robot)
    spine, discs = np.empty((m, len(rods), 2, 3)), np.empty((m, rotors.body.size, 3))
    low, high, _ = robot.limits(robot.joint_names)
    hover_postures(
        robot.tree, rotors, robot.gimbals, low, high, body.base, body.indices,
        np.ascontiguousarray(samples), GRAVITY, dual, points, hover, spine, discs, bodies, ends,
    )  # fmt: skip
    distance = np.empty(m)
    radii = np.array([0.5 * r.diameter for a in robot.modules.apparatuses for r in a.rotors])
    self_distances(spine, discs, rods, radii, _owners(robot), distance)
    scales: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    exact = thrust_margins(dual, rotors.thrust_min, rotors.thrust_max, hover, **scales)
    free = vectored_margins(points, limit, hover, tolerance=body.tolerance, **scales)
    data: dict[str, np.ndarray] = {n: samples[:, i] for i, n in enumerate(body.joints)}
    data |= {
        "wrench_margin": free.wrench,
        "force_margin": free.force_bounds[:, 0],
        "force_margin_upper": free.force_bounds[:, 1],
        "torque_margin": free.torque_bounds[:, 0],
        "torque_margin_upper": free.torque_bounds[:, 1],
        "closed": free.closed,
        "dual_attitude_altitude_margin": exact.attitude_altitude,
        "dual_wrench_margin": exact.wrench,
        "dual_force_margin": exact.force,
        "dual_torque_margin": exact.torque,
        "self_distance": distance,
        "self_collision": distance < 0.0,
    }
    return pa.table({k: pa.array(np.ascontiguousarray(v)) for k, v in data.items()})


def _segments(robot: Robot) -> tuple[np.ndarray, Floats, Floats]:
    """Returns body, ends (L, 2, 3) and radius of each link's segment."""
    from snakegen.description.solids_of import rod_radii

    names = list(robot.modules.lengths)
    placed = [robot.body_of_link(n) for n in names]
    lengths = [robot.modules.lengths[n] for n in names]
    ends = [
        [p, p + r @ np.array([s, 0.0, 0.0])] for (_, r, p), s in zip(placed, lengths, strict=True)
    ]
    return (
        np.array([b for b, _, _ in placed], np.int64),
        np.array(ends, float).reshape(-1, 2, 3),
        rod_radii(robot.urdf, names),
    )


def _owners(robot: Robot) -> np.ndarray:
    """Returns the index of the link that carries each rotor, -1 where it is not known."""
    names = list(robot.modules.lengths)
    out = [
        names.index(a.link) if a.link in names else -1
        for a in robot.modules.apparatuses
        for _ in a.rotors
    ]
    return np.array(out, np.int64)
