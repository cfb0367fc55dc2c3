"""Relief: joint torques of an arm that thrust takes over, and the tip forces of both together.

Vectoring apparatuses on a fixed base do not fly: they are actuators beside the servos. The classes
of free flight do not apply to them. Gimbals are taken as free to turn; their own torques are not
counted, but their weight is: the relieved torques are those with gimbals along their forces, as
mission `hold` has them, and so are forces at the tip; their bounds hold at any
angle of the gimbals.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import Wrenches, finite, joint_torques
from snakegen.statics.relieved_posture import (
    AIMED,
    RelievedPosture,
    borne_at_tip,
    free_gimbals,
    relieved_posture,
)
from snakegen.statics.thrust_relief import (
    Relieved,
    ThrustMap,
    thrust_map,
    tip_bound,
    tip_force,
)
from snakegen.statics.tip import find_tip, tip_pose

COMMAND = "relief"
ORDER = 77
EXAMPLE = "dragon4 --set base=fixed --joint joint1_yaw=0.4"
_AXES = {f"{sign}{axis}": float(f"{sign}1") * np.eye(3)["xyz".index(axis)]
         for axis in "xyz" for sign in "+-"}  # fmt: skip
_GRID = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_WAYS = np.array([v / np.linalg.norm(v) for v in _GRID if v @ v in (1.0, 3.0)])
"""Directions of a cube's axes and corners, (14, 3)."""


@dataclass(frozen=True)
class ReliefResult:
    """What thrust does for an arm in a posture.

    Attributes:
        load: (k,) N·m of the chain's joints without thrust, gimbals as given.
        posture: gimbals along the forces that make the highest share of servo torque least.
        along: by direction, the tip force of servos and thrust together.
        alone: by direction, the tip force of the servos alone [N].
        sizes: (14,) N, forces at the tip that servos and thrust hold together along the axes and
            corners of a cube, world axes; inf without a limit, nan where none is borne.
        apparatuses: their names, with their links.
    """

    load: Floats
    posture: RelievedPosture
    along: dict[str, Relieved]
    alone: dict[str, float]
    sizes: Floats
    apparatuses: tuple[str, ...]

    @property
    def thrust(self) -> ThrustMap:
        """Limits, and the map from forces to joints, with the gimbals along their forces."""
        return self.posture.thrust

    @property
    def relieved(self) -> Relieved:
        """The forces that relieve the joints most."""
        return self.posture.relieved

    @property
    def least(self) -> float:
        """The smallest of the tip forces of all directions [N]; nan: one has none."""
        return float(self.sizes.min())

    @property
    def corners(self) -> Floats:
        """The forces of those directions (c, 3) [N] that have a limit."""
        limited = np.isfinite(self.sizes)
        return np.asarray(self.sizes[limited, None] * _WAYS[limited])

    @property
    def torque(self) -> Floats:
        """Joint torques (k,) [N·m] that are left with the relieving thrust."""
        return self.posture.torque

    @property
    def use(self) -> float:
        """Highest share of a servo's torque without thrust."""
        return float(np.max(np.abs(self.load) / self.thrust.effort))

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        worst = int(np.argmax(np.abs(self.load) / self.thrust.effort))
        out = [
            ("servos alone", f"{100 * self.use:.3g} % of {self.thrust.joints[worst]}'s torque"),
            ("with thrust", f"{_percent(self.relieved.value)} at best, no less than "
             f"{_percent(self.relieved.bound)}"),
        ]  # fmt: skip
        for j, force in enumerate(self.relieved.forces):
            way = " ".join(f"{x:+.2f}" for x in np.round(force, 2) + 0.0)
            size = float(np.linalg.norm(force))
            out.append((self.apparatuses[j], f"{size:.4g} N of {self.thrust.limit[j]:.4g}: {way}"))
        off = self.posture.off
        if (off > AIMED).any():
            j = int(np.argmax(off))
            text = f"gimbals of {self.apparatuses[j]} end {off[j]:.3g} rad from its force"
            out.append(("not reached", text))
        for name, both in self.along.items():
            alone = _newtons(self.alone[name])
            most = f" (≤ {both.bound:.4g})" if np.isfinite(both.value) else ""
            text = f"{_newtons(both.value)}{most}, servos alone {alone}"
            out.append((f"tip force {name}", text))
        text = f"{_newtons(self.least)}, the least of {len(self.sizes)} directions"
        out.append(("tip force, all round", text))
        return out

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        joints = self.thrust.joints
        return {
            "use_servos_alone": self.use,
            "use_with_thrust": self.relieved.value,
            "use_with_thrust_bound": self.relieved.bound,
            "torque_alone_Nm": dict(zip(joints, self.load.tolist(), strict=True)),
            "torque_relieved_Nm": dict(zip(joints, self.torque.tolist(), strict=True)),
            "forces_N": self.relieved.forces.tolist(),
            "thrust_limit_N": self.thrust.limit.tolist(),
            "tip_force_N": {k: _plain(v.value) for k, v in self.along.items()},
            "tip_force_bound_N": {k: _plain(v.bound) for k, v in self.along.items()},
            "tip_force_servos_alone_N": {k: _plain(v) for k, v in self.alone.items()},
            "tip_force_corners_N": self.corners.tolist(),
            "tip_force_least_N": _plain(self.least),
        }


