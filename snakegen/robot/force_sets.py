"""Force sets of a robot's apparatuses, from its gimbal joints' ranges and rotors' limits."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import DescriptionError
from snakegen.robot.allocation_maps import mean_drag, thrust_points
from snakegen.robot.bodies import RobotBodies
from snakegen.robot.gimbal_geometry import mounts
from snakegen.robot.kinematics import forward, mass_properties
from snakegen.wrench_margins.force_sets import ForceSets

SQUARE = 1e-6  # of a dot product of unit vectors: right angles


@lru_cache(maxsize=64)
def force_shapes(robot: RobotBodies) -> ForceSets:
    """Returns the sets of `robot` as they are in any posture; frames and points are placeholders.

    `frames` turn the set's own axes into those of the first gimbal joint at 0 (see `mounts`): x
    along that joint's axis. With one joint, φ is its angle and θ the thrust's fixed tilt out of the
    plane across its axis; with two, φ and θ are those of the joint nearer to the link and of the
    farther one. Rotors of one apparatus share a thrust (virtual single rotor).

    Raises:
        DescriptionError: two gimbal axes that are not perpendicular to each other, or a thrust
            that is not perpendicular to the second one.
    """
    rotors, n = robot.rotors, len(robot.modules.apparatuses)
    low, high = np.zeros(n), np.zeros(n)
    phi, theta, frames = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 3, 3))
    for j in range(n):
        mine = rotors.apparatus == j
        together = float(np.linalg.norm(rotors.axis[mine].sum(axis=0)))
        low[j] = rotors.thrust_min[mine].max() * together
        high[j] = rotors.thrust_max[mine].min() * together
        if low[j] > high[j]:
            raise DescriptionError(
                f"{robot.apparatus_names[j]}: its rotors have no thrust in common, from the "
                "largest thrust_min to the least thrust_max; make them apparatuses of their own."
            )
        frames[j], phi[j], theta[j] = _turned(robot, j)
    return ForceSets.checked(np.zeros((n, 3)), frames, low, high, phi, theta, mean_drag(rotors, n))


def force_sets_at(robot: RobotBodies, q: Floats) -> ForceSets:
    """Returns the sets at q, points and axes about the CoG in the root link's axes."""
    base, origin = robot.base_pose(q)
    return _placed(robot, base, origin, robot.angles(q))


def force_sets_along(
    robot: RobotBodies, bases: Floats, origins: Floats, angles: Floats
) -> ForceSets:
    """Returns the sets of m postures as one stack, points and axes about each CoG.

    Args:
        robot: whose they are.
        bases, origins: (m, 3, 3) and (m, 3) m, of the root link.
        angles: (m, n-1) rad, in the tree's order.
    """
    shapes, rows = force_shapes(robot), len(bases)
    points = np.empty((rows, len(shapes), 3))
    frames = np.empty((rows, len(shapes), 3, 3))
    for k, (base, origin, at) in enumerate(zip(bases, origins, angles, strict=True)):
        here = _placed(robot, base, origin, at)
        points[k], frames[k] = here.points, here.frames
    return replace(shapes, points=points, frames=frames)


def _placed(robot: RobotBodies, base: Floats, origin: Floats, angles: Floats) -> ForceSets:
    """Returns the sets of one posture."""
    base, origin, angles = (np.ascontiguousarray(x) for x in (base, origin, angles))
    rotation, position = forward(robot.tree, base, origin, angles)
    _, cog, _ = mass_properties(robot.tree, rotation, position)
    m, _ = mounts(robot.tree, robot.rotors, robot.gimbals, rotation, position, cog, base)
    points = thrust_points(robot.gimbals, rotation, position, cog, base)
    shapes = force_shapes(robot)
    return replace(shapes, points=points, frames=m[:, :3] @ shapes.frames)


