"""What a robot's tip can bear, carry and yield: polytope, payload and stiffness at one point."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from snakegen.base.describe_motion import canonical_basis
from snakegen.base.geometry import Floats
from snakegen.base.rounding import in_order
from snakegen.errors import AnalysisError
from snakegen.kernels.margins import tip_polytope
from snakegen.robot.followers import coupling
from snakegen.robot.kinematics import tip_jacobian
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.statics.joint_torques import finite


@dataclass(frozen=True)
class Tip:
    """A point of a robot.

    Attributes:
        link: the link it stands on.
        body: the body that carries that link.
        point: (3,) m, in the body's frame.
    """

    link: str
    body: int
    point: Floats


@dataclass(frozen=True)
class TipPose:
    """A tip's place and motion in a posture; from the base origin, world axes.

    Attributes:
        position: (3,) m.
        rotation: (3, 3) attitude of the body that carries it.
        jacobian: (6, n) of [linear; angular] by the joints, base held.
    """

    position: Floats
    rotation: Floats
    jacobian: Floats


@dataclass(frozen=True)
class TipLoad:
    """Loads at the tip within the servo limits, in addition to what the joints carry already.

    Attributes:
        force_radius: N, the force that can be borne in **every** direction.
        force_joint: the joint that limits it.
        force_direction: (3,) the worst direction.
        torque_radius: N·m, the same for pure torques.
        wrench_radius: N, of wrenches [force; torque / lever] in **every** direction of the six.
        wrench_joint: the joint that limits them.
        lever: m, mean link length, against which torques count.
        axes_force: (6,) N along +x, -x, +y, -y, +z, -z of the world; inf where no joint feels it.
        axes_torque: (6,) N·m, the same for torques.
        corners: (c, 3) N, corners of the set of forces.
        free: (3, f) directions of force that load no joint.
        torque_corners: (c, 3) N·m, corners of the set of torques.
        torque_free: (3, f) directions of torque that load no joint.
        payload: kg that can hang at the tip (0 where the posture alone is too much).
        compliance: (6, 6) m/N …, of the servos.
        stiffness: (6, 6) its pseudo-inverse.
        sag: (3,) m, the tip's displacement under the joints' present torque.
    """

    force_radius: float
    force_joint: str
    force_direction: Floats
    torque_radius: float
    wrench_radius: float
    wrench_joint: str
    lever: float
    axes_force: Floats
    axes_torque: Floats
    corners: Floats
    free: Floats
    torque_corners: Floats
    torque_free: Floats
    payload: float
    compliance: Floats
    stiffness: Floats
    sag: Floats

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units, infinite values are null."""
        directions = ("+x", "-x", "+y", "-y", "+z", "-z")
        return {
            "root_held": True,
            "force_every_direction_N": plain(np.array([self.force_radius]))[0],
            "limiting_joint": self.force_joint,
            "worst_direction": self.force_direction.tolist(),
            "torque_every_direction_Nm": plain(np.array([self.torque_radius]))[0],
            "wrench_every_direction_N": plain(np.array([self.wrench_radius]))[0],
            "wrench_limiting_joint": self.wrench_joint,
            "wrench_lever_m": self.lever,
            "force_along_N": dict(zip(directions, plain(self.axes_force), strict=True)),
            "torque_along_Nm": dict(zip(directions, plain(self.axes_torque), strict=True)),
            "force_corners_N": self.corners.tolist(),
            "torque_corners_Nm": self.torque_corners.tolist(),
            "unfelt_directions": self.free.T.tolist(),
            "unfelt_torque_directions": self.torque_free.T.tolist(),
            "payload_kg": plain(np.array([self.payload]))[0],
            "compliance": self.compliance.tolist(),
            "stiffness": self.stiffness.tolist(),
            "servo_sag_m": self.sag.tolist(),
        }


def find_tip(robot: Robot, link: str | None = None, point: ArrayLike | None = None) -> Tip:
    """Returns the tip: the far end of the last link of the chain, unless told otherwise.

    Args:
        robot: any robot.
        link: the link that carries it.
        point: (3,) m in that link's frame; its far end (its length along x) if absent, or its
            origin where the length is not known.

    Raises:
        DescriptionError: an unknown link.
    """
    if link is None:
        link = _last_link(robot)
    body, rotation, origin = robot.body_of_link(link)
    if point is None:
        local = np.array([robot.modules.lengths.get(link, 0.0), 0.0, 0.0])
    else:
        local = finite(point, (3,), "tip point")
    return Tip(link, body, origin + rotation @ local)


def _last_link(robot: Robot) -> str:
    """Returns the link of known length that stands deepest, else the last frame of the chain.

    The last frame: of those fixed to the body of the deepest chain joint, a tool's frame
    included, the one behind most fixed joints; of several the farthest from that joint. The fingers
    of a gripper are no part of the chain.
    """
    depth = np.zeros(len(robot.tree.parent), int)
    for i in range(1, len(depth)):
        depth[i] = depth[robot.tree.parent[i]] + 1
    known = [n for n in robot.modules.lengths if robot.model.existBodyName(n)]
    if known:
        return max(known, key=lambda n: depth[robot.body_of_link(n)[0]])
    fingers = _fingers(robot)
    bodies = [robot.body_of_joint(j) for j in robot.chain_joints]
    bodies = [b for b in bodies if b not in fingers]
    if not bodies:
        return robot.root_link
    deepest = max(bodies, key=lambda b: depth[b])
    frames = [f for f in robot.model.frames if f.type == pin.FrameType.BODY]
    ends = [f for f in frames if robot.body_of_link(f.name)[0] == deepest]
    return str(max(ends, key=lambda f: (_fixed_above(robot, f), _reach(f))).name)


