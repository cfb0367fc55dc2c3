"""The joints on which rotors spin: no servo holds them, and their angle does not matter."""

import xml.etree.ElementTree as ET
from math import inf, pi

from snakegen.robot.modules import Modules

TURNS = 8.0 * pi  # rad: a revolute joint with more room than this is a shaft


def rotor_shafts(urdf: str, modules: Modules) -> frozenset[str]:
    """Returns the names of the joints that spin a rotor.

    Such a joint is continuous, or revolute with effort 0 or room for many turns; it carries a rotor
    and no further joint, and is named neither as a gimbal nor as a servo.
    """
    links = [r.link for a in modules.apparatuses for r in a.rotors]
    if not links:
        return frozenset()
    joints = list(ET.fromstring(urdf).iterfind("joint"))
    above = {_end(j, "child"): j for j in joints}
    busy: set[str] = set()  # links that a joint hangs on, at once or through fixed joints
    for moving in (j for j in joints if j.get("type") != "fixed"):
        waiting = [_end(moving, "parent")]
        while waiting and waiting[0] not in busy:
            link = waiting.pop()
            busy.add(link)
            up = above.get(link)
            if up is not None and up.get("type") == "fixed":
                waiting.append(_end(up, "parent"))
    driven = {n for a in modules.apparatuses for n in (a.roll, a.pitch)}
    driven |= {s.joint for s in modules.servos}
    found = set()
    for link in links:
        here = link
        joint: ET.Element | None = above.get(link)
        while joint is not None and joint.get("type") == "fixed":
            here = _end(joint, "parent")
            joint = above.get(here)
        if joint is not None and here not in busy and joint.get("name") not in driven:
            found |= {str(joint.get("name"))} if _turns(joint) else set()
    return frozenset(found)


def _end(joint: ET.Element, side: str) -> str:
    node = joint.find(side)
    return "" if node is None else str(node.get("link"))


def _turns(joint: ET.Element) -> bool:
    limit = joint.find("limit")
    if joint.get("type") == "continuous":
        return True
    if joint.get("type") != "revolute":
        return False
    span = inf
    if limit is not None:
        if float(limit.get("effort", 0.0)) == 0.0:
            return True
        span = float(limit.get("upper", 0.0)) - float(limit.get("lower", 0.0))
    return span > TURNS
