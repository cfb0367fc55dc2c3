"""What the allocators take and give, as named tuples of plain arrays."""

from typing import NamedTuple

from snakegen.kernels.core.types import Floats
from snakegen.kernels.dynamics.joint_loads import JointLoads


class Task(NamedTuple):
    """The wrench that is sought, and the scale that weighs what is missed of its rows."""

    wrench: Floats  # (6,) N and N·m, CoG axes
    rows: Floats  # (6,) S: THEORY A3


class Limits(NamedTuple):
    """What Ñ apparatuses can push, angles in joint order."""

    thrust: Floats  # (Ñ,) N, largest
    lower: Floats  # (Ñ, 2) rad
    upper: Floats  # (Ñ, 2) rad


class Previous(NamedTuple):
    """The tick before, angles in joint order; zeros where there is none."""

    angles: Floats  # (Ñ, 2) rad
    thrust: Floats  # (Ñ,) N
    external: Floats  # (k,) N·m, what loads the bounded joints beyond thrust and weight


class Iteration(NamedTuple):
    """How long the allocator of virtual single rotors iterates."""

    sweeps: int  # of eq 36 before Newton
    newton: int  # most Newton steps
    residual: float  # N and N·m, where Newton stops


class VirtualAnswer(NamedTuple):
    """The answer of virtual single rotors, written in place; angles in joint order."""

    thrust: Floats  # (Ñ,) N
    angles: Floats  # (Ñ, 2) rad
    internal: Floats  # (2, Ñ, 3) N, link axes: internal forces, see `bounded_answer`
    reached: Floats  # (6,) N and N·m, the wrench within limits


class RotorBounds(NamedTuple):
    """Limits of rotor thrusts, and of the joints that they load."""

    least: Floats  # (n,) N
    most: Floats  # (n,) N
    constrained: int  # 1 keeps the thrusts within both
    loads: JointLoads


class Level(NamedTuple):
    """Which way is up for a body that leans to move."""

    ahead: float  # N, horizontal force, see `horizontal`
    left: float  # N
    weight: float  # N
    tilt: Floats  # (3, 3) level axes of the target


class DualAnswer(NamedTuple):
    """The answer of dual rotors, written in place; angles in joint order."""

    thrust: Floats  # (n,) N
    angles: Floats  # (Ñ, 2) rad
    deflected: Floats  # (Ñ, 2) rad, where gimbals are under the thrusts, servos compliant
