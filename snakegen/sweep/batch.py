"""Margins of a batch of postures of one robot: hover gimbals, both modes, self-collision."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyarrow as pa

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.sweep.worker import NUMBERS, Task, work

MARGINS = (*NUMBERS, "self_collision")
FLAGS = ("closed", "self_collision")  # columns that are true or false


@dataclass(frozen=True, eq=False)
class Body:
    """What is the same for every posture of a sweep."""

    robot: Robot
    joints: tuple[str, ...]  # that are sampled
    indices: np.ndarray
    base: Floats
    tolerance: float
    held: Mapping[str, float]  # rad, by joint; those in neither are at 0

    @staticmethod
    def of(
        robot: Robot,
        joints: tuple[str, ...],
        base: Floats,
        tolerance: float,
        held: Mapping[str, float] | None = None,
    ) -> "Body":
        """Returns the body of a sweep over `joints`, with joints held at angles [rad].

        Raises:
            AnalysisError: a robot without apparatuses or with a fixed base.
        """
        if not robot.modules.apparatuses:
            raise AnalysisError(f"{robot.name} cannot hover: a sweep of margins needs rotors.")
        if not robot.floating:
            raise AnalysisError(
                f"{robot.name} has a fixed base, whose attitude is base.pose: a sweep is of flight "
                "margins and needs a floating one."
            )
        indices = np.array([robot.joint_names.index(n) for n in joints], np.int64)
        return Body(robot, joints, indices, base, tolerance, dict(held or {}))

    @cached_property
    def task(self) -> Task:
        """The same as plain arrays."""
        robot = self.robot
        low, high, _ = robot.limits(robot.joint_names)
        bodies, ends, rods = _segments(robot)
        radii = [0.5 * r.diameter for a in robot.modules.apparatuses for r in a.rotors]
        return Task(
            robot.tree, robot.rotors, robot.gimbals, robot.force_shapes, low, high, self.indices,
            self.base, bodies, ends, rods, np.array(radii), _owners(robot), robot.force_scale,
            robot.torque_scale, self.tolerance, GRAVITY,
            np.array([robot.joint_names.index(n) for n in self.held], np.int64),
            np.array([*self.held.values()], float),
        )  # fmt: skip


def columns(body: Body) -> list[str]:
    """Returns the names of the columns that a sweep writes."""
    return [*body.joints, *MARGINS]


def evaluate(body: Body, samples: Floats) -> pa.Table:
    """Returns a table with a row per posture: joints, certified margins of both modes, clearance.

    `force_margin`, `torque_margin` and `wrench_margin` are the certified lower bounds of the
    vectored mode within gimbal and thrust limits (N, N·m, scaled), those that end in `_upper` the
    upper ones; NaN where hover is infeasible.

    Args:
        body: robot and joints.
        samples: (m, k) rad.
    """
    return table(body.joints, samples, work(body.task, samples))


def table(joints: tuple[str, ...], samples: Floats, numbers: Floats) -> pa.Table:
    """Returns samples (m, k) and what `work` made of them (m, 12) as the table of a sweep."""
    data: dict[str, np.ndarray] = {name: samples[:, i] for i, name in enumerate(joints)}
    data |= {name: numbers[:, i] for i, name in enumerate(NUMBERS)}
    data["closed"] = data["closed"] > 0.5
    data["self_collision"] = data["self_distance"] < 0.0
    return pa.table({k: pa.array(np.ascontiguousarray(v)) for k, v in data.items()})


def _segments(robot: Robot) -> tuple[np.ndarray, Floats, Floats]:
    """Returns body, ends (L, 2, 3) and radius of each link's segment."""
    from snakegen.description.meshes.solids_of import rod_radii

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
