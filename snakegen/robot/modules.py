"""What a link carries, as data: reads the <snakegen> element and the modules file.

URDF cannot say where thrust acts or how strong a servo is. A URDF from snakegen holds this in one
<snakegen> element; for someone else's URDF a modules file (YAML) says the same.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from math import hypot, inf
from typing import Any, cast

from snakegen.robot.losses import Losses
from snakegen.robot.modules_element import find_element


@dataclass(frozen=True)
class Rotor:
    """A rotor; thrust acts at `position` of `link` along `axis` (link axes)."""

    link: str
    thrust_min: float  # N
    thrust_max: float  # N
    drag_ratio: float  # m, signed: torque on the body about the thrust axis per newton, -κ s
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    lag: float = 0.035  # s, first order
    diameter: float = 0.1  # m
    inertia: float = 0.0  # kg·m², of the spinning part about its axis
    speed: float = 3500.0  # rad/s at thrust_max
    spin: float = 0.0  # +1 counter-clockwise about `axis`, -1, or 0: as the drag ratio says
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, of its disc's centre
    name: str = ""  # of a rotor that shares its link with others
    stream_efficiency: float = 0.0  # see `robot.stream_losses`; 0: by momentum theory

    @property
    def label(self) -> str:
        """The name of its site, actuator and columns: its own, or its link's."""
        return self.name or self.link


@dataclass(frozen=True)
class Apparatus:
    """Rotors behind up to two gimbal joints."""

    rotors: tuple[Rotor, ...]
    roll: str | None = None  # joint names
    pitch: str | None = None
    link: str | None = None  # the link that carries it

    @property
    def rotor_labels(self) -> list[str]:
        """Names of its rotors."""
        return [r.label for r in self.rotors]


@dataclass(frozen=True)
class Screw:
    """A screw drum with passive wheels (HA II B) on a continuous joint about the link's x."""

    joint: str
    link: str  # the link that carries it
    alpha: float  # rad, helix angle, positive: left-handed
    radius: float  # m, from the drum's centre to the ground
    blades: int = 8
    wheels_per_blade: int = 4
    wheel_radius: float = 0.012  # m
    rollers: str = "ring_sphere"  # contact representation, one of wheel_layout.ROLLERS
    friction: float = 0.8
    torque: float = 10.0  # N·m
    gain: float = 10.0  # N·m·s/rad, of the velocity servo
    armature: float = 0.02  # kg·m²


@dataclass(frozen=True)
class Caster:
    """Two balls at y = ±track/2 of a link's frame, which stands on the ground."""

    link: str
    track: float = 0.12  # m
    radius: float = 0.012  # m


@dataclass(frozen=True)
class Servo:
    """A position servo on a joint."""

    joint: str
    stiffness: float = 200.0  # N·m/rad
    damping: float = 10.0  # N·m·s/rad
    armature: float = 0.0  # kg·m²
    friction: float = 0.0  # N·m


@dataclass(frozen=True)
class Mount:
    """How a fixed base is held."""

    pose: str = "stand"  # stand, wall, ceiling, vertical or any
    height: float = 0.0  # m, of the base above the floor


@dataclass(frozen=True)
class Cables:
    """Cables of an arm, as in the spec."""

    count: int = 3
    radius: float = 0.03  # m
    phase: float = 0.0  # rad
    standoff: float = 0.02  # m
    sheathed: bool = False
    minimum: float = 5.0  # N
    maximum: float = inf  # N
    stiffness: float = 5e4  # N/m, of a winch
    elasticity: float = inf  # N, EA
    friction: float = 0.0


@dataclass(frozen=True)
class Modules:
    """Everything that analyses, plant and controller need besides the URDF proper."""

    floating: bool = True
    lengths: dict[str, float] = field(default_factory=dict)  # m, by link name
    apparatuses: tuple[Apparatus, ...] = ()
    servos: tuple[Servo, ...] = ()
    screws: tuple[Screw, ...] = ()
    casters: tuple[Caster, ...] = ()
    mount: Mount | None = None  # None: free, or nobody knows
    cables: Cables | None = None
    control: dict[str, Any] = field(default_factory=dict)
    gain_sets: dict[str, dict[str, Any]] = field(default_factory=dict)
    plant: dict[str, float] = field(default_factory=dict)
    uncertainty: dict[str, float] = field(default_factory=dict)
    losses: Losses = field(default_factory=Losses)  # of screw drives