def _turned(robot: RobotBodies, j: int) -> tuple[Floats, Floats, Floats]:
    """Returns the set's axes in those of the first joint, and the ranges of φ and θ."""
    g, tree = robot.gimbals, robot.tree
    bodies = sorted(b for b in (g.roll_body[j], g.pitch_body[j]) if b >= 0)
    thrust = np.asarray(g.thrust_axis[j], float)
    axes: list[Floats] = []
    ranges: list[Floats] = []
    for body in reversed(bodies):
        axis = np.asarray(tree.axis[body], float)
        if axes or abs(abs(axis @ thrust) - 1.0) > SQUARE:  # else it turns nothing
            axes.insert(0, axis)
            low, high, _ = robot.limits([robot.joint_names[body - 1]])
            ranges.insert(0, np.array([low[0], high[0]]))
        if body == bodies[-1]:  # `mounts` gives the frame that carries it
            mount = tree.rotation[body]
            thrust, axes = mount @ thrust, [mount @ a for a in axes]
    if len(axes) == 2 and max(abs(axes[0] @ axes[1]), abs(axes[1] @ thrust)) > SQUARE:
        raise DescriptionError(
            f"{robot.apparatus_names[j]}: margins need gimbal axes that are perpendicular to each "
            "other and a thrust perpendicular to the second one."
        )
    still = np.zeros(2)
    if not axes:
        return _frame(_across(thrust), thrust), still, still
    x = axes[0]
    if len(axes) == 1:
        rise = float(x @ thrust)
        rise = 0.0 if abs(rise) < SQUARE else rise
        flat = thrust - rise * x
        tilt = np.full(2, np.arcsin(np.clip(rise, -1.0, 1.0)))
        return _frame(x, flat / np.linalg.norm(flat)), ranges[0], tilt
    z = np.cross(x, axes[1])
    offset = float(np.arctan2(thrust @ x, thrust @ z))
    return _frame(x, z), ranges[0], ranges[1] + (0.0 if abs(offset) < SQUARE else offset)


def _across(z: Floats) -> Floats:
    """Returns a unit vector perpendicular to z."""
    x = np.zeros(3)
    x[int(np.argmin(np.abs(z)))] = 1.0
    x -= (x @ z) * z
    return np.asarray(x / np.linalg.norm(x))


def _frame(x: Floats, z: Floats) -> Floats:
    return np.column_stack([x, np.cross(z, x), z])


def gimbals_in_the_way(robot: RobotBodies, sets: ForceSets, up: Floats) -> tuple[str, ...]:
    """Returns the gimbal joints whose limits keep a thrust from pointing along `up`, CoG axes.

    Args:
        robot: whose sets they are.
        sets: of a posture.
        up: (3,) unit.
    """
    out: list[str] = []
    for j in range(len(sets)):
        local = sets.frames[j].T @ up
        g = robot.gimbals
        bodies = sorted(int(b) for b in (g.roll_body[j], g.pitch_body[j]) if b >= 0)
        flat = float(np.hypot(local[1], local[2]))
        wanted = (np.arctan2(-local[1], local[2]), np.arctan2(local[0], flat))
        for body, angle, span in zip(bodies, wanted, (sets.phi[j], sets.theta[j]), strict=False):
            past = (angle - span[0]) % (2.0 * np.pi) - (span[1] - span[0])
            if 1e-9 < past < 2.0 * np.pi - 1e-9:
                out.append(robot.joint_names[body - 1])
    return tuple(out)


def fixed_rotors_in_the_way(robot: RobotBodies, sets: ForceSets, up: Floats) -> tuple[str, ...]:
    """Returns the links of rotors that no gimbal turns and whose thrust is not along `up`.

    Args:
        robot: whose sets they are.
        sets: of a posture.
        up: (3,) unit, CoG axes.
    """
    out: list[str] = []
    for j, apparatus in enumerate(robot.modules.apparatuses):
        if apparatus.roll is None and apparatus.pitch is None:
            axis = sets.frames[j][:, 2]
            along = float(axis @ up)
            if (abs(along) if sets.low[j] < 0.0 else along) < 1.0 - SQUARE:
                out += [rotor.link for rotor in apparatus.rotors]
    return tuple(out)
