"""A body of drums and casters at rest on a plane: attitude, contact points, loads by compliance.

World axes: z is the plane's normal, the base's heading that of the configuration. A drum is a ring
of passive wheels of radius r about its link's x axis; it touches the ground at its lowest point and
transmits a tangential force along its wheels' axles (HA eq 3); across them wheels roll, against
their rolling and bearing friction (`plant.losses`). A caster has two frictionless balls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import Floats, rotation_about
from snakegen.errors import AnalysisError
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.kernels.kinematics.jacobians import tip_jacobian
from snakegen.robot.robot import Robot

_STEP = 0.2  # rad, largest turn of one step of the search for rest
_TOLERANCE = 1e-10  # m, that the centre of gravity still falls in a step at rest
_UP = np.array([0.0, 0.0, 1.0])
COMPLIANCE = 5e-6  # m/N of a contact: 0.1 mm under a quarter of HA's weight (assumed)


@dataclass(frozen=True, eq=False)
class Contact:
    """A point that may carry: the lowest of a drum, or a ball of a caster."""

    name: str
    body: int  # index in the robot's tree
    point: Floats  # (3,) m, from the base origin, world axes
    axle: Floats  # (3,) along the wheels' axles in the plane; 0: frictionless


@dataclass(frozen=True, eq=False)
class Stance:
    """A body at rest, with k contacts and generalized coordinates [base twist; held joints].

    Attributes:
        robot: the body.
        rotation: (3, 3) attitude of the base.
        angles: (n,) of all joints.
        joints: names of the held joints: servos of the chain, then screws.
        stiffness: (m,) N·m/rad of the held joints; inf: a screw.
        effort: (m,) N·m.
        contacts: k points.
        normal, along: (k, 6 + m) velocity of each contact along z and along its axle.
        gravity: (6 + m, 3) generalized force of a gravity vector [m/s²].
        across: (k, 6 + m) velocity of the touching wheel's centre across its axle.
        rolling: force that holds a wheel from rolling, over its load.
        play: rad, of the servos' joints, from stop to stop.
        gap: (k,) m over the plane before joints yield.
    """

    robot: Robot
    rotation: Floats
    angles: Floats
    joints: tuple[str, ...]
    stiffness: Floats
    effort: Floats
    contacts: tuple[Contact, ...]
    normal: Floats
    along: Floats
    gravity: Floats
    across: Floats
    rolling: float
    play: float
    gap: Floats

    @property
    def drums(self) -> NDArray[np.bool_]:
        """Which contacts are drums, (k,)."""
        return np.array([bool(c.axle.any()) for c in self.contacts])

    def place(self, body: int, point: Floats) -> Floats:
        """Returns a body's point (3,) [m] from the base origin, world axes."""
        return _jacobian(self.robot, self.rotation, self.angles, body, point, ())[0]

    def load_at(self, link: str, point: Sequence[float]) -> Floats:
        """Returns the generalized force (6 + m, 3) of a force (3,) [N] at a point of a link."""
        body, turn, shift = self.robot.body_of_link(link)
        spot = shift + turn @ np.asarray(point, float)
        return _jacobian(self.robot, self.rotation, self.angles, body, spot, self.joints)[1].T


def stance(robot: Robot, q: Floats, compliance: float = COMPLIANCE) -> Stance:
    """Returns how a robot rests on a plane with its joints as in q, its heading kept.

    Raises:
        AnalysisError: fewer than two drums, or drums that are not rings of wheels about their x.
    """
    angles = robot.angles(q)
    rotation = _at_rest(robot, robot.base_pose(q)[0], angles)
    servos = {s.joint: s.stiffness for s in robot.modules.servos}
    chain = [name for name in robot.chain_joints if name in servos]
    screws = [s.joint for s in robot.modules.screws]
    joints = (*chain, *screws)
    points = _contacts(robot, rotation, angles)
    low = min(c.point[2] for c in points)
    rows = [_moving(robot, rotation, angles, c, joints) for c in points]
    wheel = robot.modules.screws[0].wheel_radius
    centres = [_moving(robot, rotation, angles, c, joints, wheel) for c in points]
    return Stance(
        robot,
        rotation,
        angles,
        joints,
        np.array([servos[name] for name in chain] + [np.inf] * len(screws)),
        np.concatenate([robot.limits(chain)[2], [s.torque for s in robot.modules.screws]]),
        tuple(points),
        np.array([row[2] for row in rows]),
        np.array([c.axle @ row for c, row in zip(points, rows, strict=True)]),
        _gravity(robot, rotation, angles, joints),
        np.array([_UP @ np.cross(c.axle, row.T).T for c, row in zip(points, centres, strict=True)]),
        robot.modules.losses.arm / wheel,
        robot.modules.losses.play,
        np.array([c.point[2] - low for c in points]),
    )


