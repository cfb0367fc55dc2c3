"""A body as planners see it: swept shapes, CoG, thrust points, and how far each can move.

Gimbals turn as hover needs, so what they carry is taken at all angles of both axes: the solid of
revolution about the roll axis that holds it, a cylinder. A clearance of that body holds whatever
the gimbals do.

Gimbals also move the CoG and the thrust points, by an offset along ``u⊥/‖u⊥‖``, u⊥ the part of the
vertical across the roll axis. Beside a vertical link that direction is any, so the model takes
``u⊥ / max(‖u⊥‖, STEEP)``, which changes by at most 1/STEEP per radian and vanishes there, and
states the rest as an uncertainty (`Snapshot.slack`). Of the two pairs of gimbal angles that hover,
the one with a pitch within ±90° is meant: a body that starts level keeps it unless a link passes
the vertical.
"""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats, quaternion_xyzw, rotation_about
from snakegen.errors import PlanError
from snakegen.planning.mounts import STEEP, Mounts, mounts_of, zero_thrust
from snakegen.planning.reach import Reach, reaches
from snakegen.planning.shapes import Shapes, shapes_of
from snakegen.robot.posture import driven_joints
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.scene.solids import Solid
from snakegen.wrench_margins.force_sets import ForceSets

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A body at one pose.

    Attributes:
        q: (nq,) configuration, gimbals at 0.
        points: (n, 3) m, thrust points from the CoG, world axes.
        uncertainty: (n,) m, how far each can be from there.
        slack: m, how far the body can be beside where the CoG puts it.
        upright: (n,) cosine of the angle between each roll axis and the horizontal.
    """

    q: Floats
    points: Floats
    uncertainty: Floats
    slack: float
    upright: Floats


class PlannedBody:
    """A robot among obstacles: poses, distances, thrust points; see the module.

    A pose is ``[CoG (3) m, rotation vector r (3) rad, joints (k) rad]``; the root link's attitude
    is ``exp(r) Rz(heading)``.

    Attributes:
        robot: of which.
        names: joints of the pose.
        low, high: (k,) rad, their limits.
        mass: kg.
        heading: rad, the root link's where r is 0.
        shapes: for collisions.
    """

    def __init__(self, robot: Robot, solids: tuple[Solid, ...] = ()) -> None:
        """Prepares the model.

        Raises:
            PlanError: a robot that does not fly with virtual single rotors in all directions.
        """
        self.robot = robot
        check_robot(robot)
        self.model, self.data = robot.model, robot.model.createData()
        self.names = tuple(driven_joints(robot))
        joints = [self.model.joints[self.model.getJointId(n)] for n in self.names]
        self.at = np.array([j.idx_q for j in joints])
        self.at_v = np.array([j.idx_v for j in joints])
        self.ids = [self.model.getJointId(n) for n in self.names]
        self.low, self.high, _ = robot.limits(self.names)
        self.mass = robot.mass
        self.heading = 0.0
        self.neutral = np.array(pin.neutral(self.model))
        self.shapes: Shapes = shapes_of(robot, solids)
        self.places = pin.GeometryData(self.shapes.geometry)

    def turned(self, heading: float) -> "PlannedBody":
        """Returns the same body with poses from another heading [rad]."""
        out = copy(self)
        out.heading = heading
        return out

    def attitude(self, vector: Floats) -> Floats:
        """Returns the root link's attitude (3, 3) at a rotation vector (3,)."""
        return attitude(vector, self.heading)

    @cached_property
    def mounts(self) -> Mounts:
        """Where the apparatuses are."""
        return mounts_of(self.robot)

    @cached_property
    def reach(self) -> Reach:
        """How far joints move shapes and thrust points from the CoG."""
        return reaches(self.model, self.ids, self.mounts, self.shapes, self.mass)

    @cached_property
    def sets(self) -> ForceSets:
        """What the apparatuses can push with; balls."""
        return self.robot.force_shapes

    @property
    def weight(self) -> float:
        """N."""
        return self.mass * GRAVITY

    def at_pose(self, pose: Floats) -> Snapshot:
        """Returns the body at a pose (6 + k,)."""
        q = self.neutral.copy()
        q[3:7] = quaternion_xyzw(self.attitude(pose[3:6]))
        q[self.at] = pose[6:]
        pin.centerOfMass(self.model, self.data, q)
        com = np.array(self.data.com[0])
        m = self.mounts
        turns = np.array([self.data.oMi[j].rotation for j in m.joint])
        origin = np.array([self.data.oMi[j].translation for j in m.joint])
        axis = np.einsum("nij,nj->ni", turns, m.axis)
        across = UP - axis * axis[:, 2:]
        upright = np.linalg.norm(across, axis=1)
        across /= np.maximum(upright, STEEP)[:, None]
        zero = self._zero_thrust(turns)
        com = com + (m.moment[:, None] * (across - zero)).sum(axis=0) / self.mass
        points = origin + np.einsum("nij,nj->ni", turns, m.pivot) + m.lever[:, None] * across - com
        lost = np.maximum(0.0, 1.0 - upright / STEEP)
        slack = float(np.abs(m.moment) @ lost + m.spill.sum()) / self.mass
        q[:3] += pose[:3] - com
        return Snapshot(q, points, np.abs(m.lever) * lost + m.loose + slack, slack, upright)

    def _zero_thrust(self, turns: Floats) -> Floats:
        """Returns the thrust directions (n, 3), world, at gimbal angles of 0."""
        return np.einsum("nij,nj->ni", turns, self.zero_thrusts)

    @cached_property
    def zero_thrusts(self) -> Floats:
        """(n, 3) thrust directions at gimbal angles of 0, in each link's body."""
        return np.array([zero_thrust(self.robot, j) for j in range(len(self.mounts.joint))])

    @cached_property
    def sides(self) -> Floats:
        """(n, 3) the axes, in each link's body, that are horizontal where a roll of 0 hovers."""
        return np.cross(self.mounts.axis, self.zero_thrusts)

    def distances(self, q: Floats) -> Floats:
        """Returns the signed distances (p,) [m] of all pairs at q: obstacles first, then self."""
        pin.computeDistances(self.model, self.data, self.shapes.geometry, self.places, q)
        return np.array([r.min_distance for r in self.places.distanceResults])

    def lines(self) -> Floats:
        """Returns the ends (2 N, 3) [m, world] of all links at the last pose looked at."""
        out = []
        for joint, ends in self.shapes.links:
            place = self.data.oMi[joint]
            out += [place.rotation @ e + place.translation for e in ends]
        return np.array(out)

    def margins(self, points: Floats, tolerance: float = 1e-2) -> tuple[Floats, Floats]:
        """Returns certified lower bounds of force [N] and torque [N·m] margins, (m,) each.

        Args:
            points: (m, n, 3) m, thrust points from the CoG, world axes.
            tolerance: of the search.
        """
        from snakegen.wrench_margins.vectored import set_margins

        hover = np.zeros((len(points), 6))
        hover[:, 2] = self.weight
        sets = replace(self.sets, points=np.ascontiguousarray(points))
        found = set_margins(
            sets,
            hover,
            force_scale=self.robot.force_scale,
            torque_scale=self.robot.torque_scale,
            tolerance=tolerance,
        )
        force, torque = found.force_bounds[:, 0], found.torque_bounds[:, 0]
        return np.nan_to_num(force, nan=-1.0), np.nan_to_num(torque, nan=-1.0)


