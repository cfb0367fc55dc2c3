"""Differences between the parts of two robots, each with its size and a sentence."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.pipeline.robot_parts import ActuatorPart, BodyPart, JointPart, RobotParts

_SMALL = 1e-6  # SI units: smaller values are compared to it
_PASSIVE = (
    ("damping", "N·m·s/rad"),
    ("friction", "N·m"),
    ("armature", "kg·m²"),
    ("spring stiffness", "N·m/rad"),
)


@dataclass(frozen=True)
class PartDifference:
    """One difference.

    Attributes:
        kind: ``link``, ``joint``, ``body``, ``actuator`` or ``base``.
        name: of the part, as the first file has it.
        quantity: as in ``mass``.
        first, second: values, ``-`` where a file has none.
        error: relative, or rad where directions differ; infinite where a part is missing.
        text: a sentence.
    """

    kind: str
    name: str
    quantity: str
    first: str
    second: str
    error: float
    text: str


@dataclass(frozen=True)
class Comparison:
    """Two robots in matching names and axes.

    Attributes:
        first, second: the robots.
        names: how each is called in sentences.
        size: m, of the robot, the lever of its errors.
    """

    first: RobotParts
    second: RobotParts
    names: tuple[str, str]
    size: float

    def differences(self) -> Iterator[PartDifference]:
        """Yields every difference, however small."""
        a, b = self.first, self.second
        if None not in (a.floating, b.floating) and a.floating != b.floating:
            words = {True: "free", False: "fixed"}
            yield self._differ(
                "base", "base", "base", words[bool(a.floating)], words[bool(b.floating)], math.inf
            )
        yield from self._missing("link", a.frames, b.frames)
        yield from self._missing("joint", a.joints, b.joints)
        for name in a.frames.keys() & b.frames.keys():
            yield from self._frame(name, a.frames[name], b.frames[name])
        for name in a.joints.keys() & b.joints.keys():
            yield from self._joint(name, a.joints[name], b.joints[name])
        total = max(sum(body.mass for body in parts.bodies.values()) for parts in (a, b))
        for key in a.bodies.keys() & b.bodies.keys():
            yield from self._body(key, a.bodies[key], b.bodies[key], total)
        if a.actuators is not None and b.actuators is not None:
            yield from self._missing("actuator", a.actuators, b.actuators)
            for name in a.actuators.keys() & b.actuators.keys():
                yield from self._actuator(name, a.actuators[name], b.actuators[name])

    def _differ(
        self, kind: str, name: str, quantity: str, one: str, other: str, error: float
    ) -> PartDifference:
        where = "" if kind == "base" else f" of {kind} '{name}'"
        a, b = self.names
        text = f"{quantity}{where}: {one} in {a}, {other} in {b}"
        return PartDifference(kind, name, quantity, one, other, error, text)

    def _missing(self, kind: str, a: dict[str, Any], b: dict[str, Any]) -> Iterator[PartDifference]:
        for names, has in ((a.keys() - b.keys(), 0), (b.keys() - a.keys(), 1)):
            for name in names:
                hint = ""
                if twins := self._twins(kind, name, has):
                    hint = f"; '{twins}' has its place there: a map may rename it"
                text = f"{kind} '{name}' is in {self.names[has]} alone{hint}"
                sides = ("present", "-") if has == 0 else ("-", "present")
                yield PartDifference(kind, name, "presence", *sides, math.inf, text)

    def _twins(self, kind: str, name: str, has: int) -> str | None:
        """Returns the only nameless counterpart of a part in the other file."""
        here, there = (self.first, self.second)[:: 1 if has == 0 else -1]
        if kind == "link":
            pose = here.frames[name]
            near = [
                n
                for n, p in there.frames.items()
                if n not in here.frames and np.abs(p - pose).max() < 1e-6 * max(self.size, 1.0)
            ]
        elif kind == "joint":
            one = here.joints[name]
            near = [
                n
                for n, other in there.joints.items()
                if n not in here.joints and other.kind == one.kind and self._coaxial(one, other)
            ]
        else:
            one_, others = (here.actuators or {})[name], there.actuators or {}
            near = [
                n
                for n, other in others.items()
                if n not in (here.actuators or {})
                and other.target == one_.target
                and np.allclose(other.gear, one_.gear, atol=1e-6)
            ]
        return near[0] if len(near) == 1 else None

    def _coaxial(self, one: JointPart, other: JointPart) -> bool:
        apart = _off_axis(one, other)
        return _turn(one.axis, other.axis) < 1e-6 and apart < 1e-6 * max(self.size, 1.0)

    def _frame(self, name: str, a: Floats, b: Floats) -> Iterator[PartDifference]:
        gap = float(np.linalg.norm(a[:3, 3] - b[:3, 3]))
        one, other = _vector(a[:3, 3], "m"), _vector(b[:3, 3], "m")
        yield self._differ("link", name, "position", one, other, gap / self.size)
        angle = rotation_angle(a[:3, :3].T @ b[:3, :3])
        text_there = f"turned by {angle:.6g} rad"
        yield self._differ("link", name, "attitude", "as here", text_there, angle)

    def _joint(self, name: str, a: JointPart, b: JointPart) -> Iterator[PartDifference]:
        if a.kind != b.kind:
            yield self._differ("joint", name, "type", a.kind, b.kind, math.inf)
            return
        if a.carrier != b.carrier:
            one, other = (p.carrier or "the base" for p in (a, b))
            yield self._differ("joint", name, "body that carries it", one, other, math.inf)
        if np.any(a.axis):
            one, other = _vector(a.axis, ""), _vector(b.axis, "")
            yield self._differ("joint", name, "axis", one, other, _turn(a.axis, b.axis))
        gap = _off_axis(a, b) / self.size
        yield self._differ(
            "joint", name, "axis position", _vector(a.anchor, "m"), _vector(b.anchor, "m"), gap
        )
        unit = "m" if a.kind == "prismatic" else "rad"
        for k, what in enumerate(("lower limit", "upper limit")):
            yield from self._value("joint", name, what, a.limits[k], b.limits[k], unit, 0.01)
        yield from self._effort(name, a, b)
        if not math.isnan(a.velocity + b.velocity):
            yield from self._value("joint", name, "velocity", a.velocity, b.velocity, f"{unit}/s")
        for (what, unit_), x, y in zip(_PASSIVE, a.passive, b.passive, strict=True):
            yield from self._value("joint", name, what, x, y, unit_)
        if (a.mimic is None) != (b.mimic is None) or (
            a.mimic and b.mimic and a.mimic[0] != b.mimic[0]
        ):
            one, other = (p.mimic[0] if p.mimic else "none" for p in (a, b))
            yield self._differ("joint", name, "leader (mimic)", one, other, math.inf)
        elif a.mimic and b.mimic:
            ratios = ("mimic multiplier", "mimic offset")
            for what, x, y in zip(ratios, a.mimic[1:], b.mimic[1:], strict=True):
                yield from self._value("joint", name, what, x, y, "")

    def _effort(self, name: str, a: JointPart, b: JointPart) -> Iterator[PartDifference]:
        """Yields differing force limits; a URDF's 0 against an MJCF is no statement."""
        mixed = self.first.format != self.second.format
        for parts, joint in ((self.first, a), (self.second, b)):
            if mixed and parts.format == "URDF" and not joint.effort[1] > 0:
                return
        if np.any(np.isnan(a.effort)) or np.any(np.isnan(b.effort)):
            return
        unit = "N" if a.kind == "prismatic" else "N·m"
        if a.effort[0] == -a.effort[1] and b.effort[0] == -b.effort[1]:
            yield from self._value("joint", name, "effort", a.effort[1], b.effort[1], unit)
            return
        for k, what in enumerate(("least effort", "effort")):
            yield from self._value("joint", name, what, a.effort[k], b.effort[k], unit)

    def _body(self, key: str, a: BodyPart, b: BodyPart, total: float) -> Iterator[PartDifference]:
        name = a.link or b.link or "base"
        yield from self._value("body", name, "mass", a.mass, b.mass, "kg", floor=1e-6 * total)
        if min(a.mass, b.mass) <= 0.0:
            return
        gap = float(np.linalg.norm(a.centre - b.centre)) / self.size
        one, other = _vector(a.centre, "m"), _vector(b.centre, "m")
        yield self._differ("body", name, "centre of mass", one, other, gap)
        scale = max(float(np.abs(p.inertia).max()) for p in (a, b))
        away = np.abs(a.inertia - b.inertia)
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(away)), (3, 3)))
        floor = max(scale, 1e-9 * total * self.size**2)
        entry = "xyz"[min(i, j)] + "xyz"[max(i, j)]
        error = float(away[i, j]) / floor if floor > 0 else 0.0
        one, other = (f"{p.inertia[i, j]:.9g} kg·m²" for p in (a, b))
        yield self._differ("body", name, f"inertia i{entry}", one, other, error)

    def _actuator(self, name: str, a: ActuatorPart, b: ActuatorPart) -> Iterator[PartDifference]:
        if a.target != b.target:
            one, other = (
                p.target.removesuffix(" ") + ("base" * p.target.endswith(" ")) for p in (a, b)
            )
            yield self._differ("actuator", name, "target", one, other, math.inf)
            return
        thrust = a.target.startswith("body")
        scale = max(float(np.abs(p.gear).max()) for p in (a, b)) or 1.0
        gap = float(np.abs(a.gear - b.gear).max()) / scale
        what = "thrust and drag direction (gear)" if thrust else "gear"
        one, other = _gear(a.gear), _gear(b.gear)
        yield self._differ("actuator", name, what, one, other, gap)
        if thrust:
            gap = float(np.linalg.norm(a.point - b.point)) / self.size
            one, other = _vector(a.point, "m"), _vector(b.point, "m")
            yield self._differ("actuator", name, "thrust point", one, other, gap)
        values = [("gain", a.gain, b.gain, ""), ("lag", a.lag, b.lag, "s")]
        for what, k in (
            ("constant bias", 0),
            ("stiffness of the bias", 1),
            ("damping of the bias", 2),
        ):
            values.append((what, a.bias[k], b.bias[k], ""))
        for k, end in enumerate(("least", "most")):
            values.append((f"{end} command (range)", a.command[k], b.command[k], ""))
            values.append((f"{end} force (range)", a.force[k], b.force[k], ""))
        for what, x, y, unit in values:
            yield from self._value("actuator", name, what, x, y, unit)

    def _value(
        self, kind: str, name: str, what: str, a: float, b: float, unit: str, floor: float = _SMALL
    ) -> Iterator[PartDifference]:
        if a == b or (math.isnan(a) and math.isnan(b)):
            return
        finite = math.isfinite(a) and math.isfinite(b)
        error = abs(a - b) / max(abs(a), abs(b), floor) if finite else math.inf
        one, other = (f"{x:.9g} {unit}".strip() if math.isfinite(x) else "none" for x in (a, b))
        yield self._differ(kind, name, what, one, other, error)


def rotation_angle(rotation: Floats) -> float:
    """Returns the angle (rad) of a rotation, exact near 0."""
    skewed = 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    return float(np.arctan2(np.linalg.norm(skewed), 0.5 * (np.trace(rotation) - 1.0)))


def _turn(a: Floats, b: Floats) -> float:
    """Returns the angle (rad) between two unit directions."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _off_axis(a: JointPart, b: JointPart) -> float:
    """Returns how far b's anchor lies from a's axis; a slide has no place."""
    if a.kind == "prismatic" or b.kind == "prismatic":
        return 0.0
    step = b.anchor - a.anchor
    return float(np.linalg.norm(step - (step @ a.axis) * a.axis))


def _vector(values: Floats, unit: str) -> str:
    return f"({', '.join(f'{x:.6g}' for x in values + 0.0)}) {unit}".strip()


def _gear(values: Floats) -> str:
    shown = values if np.any(np.abs(values[1:]) > 0) else values[:1]
    return _vector(shown, "") if len(shown) > 1 else f"{shown[0]:.6g}"
