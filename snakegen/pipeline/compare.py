"""`compare`: whether two files, URDF or MJCF of any tool, describe the same robot."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats, rpy_from_rotation
from snakegen.errors import DescriptionError, near
from snakegen.pipeline.part_differences import Comparison, PartDifference, rotation_angle
from snakegen.pipeline.robot_parts import RobotParts

TOLERANCE = 1e-6


@dataclass(frozen=True)
class RobotComparison:
    """The outcome of a comparison.

    Attributes:
        same: whether nothing differs by more than the tolerance.
        differences: texts, the largest first.
        details: the same as data.
        notes: what was not compared, and where the second robot's root stands.
        root_offset: (4, 4) pose of the second file's world in the first's, taken out.
    """

    same: bool
    differences: tuple[str, ...]
    details: tuple[PartDifference, ...]
    notes: tuple[str, ...]
    root_offset: Floats

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        rows = [asdict(d) for d in self.details]
        for row in rows:
            row["error"] = row["error"] if np.isfinite(row["error"]) else None
        return {
            "same": self.same,
            "differences": list(self.differences),
            "details": rows,
            "notes": list(self.notes),
            "root_offset": {
                "position_m": [float(x) for x in self.root_offset[:3, 3]],
                "rpy_rad": [float(x) for x in rpy_from_rotation(self.root_offset[:3, :3])],
            },
        }


def compare(
    a: str | Path,
    b: str | Path,
    *,
    names: Mapping[str, str] | None = None,
    modules: str | Path | None = None,
    tolerance: float = TOLERANCE,
) -> RobotComparison:
    """Compares two robot files part by part.

    Compared with all joint coordinates at 0: link frames, joint axes and their places, types,
    limits, effort, damping, friction, armature, followers; mass, centre of mass and inertia of
    each moving body (a link and what is fixed to it); actuators with gear, gain, ranges and lag.
    A common offset of the second file's root is found and taken out. Shapes, colours, sensors
    and solver options are not compared.

    Args:
        a: a URDF or MJCF file.
        b: the other one.
        names: names in `a` of links, joints and actuators, to their names in `b`.
        modules: a modules file, for a URDF that has no <snakegen> element.
        tolerance: error above which a difference counts: relative, or rad for directions.

    Raises:
        DescriptionError: a file that is no sound URDF or MJCF, or a map with unknown names.
    """
    first, second = (_read(Path(p), modules) for p in (a, b))
    if names:
        first = _renamed(first, second, names)
    offset = _root_offset(first, second)
    second = _moved(second, offset)
    first, second, notes = _comparable(first, second)
    called = (Path(a).name, Path(b).name)
    if called[0] == called[1]:
        called = (str(a), str(b))
    size = _size(first)
    found = [
        d for d in Comparison(first, second, called, size).differences() if d.error > tolerance
    ]
    tilt = rotation_angle(_tilt(offset))
    if False in (first.floating, second.floating) and tilt > tolerance:
        text_there = f"turned by {tilt:.6g} rad against gravity"
        text = f"attitude of the base: {text_there} in {called[1]}"
        found.append(PartDifference("base", "base", "attitude", "as here", text_there, tilt, text))
    found.sort(key=lambda d: (-d.error, d.kind, d.name, d.quantity))
    return RobotComparison(
        not found,
        tuple(d.text for d in found),
        tuple(found),
        (*_offset_note(offset, called[1], size), *notes),
        offset,
    )


def _read(path: Path, modules: str | Path | None) -> RobotParts:
    """Reads a file by its root element."""
    from snakegen.linter.xml_tree import XmlFault, parse_xml
    from snakegen.pipeline.mjcf_parts import mjcf_parts
    from snakegen.pipeline.urdf_parts import urdf_parts
    from snakegen.spec.urdf import read_urdf

    text = read_urdf(path)
    try:
        root = parse_xml(text)
    except XmlFault as fault:
        raise DescriptionError(f"{path}: line {fault.line}: {fault.message}.") from None
    if root.tag == "mujoco":
        return mjcf_parts(path)
    if root.tag == "robot":
        return urdf_parts(path, None if modules is None else Path(modules))
    raise DescriptionError(
        f"{path}: its root element is <{root.tag}>; a URDF has <robot>, an MJCF <mujoco>."
    )


def _renamed(a: RobotParts, b: RobotParts, names: Mapping[str, str]) -> RobotParts:
    """Returns `a` with the names that `b` has.

    Raises:
        DescriptionError: a name that `a` or `b` does not have.
    """
    for parts, given in ((a, list(names)), (b, list(names.values()))):
        known = {*parts.frames, *parts.joints, *(parts.actuators or {})}
        for name in given:
            if not isinstance(name, str) or name not in known:
                raise DescriptionError(
                    f"map: {parts.source} has no link, joint or actuator '{name}'."
                    f"{near(str(name), known)}"
                )

    def new(name: str) -> str:
        return names.get(name, name)

    def target(text: str) -> str:
        kind, _, name = text.partition(" ")
        return f"{kind} {new(name)}"

    return replace(
        a,
        frames={new(n): pose for n, pose in a.frames.items()},
        joints={
            new(n): replace(
                j,
                carrier=new(j.carrier),
                link=new(j.link),
                mimic=None if j.mimic is None else (new(j.mimic[0]), *j.mimic[1:]),
            )
            for n, j in a.joints.items()
        },
        bodies={new(k): replace(body, link=new(body.link)) for k, body in a.bodies.items()},
        actuators=None
        if a.actuators is None
        else {new(n): replace(x, target=target(x.target)) for n, x in a.actuators.items()},
    )


def _root_offset(a: RobotParts, b: RobotParts) -> Floats:
    """Returns the pose of b's world in a's that most of their common frames agree on."""
    votes: Counter[bytes] = Counter()
    poses: dict[bytes, Floats] = {}
    for name in a.frames.keys() & b.frames.keys() - {"world"}:
        pose = a.frames[name] @ _inverse(b.frames[name])
        key = (np.round(pose, 5) + 0.0).tobytes()
        votes[key] += 1
        poses.setdefault(key, pose)
    if not votes:
        return np.eye(4)
    most = max(votes.values())
    best = min(
        (poses[key] for key, count in votes.items() if count == most),
        key=lambda pose: float(np.abs(pose - np.eye(4)).max()),
    )
    best = best if np.abs(best - np.eye(4)).max() > 1e-9 else np.eye(4)
    return np.asarray(best)


def _inverse(pose: Floats) -> Floats:
    out = np.eye(4)
    out[:3, :3] = pose[:3, :3].T
    out[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return out


def _moved(parts: RobotParts, offset: Floats) -> RobotParts:
    """Returns `parts` in another world's axes; the world's own frame stays where it is."""
    turn, shift = offset[:3, :3], offset[:3, 3]

    def gear(values: Floats) -> Floats:
        return np.concatenate([turn @ values[:3], turn @ values[3:]])

    actuators = None
    if parts.actuators is not None:
        actuators = {
            n: replace(x, gear=gear(x.gear), point=shift + turn @ x.point)
            if x.target.startswith("body")
            else x
            for n, x in parts.actuators.items()
        }
    return replace(
        parts,
        frames={n: pose if n == "world" else offset @ pose for n, pose in parts.frames.items()},
        joints={
            n: replace(j, axis=turn @ j.axis, anchor=shift + turn @ j.anchor)
            for n, j in parts.joints.items()
        },
        bodies={
            k: replace(
                body, centre=shift + turn @ body.centre, inertia=turn @ body.inertia @ turn.T
            )
            for k, body in parts.bodies.items()
        },
        actuators=actuators,
    )


def _comparable(a: RobotParts, b: RobotParts) -> tuple[RobotParts, RobotParts, list[str]]:
    """Leaves out what one of the two cannot say; returns notes about it."""
    notes = []
    for parts in (a, b):
        notes += [f"{parts.source}: {note} not compared" for note in parts.notes]
    for one, other in ((a, b), (b, a)):
        if one.actuators is None and other.actuators:
            notes.append(
                f"{one.source} does not say what drives it: actuators are compared by their "
                "effort on the joints alone"
            )
        if one.floating is None and other.floating:
            notes.append(f"{one.source} does not say whether its base is free")
    if "world" not in a.frames or "world" not in b.frames:  # MJCF always has one, URDF seldom
        a, b = (
            replace(p, frames={n: f for n, f in p.frames.items() if n != "world"}) for p in (a, b)
        )
    balls = {n for p in (a, b) for n, j in p.joints.items() if j.kind == "ball"}
    for name in sorted(balls & a.joints.keys() & b.joints.keys()):
        if a.joints[name].kind != b.joints[name].kind:
            a, b = _without(a, name), _without(b, name)
            notes.append(f"'{name}' is a ball in one file: what it turns is not compared")
    return a, b, notes


def _without(parts: RobotParts, top: str) -> RobotParts:
    """Returns `parts` without joint `top` and all that it carries."""
    gone, names = {top}, list(parts.joints)
    while more := {n for n in names if n not in gone and parts.joints[n].carrier in gone}:
        gone |= more
    links = {parts.joints[n].link for n in gone}
    kept = None
    if parts.actuators is not None:
        kept = {n: x for n, x in parts.actuators.items() if x.target.split(" ")[1] not in gone}
    return replace(
        parts,
        frames={n: f for n, f in parts.frames.items() if n not in links},
        joints={n: j for n, j in parts.joints.items() if n not in gone},
        bodies={k: x for k, x in parts.bodies.items() if k not in gone},
        actuators=kept,
    )


def _size(parts: RobotParts) -> float:
    """Returns the extent of a robot [m], by which places are compared."""
    points = [f[:3, 3] for f in parts.frames.values()]
    points += [body.centre for body in parts.bodies.values()]
    extent = float(np.ptp(np.array(points), axis=0).max()) if points else 0.0
    return extent if extent > 1e-3 else 1.0


def _tilt(offset: Floats) -> Floats:
    """Returns the rotation that is left of an offset without its turn about the vertical."""
    up = offset[:3, :3] @ [0.0, 0.0, 1.0]
    angle = float(np.arctan2(np.hypot(up[0], up[1]), up[2]))
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _offset_note(offset: Floats, name: str, size: float) -> tuple[str, ...]:
    if np.abs(offset - np.eye(4)).max() <= TOLERANCE * max(size, 1.0):
        return ()
    place, turn = offset[:3, 3], rpy_from_rotation(offset[:3, :3])
    where = ", ".join(f"{x:.6g}" for x in np.round(offset[:3, :3].T @ -place, 9) + 0.0)
    about = ", ".join(f"{x:.6g}" for x in -turn + 0.0) if np.count_nonzero(turn) < 2 else ""
    turned = f", turned by rpy ({about}) rad" if about and np.any(turn) else ""
    turned = turned or (", turned" if np.any(np.abs(turn) > 1e-9) else "")
    return (f"the root stands at ({where}) m of the other's in {name}{turned}; taken out",)
