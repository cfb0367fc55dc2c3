"""What holds a robot up while its joint torques are asked for: thrust in hover, or its base."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats, cross, move_wrench
from snakegen.errors import AnalysisError
from snakegen.robot.allocation_maps import force_map, mean_drag
from snakegen.robot.box_allocation import box_allocation
from snakegen.robot.kinematics import centre_of_gravity, forward
from snakegen.robot.posture import aim_gimbals
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import DOWN, Wrenches, finite, joint_torques, rotor_wrenches

Hold = Literal["auto", "base", "hover"]
Kind = Literal["base", "hover", "dual", "thrust"]
_MET = 1e-6  # of the load: a hover that meets it to this holds it
_AIMED = 1e-6  # rad, between a force and where the gimbals can turn the thrust


@dataclass(frozen=True)
class Support:
    """Wrenches that hold a robot up.

    Attributes:
        kind: ``base`` held at the root; ``hover`` vectored apparatus forces; ``dual`` each rotor
            on its own, gimbals as in q; ``thrust`` as given.
        wrenches: (bodies, 6) world axes at body origins.
        forces: (apparatuses, 3) N, world; empty unless hovering by vectored forces.
    """

    kind: Kind
    wrenches: Floats
    forces: Floats


def support(
    robot: Robot,
    q: Floats,
    load: Floats,
    *,
    hold: Hold = "auto",
    thrust: ArrayLike | None = None,
) -> Support:
    """Returns what carries the weight and the external wrenches of a robot at rest.

    In hover each apparatus force takes its own direction: the least-norm set ``F = Q_force^# w``
    (ZN23 eq 36) that balances everything, at the thrust points of q, each with the mean drag of
    its rotors along it: zero for a counter-rotating pair. Every force must lie within the thrust
    limits and point where the gimbals can turn it.
    Where that is not so, or nothing turns the rotors, each rotor pushes on its own: the least
    thrusts within their limits, gimbals as in q (dual-rotor mode).

    Args:
        robot: any robot.
        q: (nq,) posture.
        load: (6,) wrench that must be balanced, about the root's origin, world axes: weight and
            external wrenches, as they act on the robot.
        hold: ``auto`` hovers if the robot floats and its rotors can hold the load.
        thrust: (n_rotors,) N, taken instead.

    Raises:
        AnalysisError: hover asked of a robot without apparatuses, or out of reach of its forces.
    """
    count = len(robot.modules.apparatuses)
    bodies = len(robot.tree.parent)
    if thrust is not None:
        return Support("thrust", rotor_wrenches(robot, q, thrust), np.zeros((0, 3)))
    if hold not in ("auto", "base", "hover"):
        raise AnalysisError(f"hold must be auto, base or hover (got '{hold}').")
    if hold == "base" or (hold == "auto" and not (robot.floating and count)):
        return Support("base", np.zeros((bodies, 6)), np.zeros((0, 3)))
    if count == 0 or not robot.floating:
        what = "no vectoring apparatus" if robot.floating else "a fixed base"
        raise AnalysisError(f"{robot.name} has {what}: it cannot hover; hold its base.")
    found = _vectored(robot, q, load) if robot.gimbal_names else None
    found = found or _dual(robot, q, load)
    if found is not None:
        return found
    if hold == "auto":
        return Support("base", np.zeros((bodies, 6)), np.zeros((0, 3)))
    raise AnalysisError(
        f"{robot.name}: neither its apparatus forces nor its rotors, gimbals as given, can hold "
        "this load in this posture within their limits; hold the base instead."
    )


def _vectored(robot: Robot, q: Floats, load: Floats) -> Support | None:
    """Returns the least-norm apparatus forces that balance `load` (6,), None out of limits."""
    count, bodies = len(robot.modules.apparatuses), len(robot.tree.parent)
    base, _ = robot.base_pose(q)
    rotation, position = forward(robot.tree, base, np.zeros(3), robot.angles(q))
    carriers, points = robot.gimbals.thrust_body, robot.gimbals.thrust_point
    levers = [rotation[b] @ p for b, p in zip(carriers, points, strict=True)]
    places = [position[b] + x for b, x in zip(carriers, levers, strict=True)]
    # About the CoG and over the link length: the least-norm set and the residual need one scale.
    _, cog = centre_of_gravity(robot.tree, rotation, position)
    scale, target = _target(robot, load, cog)
    drag = mean_drag(robot.rotors, count)
    world = np.tile(np.eye(3), (count, 1, 1))
    Q = scale[:, None] * force_map(np.array(places) - cog, world, drag)
    forces = np.asarray(np.linalg.lstsq(Q, target, rcond=1e-9)[0], np.float64)
    if float(np.linalg.norm(Q @ forces - target)) > _tolerance(target):
        return None
    out = np.zeros((bodies, 6))
    f = finite(forces, (3 * count,), "hover forces").reshape(count, 3)
    if not _within_limits(robot, q, f):
        return None
    for b, x, force, c in zip(carriers, levers, f, drag, strict=True):
        out[b] += move_wrench(np.concatenate([force, c * force]), x)
    return Support("hover", out, f)


def _within_limits(robot: Robot, q: Floats, forces: Floats) -> bool:
    """Returns whether thrust limits and gimbals allow apparatus forces (Ñ, 3) [N], world axes."""
    sizes, rotors = np.linalg.norm(forces, axis=1), robot.rotors
    least = np.bincount(rotors.apparatus, rotors.thrust_min, minlength=len(sizes))
    room = 1e-9 * robot.gimbals.limit
    if np.any(sizes > robot.gimbals.limit + room) or np.any(sizes < least - room):
        return False
    pushing = sizes > room
    directions = np.tile([0.0, 0.0, 1.0], (len(sizes), 1))
    directions[pushing] = forces[pushing] / sizes[pushing, None]
    return bool(np.all(aim_gimbals(robot, q, directions)[1][pushing] < _AIMED))


def _dual(robot: Robot, q: Floats, load: Floats) -> Support | None:
    """Returns the least thrusts within their limits that balance `load` (6,), None if none do."""
    base, _ = robot.base_pose(q)
    rotation, position = forward(robot.tree, base, np.zeros(3), robot.angles(q))
    _, cog = centre_of_gravity(robot.tree, rotation, position)
    scale, target = _target(robot, load, cog)
    rotors = robot.rotors
    matrix = np.zeros((6, len(rotors.body)))
    for k, b in enumerate(rotors.body):
        axis = rotation[b] @ rotors.axis[k]
        arm = position[b] + rotation[b] @ rotors.position[k] - cog
        matrix[:, k] = np.concatenate([axis, cross(arm, axis) + rotors.torque_ratio[k] * axis])
    size = max(float(np.linalg.norm(target)), 1e-9)
    rows = scale / size
    thrust = box_allocation(
        matrix, target / scale, rows, rotors.thrust_max, rotors.thrust_min, rotors.thrust_max
    )
    if float(np.linalg.norm(scale * (matrix @ thrust) - target)) > _tolerance(target):
        return None
    return Support("dual", rotor_wrenches(robot, q, thrust), np.zeros((0, 3)))


def _target(robot: Robot, load: Floats, cog: Floats) -> tuple[Floats, Floats]:
    """Returns row scales (6,), and the scaled wrench about the CoG that answers `load`."""
    about = np.concatenate([load[:3], load[3:] - cross(cog, load[:3])])
    scale = np.repeat([1.0, 1.0 / robot.link_length], 3)
    return scale, -scale * about


def _tolerance(target: Floats) -> float:
    """Returns what of a scaled load may be left by rounding."""
    return _MET * max(float(np.linalg.norm(target)), 1e-9)


def hold_up(
    robot: Robot,
    q: Floats,
    *,
    wrenches: Wrenches = None,
    gravity: ArrayLike = DOWN,
    hold: Hold = "auto",
    thrust: ArrayLike | None = None,
) -> Support:
    """Returns `support` of a robot at rest: its load is what the unsupported base lacks.

    Arguments as in `support` and `law.joint_torques`; errors too.
    """
    load = np.zeros(6)
    if robot.floating:
        base, _ = robot.base_pose(q)
        static = joint_torques(robot, q, wrenches=wrenches, gravity=gravity, terms="static")
        load = -np.concatenate([base @ static[:3], base @ static[3:6]])
    return support(robot, q, load, hold=hold, thrust=thrust)
