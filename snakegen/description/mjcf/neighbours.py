"""Contact excluded between bodies that share a joint, also where one of them is fixed to the world.

MuJoCo's parent filter leaves out a pair of parent and child unless the parent is welded to the
world. Bodies welded together count as one group here, and a group without collision geometry (the
cross of a universal joint) joins those on its two sides as if they shared a joint.
"""

from dataclasses import dataclass, field
from itertools import combinations, product
from typing import Any

import mujoco

from snakegen.robot.modules import Modules

OVERLAP = "overlap_"  # begins the names of excludes of parts that are no neighbours


@dataclass(eq=False)
class _Group:
    """Bodies welded together.

    Attributes:
        joints: names of the joints that move it; none for what is fixed to the world.
        parent: the group that carries it.
        solid: names of its bodies with collision geometry, the world's own body left out.
        children: groups that it carries.
    """

    joints: tuple[str, ...]
    parent: "_Group | None"
    solid: list[str] = field(default_factory=list)
    children: list["_Group"] = field(default_factory=list)


def exclude_neighbours(spec: mujoco.MjSpec, modules: Modules) -> None:
    """Excludes contact between solid bodies that share a joint or have only a cross between them.

    Gimbal modules are excluded from the link that carries their gimbal, and groups that one group
    carries from each other. A link and the link after the next are no neighbours: they may touch.

    Args:
        spec: the robot's.
        modules: names its gimbals.
    """
    gimbals = {n for a in modules.apparatuses for n in (a.roll, a.pitch) if n}
    for group in _groups(spec):
        above = group.parent
        while above is not None and not above.solid:
            above = above.parent
        if group.parent is not None and not group.parent.joints:  # else MuJoCo's filter does it
            _exclude_all(spec, group.parent.solid, group.solid)
        through = not group.solid or not gimbals.isdisjoint(group.joints)
        for child in group.children:
            if above is not None and group.joints and through:
                _exclude_all(spec, above.solid, child.solid)
        for one, two in combinations(group.children, 2):
            _exclude_all(spec, one.solid, two.solid)


def exclude_welded(spec: mujoco.MjSpec) -> None:
    """Excludes, by name, contact that MuJoCo leaves out only because bodies are welded together.

    Its parent filter takes welded bodies for one. Of groups that will get joints inside, contact
    stays left out among their own bodies and with what shares a joint with the group.

    Args:
        spec: the robot's, with the excludes of its neighbours.
    """
    known = {frozenset((e.bodyname1, e.bodyname2)) for e in spec.excludes}
    for group in _groups(spec):
        pairs = list(combinations(group.solid, 2))
        if group.parent is not None:
            pairs += product(group.parent.solid, group.solid)
        for first, second in pairs:
            if frozenset((first, second)) not in known:
                exclude(spec, first, second)


def exclude(spec: mujoco.MjSpec, first: str, second: str, mark: str = "") -> None:
    """Excludes contact between two bodies, once; `mark` begins the name of the exclude."""
    spec.add_exclude(name=f"{mark}{first}_{second}", bodyname1=first, bodyname2=second)


def _exclude_all(spec: mujoco.MjSpec, ones: list[str], twos: list[str]) -> None:
    for first in ones:
        for second in twos:
            exclude(spec, first, second)


def _groups(spec: mujoco.MjSpec) -> list[_Group]:
    """Returns the groups of bodies welded together, parents before children."""
    world = _Group((), None)
    of: dict[str, _Group] = {"world": world}
    out = [world]
    for body in spec.bodies:
        if body.name == "world":
            continue
        group = of[body.parent.name]
        if body.joints:
            carrier, group = group, _Group(tuple(j.name for j in body.joints), group)
            carrier.children.append(group)
            out.append(group)
        of[body.name] = group
        if _solid(body):
            group.solid.append(body.name)
    return out


def _solid(body: Any) -> bool:
    return any(g.contype for g in body.geoms)  # rollers have none: they meet the ground alone
