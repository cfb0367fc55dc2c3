"""From a routing to cables in MuJoCo: what link has each hole, and is the posture held there."""

from pathlib import Path

from snakegen.description.tendons import Cable, Held, holding, write_cabled
from snakegen.errors import AnalysisError
from snakegen.geometry import Floats
from snakegen.kinetostatics.routing import Routing
from snakegen.robot import Robot

__all__ = ["HELD_ACCELERATION", "HELD_DRIFT", "Held", "cables_of", "hold_in_mujoco"]

HELD_ACCELERATION = 1e-3  # rad/s², with which a posture counts as balanced
HELD_DRIFT = 1e-3  # rad, with which it counts as held


def cables_of(
    robot: Robot, routing: Routing, tension: Floats, length: Floats, maximum: float
) -> list[Cable]:
    """Returns each cable with its holes in the frames of the links that hold them."""
    links = _links(robot)
    holes = routing.holes
    group = {c: k for k, columns in enumerate(routing.columns) for c in columns}
    out = []
    for c, name in enumerate(routing.names):
        rows = range(holes.first[c], holes.first[c + 1])
        frames = [links[int(holes.body[h])] for h in rows]
        points = holes.point[list(rows)]
        one = Cable(
            name, group[c], tuple(frames), points, float(tension[c]), float(length[c]), maximum
        )
        out.append(one)
    return out


def hold_in_mujoco(
    path: Path,
    robot: Robot,
    q: Floats,
    routing: Routing,
    tension: Floats,
    length: Floats,
    maximum: float,
    gravity: Floats,
    stiffness: float,
) -> Held:
    """Writes the cabled MJCF and returns what MuJoCo says of the posture.

    Raises:
        AnalysisError: a stiffness that is not positive.
        DescriptionError: the file cannot be written.
    """
    if not stiffness > 0:
        raise AnalysisError(f"stiffness = {stiffness:g}: N/m above 0 are needed.")
    posture = dict(zip(robot.joint_names, robot.angles(q).tolist(), strict=True))
    cables = cables_of(robot, routing, tension, length, maximum)
    write_cabled(path, robot.urdf, robot.modules, cables, posture, gravity, stiffness)
    return holding(path)


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
