"""Collision shapes of a planned body: links as the URDF has them, gimbals swept, and obstacles."""

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats, rotation_onto
from snakegen.errors import PlanError
from snakegen.robot.robot import Robot
from snakegen.scene.solids import Solid

_TURNS = 720  # samples of the pitch angle; between them a point moves by less than its arc
_RIM = 64  # points on a circle, which they circumscribe


@dataclass(frozen=True, eq=False)
class Shapes:
    """Geometry of body and obstacles.

    Attributes:
        geometry: Pinocchio's; the body's shapes come first.
        count: of the body's shapes.
        labels: names of all shapes.
        joints: (count,) Pinocchio joint that carries each shape.
        centres, radii: of the ball round each, m, in the joint's frame.
        pairs: (p, 2) shapes; those with obstacles come first.
        outer: number of pairs with obstacles.
        links: (joint, (start, end)) of each rod of the chain, m, joint frame.
        widest: m, greatest radius that gimbals sweep about a link.
    """

    geometry: Any
    count: int
    labels: tuple[str, ...]
    joints: tuple[int, ...]
    centres: Floats
    radii: Floats
    pairs: Any
    outer: int
    links: tuple[tuple[int, tuple[Floats, Floats]], ...]
    widest: float


def shapes_of(robot: Robot, solids: tuple[Solid, ...]) -> Shapes:
    """Returns the shapes of `robot` among `solids`.

    Raises:
        PlanError: collision shapes that cannot be read.
    """
    folders = [] if robot.path is None else [str(Path(robot.path).parent)]
    kind = pin.GeometryType.COLLISION
    try:
        read = pin.buildGeomFromUrdfString(robot.model, robot.urdf, kind, package_dirs=folders)
    except (ValueError, RuntimeError) as error:
        reason = str(error).splitlines()[0]
        raise PlanError(f"{robot.name}: collision shapes cannot be read ({reason}).") from None
    geometry = pin.GeometryModel()
    labels: list[str] = []
    joints: list[int] = []
    balls: list[tuple[Floats, float]] = []
    carried: dict[int, list[tuple[int, Floats]]] = {}
    owner = _gimbal_bodies(robot)
    for item in read.geometryObjects:
        joint = int(item.parentJoint)
        points = _points(item.geometry, item.placement)
        if joint in owner:
            carried.setdefault(owner[joint], []).append((joint, points))
            continue
        geometry.addGeometryObject(
            pin.GeometryObject(item.name, joint, item.placement, item.geometry)
        )
        labels.append(robot.model.frames[item.parentFrame].name)
        joints.append(joint)
        balls.append(_ball(points))
    widest = 0.0
    for j, parts in sorted(carried.items()):
        link, place, radius, half = _swept(robot, j, parts)
        widest = max(widest, radius)
        name = f"vectoring apparatus {j + 1}"
        shape = coal.Cylinder(radius, 2.0 * half)
        geometry.addGeometryObject(pin.GeometryObject(name, link, place, shape))
        labels.append(name)
        joints.append(link)
        balls.append((np.array(place.translation), float(np.hypot(radius, half))))
    count = len(labels)
    if not count:
        raise PlanError(f"{robot.name} has no collision shapes: nothing can be kept clear.")
    for solid in solids:
        placement = pin.SE3(solid.rotation, np.asarray(solid.centre, float))
        geometry.addGeometryObject(pin.GeometryObject(solid.name, 0, placement, solid.shape()))
        labels.append(solid.name)
    pairs = [(i, k) for i in range(count) for k in range(count, len(labels))]
    outer = len(pairs)
    for pair in pairs:
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    own = _own_pairs(robot, geometry, joints)
    for pair in own:
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    return Shapes(
        geometry,
        count,
        tuple(labels),
        tuple(joints),
        np.array([b[0] for b in balls]),
        np.array([b[1] for b in balls]),
        np.array(pairs + own, int).reshape(-1, 2),
        outer,
        _rods(robot),
        widest,
    )


def _own_pairs(robot: Robot, geometry: Any, joints: list[int]) -> list[tuple[int, int]]:
    """Returns pairs of the body's shapes that may touch: apart at rest, and not joined."""
    model = robot.model
    test = pin.GeometryModel()
    for item in list(geometry.geometryObjects)[: len(joints)]:
        test.addGeometryObject(item)
    kept = []
    for i, k in combinations(range(len(joints)), 2):
        one, two = joints[i], joints[k]
        if one != two and one != int(model.parents[two]) and two != int(model.parents[one]):
            kept.append((i, k))
            test.addCollisionPair(pin.CollisionPair(i, k))
    found = pin.GeometryData(test)
    pin.computeDistances(model, model.createData(), test, found, pin.neutral(model))
    gaps = [r.min_distance for r in found.distanceResults]
    return [pair for pair, gap in zip(kept, gaps, strict=True) if gap > 1e-3]