def _plain(force: float) -> float | None:
    return force if np.isfinite(force) else None


def _newtons(force: float) -> str:
    if np.isinf(force):
        return "no limit"
    return "none: they cannot hold the posture" if np.isnan(force) else f"{force:.4g} N"


def applies(robot: Robot) -> bool:
    """A fixed base and vectoring apparatuses with gimbals."""
    apparatuses = robot.modules.apparatuses
    gimballed = all(a.roll and a.pitch for a in apparatuses)
    return not robot.floating and bool(apparatuses) and gimballed and bool(robot.chain_joints)


def analyze(
    robot: Robot, q: ArrayLike, *, wrenches: Wrenches = None, gravity: ArrayLike = (0.0, 0.0, -9.81)
) -> ReliefResult:
    """Returns what thrust takes off an arm's joints, and what its tip can push with it.

    Args:
        robot: on a fixed base, with vectoring apparatuses whose gimbals turn any way.
        q: (nq,) posture.

    Options:
        wrenches: loads, as in "link4=0,0,-5,0,0,0": [force; torque] at a link, world axes
        gravity: m/s², world; 0,0,0 for none

    Raises:
        AnalysisError: a floating base, no apparatus, or one without gimbals.
    """
    if not applies(robot):
        raise AnalysisError(f"{robot.name}: relief needs a fixed base and apparatuses on gimbals.")
    q = robot.validate_configuration(q)
    g = finite(gravity, (3,), "gravity")
    index = [robot.joint_names.index(n) for n in robot.chain_joints]

    def load_at(posture: Floats) -> Floats:
        static = joint_torques(robot, posture, wrenches=wrenches, gravity=g, terms="static")
        return np.asarray(static)[index]

    load, posture = load_at(q), relieved_posture(robot, q, g, load_at)
    free, reach = free_gimbals(robot, q, g), thrust_map(robot, q)
    none = replace(reach, relief=0.0 * reach.relief, limit=0.0 * reach.limit)
    at_best = replace(free.thrust, effort=reach.effort + free.swing)
    J = tip_pose(robot, q, find_tip(robot)).jacobian[:3, index]
    borne = [borne_at_tip(robot, posture.q, load_at, J.T @ u) for u in _WAYS]
    along, alone = {}, {}
    for name, u in _AXES.items():
        k = int(np.argmax(_WAYS @ u))
        along[name] = replace(borne[k], bound=tip_bound(at_best, load + free.shift, J.T @ u))
        alone[name] = tip_force(none, load, J.T @ u).value
    sizes = np.array([one.value for one in borne])
    names = robot.apparatus_names
    return ReliefResult(load, posture, along, alone, sizes, names)


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %" if share >= 1e-5 or share <= 0 else "less than 0.001 %"