def from_urdf(text: str) -> Modules | None:
    """Returns the modules of a URDF's <snakegen> element, or None where it has none.

    Raises:
        DescriptionError: a mistake in the element, with its line.
    """
    element = find_element(text)
    if element is None:
        return None
    control = element.find("control")
    plant, uncertainty = element.find("plant"), element.find("plant/uncertainty")
    mount, cables = element.find("mount"), element.find("cables")
    return Modules(
        floating=element.get("base") == "floating",
        lengths={e.attrib["name"]: _real(e, "length") for e in element.findall("link")},
        apparatuses=tuple(_apparatus(e) for e in element.findall("vectoring_apparatus")),
        servos=tuple(_fill(Servo, e) for e in element.findall("servo")),
        screws=tuple(_screw(e) for e in element.findall("screw_drive")),
        casters=tuple(_fill(Caster, e) for e in element.findall("caster")),
        mount=None if mount is None else _fill(Mount, mount),
        cables=None if cables is None else _cables(cables),
        control={} if control is None else _attributes(control),
        gain_sets={}
        if control is None
        else {e.attrib["name"]: _gains(e) for e in control.findall("gains")},
        plant=_numbers(plant),
        uncertainty=_numbers(uncertainty),
        losses=Losses.of(_numbers(element.find("plant/losses"))),
    )


def _numbers(element: ET.Element | None) -> dict[str, float]:
    return {} if element is None else {k: float(v) for k, v in element.attrib.items()}


def _apparatus(element: ET.Element) -> Apparatus:
    rotors = []
    for e in element.findall("rotor"):
        x, y, z = (float(part) for part in e.get("axis", "0 0 1").split())
        norm = hypot(x, y, z)
        axis = (x, y, z) if abs(norm - 1.0) < 1e-9 else (x / norm, y / norm, z / norm)
        given: dict[str, Any] = {"axis": axis}
        if "position" in e.attrib:
            a, b, c = (float(part) for part in e.attrib["position"].split())
            given["position"] = (a, b, c)
        rotors.append(_fill(Rotor, e, **given))
    return Apparatus(tuple(rotors), element.get("roll"), element.get("pitch"), element.get("link"))


def _cables(element: ET.Element) -> Cables:
    given = {"count": int(_real(element, "count"))} if "count" in element.attrib else {}
    sheathed = bool(float(element.get("sheathed", "0")))
    return cast(Cables, _fill(Cables, element, sheathed=sheathed, **given))


def _screw(element: ET.Element) -> Screw:
    counts = {
        name: int(_real(element, name))
        for name in ("blades", "wheels_per_blade")
        if name in element.attrib
    }
    return cast(Screw, _fill(Screw, element, **counts))


def _fill(kind: Any, element: ET.Element, **given: Any) -> Any:
    """Returns dataclass `kind` from an element's attributes; names are text, the rest numbers."""
    values = dict(given)
    for name, f in kind.__dataclass_fields__.items():
        if name not in values and name in element.attrib:
            values[name] = element.attrib[name] if f.type is str else _real(element, name)
    return kind(**values)


def _attributes(element: ET.Element) -> dict[str, Any]:
    return {k: _number_or_text(v) for k, v in element.attrib.items()}


def _gains(element: ET.Element) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in element.attrib.items():
        if key != "name":
            numbers = tuple(float(x) for x in value.split())
            single = key in ("attitude_roll", "attitude_pitch")
            out[key] = numbers[0] if single else numbers
    return out


def _number_or_text(value: str) -> Any:
    try:
        return float(value)
    except ValueError:
        return value


def _real(element: ET.Element, name: str) -> float:
    return float(element.attrib[name])
