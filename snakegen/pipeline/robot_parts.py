"""Parts of a robot as URDF and MJCF both have them, in one posture and one set of axes.

Poses, axes and inertias are those of all joint coordinates at 0, in the axes of the file's world:
two files describe one robot where all parts agree, whatever frames each of them uses inside.
"""

from dataclasses import dataclass, field

import numpy as np

from snakegen.base.geometry import Floats

BASE = ""  # key of the body that no joint moves, or only the free joint of the root


@dataclass(frozen=True)
class JointPart:
    """A joint of one degree of freedom, or a ball or free joint.

    Attributes:
        kind: ``revolute``, ``prismatic``, ``ball``, ``floating`` or ``planar``.
        carrier: key of the body that it stands on.
        link: name of the link that it moves.
        axis: (3,) unit direction, zeros for other kinds.
        anchor: (3,) m, a point on the axis.
        limits: (2,) rad or m, infinite where there are none.
        effort: (2,) N·m or N; NaN where the file states none.
        velocity: rad/s or m/s; NaN where the file cannot state it.
        passive: damping, friction, armature, spring stiffness.
        mimic: leader, multiplier and offset, None for a joint of its own.
    """

    kind: str
    carrier: str
    link: str
    axis: Floats
    anchor: Floats
    limits: Floats
    effort: Floats
    velocity: float
    passive: Floats
    mimic: tuple[str, float, float] | None = None


@dataclass(frozen=True)
class BodyPart:
    """A body that moves as one: a link and all that is fixed to it.

    Attributes:
        link: the link whose name it goes by.
        mass: kg.
        centre: (3,) m, centre of mass.
        inertia: (3, 3) kg·m² about it.
    """

    link: str
    mass: float
    centre: Floats
    inertia: Floats


@dataclass(frozen=True)
class ActuatorPart:
    """An actuator: force = gain · command + bias, on a joint or along a line of thrust.

    Attributes:
        target: ``joint <name>``, or ``body <key>`` for a thrust.
        gear: (6,) force and torque per unit, world axes for a thrust.
        point: (3,) m, of a thrust; zeros on a joint.
        gain: N or N·m per unit of command.
        bias: (3,) constant, per position, per velocity.
        command: (2,) range, infinite where there is none.
        force: (2,) range, infinite where there is none.
        lag: s, time constant; 0 where there is none.
    """

    target: str
    gear: Floats
    point: Floats
    gain: float
    bias: Floats
    command: Floats
    force: Floats
    lag: float


@dataclass(frozen=True)
class RobotParts:
    """A robot file in parts.

    Attributes:
        source: the file's path, as given.
        format: ``URDF`` or ``MJCF``.
        floating: whether its base is free; None where the file does not say.
        frames: (4, 4) pose of each link by name.
        joints: by name.
        bodies: by the name of the joint that moves them, `BASE` for the base.
        actuators: by name; None where the file does not say.
        notes: what of the file is not compared.
    """

    source: str
    format: str
    floating: bool | None
    frames: dict[str, Floats]
    joints: dict[str, JointPart]
    bodies: dict[str, BodyPart]
    actuators: dict[str, ActuatorPart] | None
    notes: tuple[str, ...] = ()


@dataclass
class Sum:
    """Sums rigid parts into one body."""

    link: str
    mass: float = 0.0
    moment: Floats = field(default_factory=lambda: np.zeros(3))
    second: Floats = field(default_factory=lambda: np.zeros((3, 3)))  # about the world's origin

    def add(self, mass: float, centre: Floats, inertia: Floats) -> None:
        """Adds a part: kg, (3,) m, and (3, 3) kg·m² about that centre."""
        self.mass += mass
        self.moment = self.moment + mass * centre
        self.second = self.second + inertia + mass * spread(centre)

    def body(self) -> BodyPart:
        """Returns the sum; a body without mass has its centre at the origin."""
        centre = self.moment / self.mass if self.mass > 0 else np.zeros(3)
        return BodyPart(self.link, self.mass, centre, self.second - self.mass * spread(centre))


def spread(point: Floats) -> Floats:
    """Returns ``|p|² 1 - p pᵀ``, the inertia of a unit mass at `point` about the origin."""
    return np.asarray(point @ point * np.eye(3) - np.outer(point, point))
