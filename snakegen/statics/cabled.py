"""From a routing to cables in MuJoCo: what link has each hole, and is the posture held there."""

from dataclasses import replace
from pathlib import Path

from snakegen.base.geometry import Floats
from snakegen.description.mjcf.tendons import Cable, Held, holding, let_go, write_cabled
from snakegen.robot.robot import Robot
from snakegen.statics.routing import Routing

__all__ = ["HELD_ACCELERATION", "HELD_DRIFT", "Held", "cables_of", "hold_in_mujoco"]

HELD_ACCELERATION = 1e-3  # rad/s², with which a posture counts as balanced
HELD_DRIFT = 1e-3  # rad, that it may go in a second when nobody bends it
PUSH = 1e-3  # rad, by which it is bent


def cables_of(
    robot: Robot,
    routing: Routing,
    tension: Floats,
    length: Floats,
    maximum: float,
    stiffness: Floats,
) -> list[Cable]:
    """Returns each cable with its holes in the frames of the links that hold them."""
    links = _links(robot)
    holes = routing.holes
    group = {c: k for k, columns in enumerate(routing.columns) for c in columns}
    out = []
    for c, name in enumerate(routing.names):
        rows = range(holes.first[c], holes.first[c + 1])
        frames = tuple(links[int(holes.body[h])] for h in rows)
        numbers = float(tension[c]), float(length[c]), maximum, float(stiffness[c])
        out.append(Cable(name, group[c], frames, holes.point[list(rows)], *numbers))
    return out


def hold_in_mujoco(
    path: Path, robot: Robot, q: Floats, cables: list[Cable], gravity: Floats, soft: Floats
) -> Held:
    """Writes the cabled MJCF and returns what MuJoCo says of the posture.

    It is let go there, and again bent by 1 mrad in its softest direction.

    Args:
        path: of the MJCF.
        robot: its own joints and links.
        q: (nq,) posture.
        cables: from `cables_of`.
        gravity: (3,) m/s².
        soft: (n,) direction of all joints.

    Raises:
        DescriptionError: the file cannot be written.
    """
    posture = dict(zip(robot.joint_names, robot.angles(q).tolist(), strict=True))
    write_cabled(path, robot.urdf, robot.modules, cables, posture, gravity)
    still = holding(path)
    direction = dict(zip(robot.joint_names, soft.tolist(), strict=True))
    farthest, end, left, waited = let_go(path, direction, PUSH)
    return replace(still, pushed=PUSH, farthest=farthest, end=end, left=left, waited=waited)


def _links(robot: Robot) -> dict[int, str]:
    """Returns the link whose frame each body has: the one that its joint moves."""
    from xml.etree import ElementTree as ET

    child = {
        str(joint.get("name")): str(link.get("link"))
        for joint in ET.fromstring(robot.urdf).iterfind("joint")
        if (link := joint.find("child")) is not None
    }
    out = {k + 1: child[name] for k, name in enumerate(robot.joint_names)}
    return out | {0: robot.root_link}