def _jacobian(
    robot: Robot,
    rotation: Floats,
    angles: Floats,
    body: int,
    point: Floats,
    joints: Sequence[str],
) -> tuple[Floats, Floats]:
    """Returns a body's point (3,) [m] from the base origin, and its velocity's (3, 6 + m)."""
    place, _, J = tip_jacobian(robot.tree, rotation, angles, body, np.ascontiguousarray(point))
    x, y, z = place
    base = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # ω × p
    index = [robot.joint_names.index(name) for name in joints]
    return place, np.hstack([np.eye(3), base, J[:3, index]])


def _moving(
    robot: Robot,
    rotation: Floats,
    angles: Floats,
    contact: Contact,
    joints: Sequence[str],
    above: float = 0.0,
) -> Floats:
    """Returns the velocity (3, 6 + m) of a contact's material, or of a point `above` it [m]."""
    turns, places = forward(robot.tree, rotation, np.zeros(3), angles)
    at = turns[contact.body].T @ (contact.point + above * _UP - places[contact.body])
    return _jacobian(robot, rotation, angles, contact.body, at, joints)[1]


def _gravity(robot: Robot, rotation: Floats, angles: Floats, joints: Sequence[str]) -> Floats:
    """Returns the generalized force (6 + m, 3) of a gravity vector (3,) [m/s²]."""
    total = np.zeros((6 + len(joints), 3))
    for body, mass in enumerate(robot.tree.mass):
        if mass > 0:
            point = robot.tree.com[body]
            total += mass * _jacobian(robot, rotation, angles, body, point, joints)[1].T
    return total


def _contacts(robot: Robot, rotation: Floats, angles: Floats) -> list[Contact]:
    """Returns the points of drums and casters that can touch the plane."""
    turns, places = forward(robot.tree, rotation, np.zeros(3), angles)
    out = []
    for screw in robot.modules.screws:
        body = robot.body_of_joint(screw.joint)
        axis = turns[body] @ robot.tree.axis[body]
        down = -np.array([0.0, 0.0, 1.0]) + axis[2] * axis
        if np.linalg.norm(down) < 0.1:
            raise AnalysisError(f"{screw.joint} is upright: its wheels do not reach the ground.")
        down /= np.linalg.norm(down)
        axle = np.cos(screw.alpha) * axis + np.sin(screw.alpha) * np.cross(axis, down)
        axle[2] = 0.0
        axle /= np.linalg.norm(axle)
        out.append(Contact(screw.joint, body, places[body] + screw.radius * down, axle))
    for caster in robot.modules.casters:
        body, turn, shift = robot.body_of_link(caster.link)
        for side, label in ((1.0, "left"), (-1.0, "right")):
            ball = shift + turn @ np.array([0.0, side * caster.track / 2, caster.radius])
            point = places[body] + turns[body] @ ball - [0.0, 0.0, caster.radius]
            out.append(Contact(f"{caster.link} {label}", body, point, np.zeros(3)))
    return out


def _at_rest(robot: Robot, rotation: Floats, angles: Floats) -> Floats:
    """Returns the attitude (3, 3) at which the centre of gravity is lowest over the plane.

    Sequential linear programs in small turns about x and y: ``min z_c`` with every contact at or
    above the plane. Only steps that lower it are taken, so that a body on a line stays upright.
    """
    from scipy.optimize import linprog

    heading = np.arctan2(rotation[1, 0], rotation[0, 0])
    rotation = rotation_about([0, 0, 1], heading)
    for _ in range(60):
        points = np.array([c.point for c in _contacts(robot, rotation, angles)])
        pose = forward(robot.tree, rotation, np.zeros(3), angles)
        _, cog = centre_of_gravity(robot.tree, *pose)
        lift = -points[:, 2].min()
        rows = np.column_stack([-points[:, 1], points[:, 0], -np.ones(len(points))])
        cost = [cog[1], -cog[0], 1.0]
        found = linprog(
            cost, rows, points[:, 2], bounds=[(-_STEP, _STEP), (-_STEP, _STEP), (None, None)]
        )
        if found.x is None or not found.fun < lift - _TOLERANCE:
            break
        size = float(np.hypot(found.x[0], found.x[1]))
        if size < 1e-12:
            break
        axis = np.array([found.x[0], found.x[1], 0.0]) / size
        rotation = rotation_about(axis, size) @ rotation
    return np.asarray(rotation)