def attitude(vector: Floats, heading: float) -> Floats:
    """Returns ``exp(vector) Rz(heading)``, (3, 3)."""
    return np.asarray(pin.exp3(np.array(vector)) @ rotation_about(UP, heading))


def check_robot(robot: Robot) -> None:
    """Refuses robots whose hover the planner does not know how to certify.

    Raises:
        PlanError: which, and why.
    """
    if not robot.floating or not robot.modules.apparatuses:
        raise PlanError(f"{robot.name} does not fly: a floating base and rotors are needed.")
    if not driven_joints(robot):
        raise PlanError(f"{robot.name} has no driven joints: nothing to bend.")
    if robot.modules.control.get("mode") == "dual_rotor":
        raise PlanError(
            f"{robot.name} flies in dual-rotor mode, in which the root link stays level: it cannot "
            "turn up through an opening. control.mode=virtual_single_rotor with three apparatuses "
            "or more could."
        )
    sets = robot.force_shapes
    if not sets.balls.all():
        names = [str(j + 1) for j in np.flatnonzero(~sets.balls)]
        raise PlanError(
            f"{robot.name}: apparatus {', '.join(names)} cannot push in every direction from 0 N "
            "(gimbal limits or a least thrust): margins between waypoints are proved for free "
            "gimbals alone."
        )