def _gimbal_bodies(robot: Robot) -> dict[int, int]:
    """Returns the apparatus that turns each Pinocchio joint it carries."""
    tree, out = robot.tree, {}
    first = 1 if robot.floating else 0
    for j, pair in enumerate(zip(robot.gimbals.roll_body, robot.gimbals.pitch_body, strict=True)):
        inner = min(int(b) for b in pair if b >= 0)
        for body in range(inner, len(tree.parent)):
            above = body
            while above > inner:
                above = int(tree.parent[above])
            if above == inner:
                out[body + first] = j
    return out


def _swept(robot: Robot, j: int, parts: list[tuple[int, Floats]]) -> tuple[int, Any, float, float]:
    """Returns link joint, placement, radius and half length [m] of what apparatus j sweeps."""
    g, tree = robot.gimbals, robot.tree
    first = 1 if robot.floating else 0
    inner, outer = sorted((int(g.roll_body[j]), int(g.pitch_body[j])))
    axis, turn = tree.axis[inner], tree.rotation[outer]
    far, hinge = tree.translation[outer], turn @ tree.axis[outer]
    radius, low, high = 0.0, np.inf, -np.inf
    for joint, points in parts:
        clouds, slack = [points], 0.0
        if joint - first != inner:
            local = (
                points @ turn.T if joint - first == outer else _folded(robot, joint, outer, points)
            )
            along = local @ hinge
            across = local - along[:, None] * hinge
            other = np.cross(hinge, across)
            angles = np.linspace(0.0, 2.0 * np.pi, _TURNS, endpoint=False)
            clouds = [
                far + along[:, None] * hinge + np.cos(a) * across + np.sin(a) * other
                for a in angles
            ]
            slack = float(np.linalg.norm(across, axis=1).max()) * np.pi / _TURNS
        cloud = np.concatenate(clouds)
        deep = cloud @ axis
        radius = max(
            radius, float(np.linalg.norm(cloud - deep[:, None] * axis, axis=1).max()) + slack
        )
        low, high = min(low, float(deep.min()) - slack), max(high, float(deep.max()) + slack)
    out = tree.rotation[inner] @ axis
    centre = tree.translation[inner] + out * 0.5 * (low + high)
    return (
        int(g.link_body[j]) + first,
        pin.SE3(rotation_onto(out), centre),
        radius,
        0.5 * (high - low),
    )


def _folded(robot: Robot, joint: int, outer: int, points: Floats) -> Floats:
    """Returns points of a body beyond the pitch joint in that joint's frame, spins at 0."""
    tree, body = robot.tree, joint - (1 if robot.floating else 0)
    while body != outer:
        points = points @ tree.rotation[body].T + tree.translation[body]
        body = int(tree.parent[body])
    return points @ tree.rotation[outer].T


def _rods(robot: Robot) -> tuple[tuple[int, tuple[Floats, Floats]], ...]:
    """Returns the bodies of the chain as rods from joint to joint, root first."""
    tree, first = robot.tree, 1 if robot.floating else 0
    chain = [robot.body_of_joint(n) for n in robot.chain_joints]
    bodies = [0, *chain]
    out: list[tuple[int, tuple[Floats, Floats]]] = []
    for body, after in zip(bodies, [*chain, -1], strict=True):
        if after >= 0:
            end = np.array(tree.translation[after])
        else:
            end = (
                np.array(out[0][1][1])
                if not robot.modules.lengths
                else np.array([float(list(robot.modules.lengths.values())[-1]), 0.0, 0.0])
            )
        out.append((body + first, (np.zeros(3), end)))
    return tuple(rod for rod in out if np.linalg.norm(rod[1][1]) > 1e-6)


def _ball(points: Floats) -> tuple[Floats, float]:
    """Returns a centre and the radius [m] of a ball round points (m, 3)."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return middle, float(np.linalg.norm(points - middle, axis=1).max())


def _points(shape: Any, placement: Any) -> Floats:
    """Returns points (m, 3) whose hull holds a shape, in its joint's frame."""
    circle = np.linspace(0.0, 2.0 * np.pi, _RIM, endpoint=False)
    wide = 1.0 / np.cos(np.pi / _RIM)
    rim = np.stack([np.cos(circle), np.sin(circle), np.zeros(_RIM)], axis=1) * wide
    if isinstance(shape, coal.Box):
        corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        points = corners * np.array(shape.halfSide)
    elif isinstance(shape, coal.Sphere):
        points = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T * shape.radius
    elif isinstance(shape, coal.Cylinder):
        up = np.array([0.0, 0.0, shape.halfLength])
        points = np.concatenate([rim * shape.radius + up, rim * shape.radius - up])
    elif isinstance(shape, coal.Capsule):
        up = np.array([0.0, 0.0, shape.halfLength + shape.radius])
        points = np.concatenate([rim * shape.radius + up, rim * shape.radius - up])
    elif hasattr(shape, "vertices"):
        points = np.array(shape.vertices() if callable(shape.vertices) else shape.vertices, float)
    else:
        raise PlanError(f"collision shape {type(shape).__name__} is not known here.")
    return np.asarray(points @ placement.rotation.T + placement.translation)