def _fingers(robot: Robot) -> set[int]:
    """Returns the bodies of grippers: branches side by side that mimic each other and nothing else.

    A linkage in the chain mimics too, but has no twin beside it.
    """
    parent = robot.tree.parent
    pairs = [(name, follower[0]) for name, follower in robot.followers.items()]
    coupled = {robot.body_of_joint(n) for pair in pairs for n in pair}
    below: dict[int, set[int]] = {i: {i} for i in range(len(parent))}
    for i in range(len(parent) - 1, 0, -1):
        below[int(parent[i])] |= below[i]
    branches: dict[int, list[set[int]]] = {}
    for i in range(1, len(parent)):
        if below[i] <= coupled:
            branches.setdefault(int(parent[i]), []).append(below[i])
    return {b for twins in branches.values() if len(twins) > 1 for part in twins for b in part}


def _fixed_above(robot: Robot, frame: Any) -> int:
    """Returns how many fixed joints lie between a link and the joint that moves it."""
    count, here = 0, robot.model.frames[frame.parentFrame]
    while here.type != pin.FrameType.JOINT and here.name != "universe":
        count += int(here.type == pin.FrameType.FIXED_JOINT)
        here = robot.model.frames[here.parentFrame]
    return count


def _reach(frame: Any) -> float:
    return round(float(np.linalg.norm(frame.placement.translation)), 9)


def tip_pose(robot: Robot, q: ArrayLike, tip: Tip) -> TipPose:
    """Returns place, attitude and Jacobian of `tip` in posture q (nq,)."""
    q = robot.validate_configuration(q)
    base = robot.base_pose(q)[0]
    pose = TipPose(*tip_jacobian(robot.tree, base, robot.angles(q), tip.body, tip.point))
    if not robot.followers:
        return pose
    return replace(pose, jacobian=pose.jacobian @ coupling(robot.joint_names, robot.followers))


def _canonical(corners: Floats, free: Floats) -> tuple[Floats, Floats]:
    """Returns corners (c, 3) and free directions (3, f) in an order that no processor changes."""
    basis = canonical_basis(free, (0, 1, 2)) if free.size else free
    return in_order(corners), basis


def tip_load(
    robot: Robot,
    q: ArrayLike,
    tip: Tip,
    torque: Floats,
    limit: Floats,
    *,
    direction: ArrayLike = (0.0, 0.0, -1.0),
) -> TipLoad:
    """Returns what the tip can carry in addition to `torque`, the base held.

    Args:
        robot: any robot; a floating one is taken as held at its root.
        q: (nq,) posture.
        tip: from `find_tip`.
        torque: (n,) N·m, what the joints carry already.
        limit: (n,) N·m, servo limits.
        direction: (3,) of the payload's pull.

    Raises:
        AnalysisError: a direction of length 0.
    """
    u = finite(direction, (3,), "direction")
    if not np.linalg.norm(u) > 0:
        raise AnalysisError("direction must not be zero; use [0, 0, -1] for a downward load.")
    pose = tip_pose(robot, q, tip)
    linear, angular = pose.jacobian[:3], pose.jacobian[3:]
    radius, joint, worst = tip_polytope.inscribed(linear, torque, limit)
    twist_radius = tip_polytope.inscribed(angular, torque, limit)[0]
    both = np.kron(np.eye(3), np.array([[1.0], [-1.0]]))
    points, free = _canonical(*tip_polytope.corners(linear, torque, limit))
    twists, blind = _canonical(*tip_polytope.corners(angular, torque, limit))
    lever = robot.link_length
    whole, last, _ = tip_polytope.inscribed(np.vstack([linear, angular * lever]), torque, limit)
    pull = tip_polytope.capacity(linear, torque, limit, (u / np.linalg.norm(u))[None])[0]
    compliance, stiff = tip_polytope.stiffness(pose.jacobian, servo_stiffness(robot))
    return TipLoad(
        radius,
        robot.joint_names[joint] if joint >= 0 else "",
        worst,
        twist_radius,
        whole,
        robot.joint_names[last] if last >= 0 else "",
        lever,
        tip_polytope.capacity(linear, torque, limit, both),
        tip_polytope.capacity(angular, torque, limit, both),
        points,
        free,
        twists,
        blind,
        0.0 if np.isnan(pull) else float(pull) / GRAVITY,
        compliance,
        stiff,
        -linear @ (torque / servo_stiffness(robot)),
    )


def servo_stiffness(robot: Robot) -> Floats:
    """Returns each joint's servo stiffness (n,) [N·m/rad], inf where no servo is known."""
    known = {s.joint: s.stiffness for s in robot.modules.servos}
    return np.array([known.get(n, np.inf) for n in robot.joint_names])


def plain(values: Floats) -> list[float | None]:
    """Returns numbers for JSON, which knows neither infinity nor NaN."""
    return [float(x) if np.isfinite(x) else None for x in np.ravel(values)]
