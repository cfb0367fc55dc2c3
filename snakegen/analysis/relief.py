"""Relief: joint torques of an arm that thrust takes over, and the tip forces of both together.

Vectoring apparatuses on a fixed base do not fly: they are actuators beside the servos. The classes
of free flight do not apply to them. Gimbals are taken as free to turn; their own torques are not
counted.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import Wrenches, finite, joint_torques
from snakegen.statics.thrust_relief import (
    Relieved,
    ThrustMap,
    force_set,
    inner_ball,
    least_use,
    thrust_map,
    tip_force,
)
from snakegen.statics.tip import find_tip, tip_pose

COMMAND = "relief"
ORDER = 77
EXAMPLE = "dragon4 --set base=fixed --joint joint1_yaw=0.4"
_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True)
class ReliefResult:
    """What thrust does for an arm in a posture.

    Attributes:
        load: (k,) N m of the chain's joints without thrust.
        thrust: servos' and apparatuses' limits and the map between them.
        relieved: forces that make the highest share of servo torque least.
        along: by direction, the tip force of servos and thrust together.
        alone: by direction, the tip force of the servos alone [N].
        corners: (c, 3) N, forces at the tip that servos and thrust bear together, world axes:
            their hull lies within the set of all; those along directions without a limit end at
            100 times the largest of the others. None where the posture itself is not borne.
        radius: N, borne in every direction: of the largest ball about 0 in that hull; nan: none.
        apparatuses: their names, with their links.
    """

    load: Floats
    thrust: ThrustMap
    relieved: Relieved
    along: dict[str, Relieved]
    alone: dict[str, float]
    corners: Floats
    radius: float
    apparatuses: tuple[str, ...]

    @property
    def torque(self) -> Floats:
        """Joint torques (k,) [N m] that are left with the relieving thrust."""
        return np.asarray(self.load - self.thrust.relief @ self.relieved.forces.ravel())

    @property
    def use(self) -> float:
        """Highest share of a servo's torque without thrust."""
        return float(np.max(np.abs(self.load) / self.thrust.effort))

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        worst = int(np.argmax(np.abs(self.load) / self.thrust.effort))
        out = [
            ("servos alone", f"{100 * self.use:.3g} % of {self.thrust.joints[worst]}'s torque"),
            ("with thrust", f"{100 * self.relieved.value:.3g} % at best, no less than "
             f"{100 * self.relieved.bound:.3g} %"),
        ]  # fmt: skip
        for j, force in enumerate(self.relieved.forces):
            way = " ".join(f"{x:+.2f}" for x in np.round(force, 2) + 0.0)
            size = float(np.linalg.norm(force))
            out.append((self.apparatuses[j], f"{size:.4g} N of {self.thrust.limit[j]:.4g}: {way}"))
        for name, both in self.along.items():
            alone = _newtons(self.alone[name])
            out.append((f"tip force {name}", f"{_newtons(both.value)}, servos alone {alone}"))
        every = f"{_newtons(self.radius)} at least, of {len(self.corners)} corners' hull"
        out.append(("tip force, every direction", every))
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
            "tip_force_N": {k: v.value for k, v in self.along.items()},
            "tip_force_bound_N": {k: v.bound for k, v in self.along.items()},
            "tip_force_servos_alone_N": self.alone,
            "tip_force_corners_N": self.corners.tolist(),
            "tip_force_every_direction_N": None if np.isnan(self.radius) else self.radius,
        }


def _newtons(force: float) -> str:
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
    static = joint_torques(robot, q, wrenches=wrenches, gravity=g, terms="static")
    load = np.asarray(static)[index]
    thrust = thrust_map(robot, q)
    none = ThrustMap(thrust.joints, 0.0 * thrust.relief, 0.0 * thrust.limit, thrust.effort)
    J = tip_pose(robot, q, find_tip(robot)).jacobian[:3, index]
    ways = dict(zip(_AXES, np.kron(np.eye(3), np.array([[1.0], [-1.0]])), strict=True))
    along = {name: tip_force(thrust, load, J.T @ u) for name, u in ways.items()}
    corners = force_set(thrust, load, J)
    alone = {name: tip_force(none, load, J.T @ u).value for name, u in ways.items()}
    names = robot.apparatus_names
    best, radius = least_use(thrust, load), inner_ball(corners)
    return ReliefResult(load, thrust, best, along, alone, corners, radius, names)
