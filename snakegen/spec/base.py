"""How the fixed base of an arm is mounted: attitude of link 1, and height above the floor.

World axes have their origin at the base, z up; the floor lies `height` below it.
"""

import math
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from snakegen.spec.fields import NonNegative, Part, Vector

Pose = Literal["stand", "wall", "ceiling", "vertical", "any"]
_RPY: dict[str, tuple[float, float, float]] = {
    "stand": (0.0, 0.0, 0.0),
    "wall": (0.0, 0.0, 0.0),
    "ceiling": (0.0, math.pi / 2, 0.0),
    "vertical": (0.0, -math.pi / 2, 0.0),
}
_CLEAR = 0.05  # m, of free space between the floor and the lowest posture


class Base(Part):
    """A base fixed to the world. Link 1 lies along x of the base."""

    kind: Annotated[Literal["fixed"], BeforeValidator(lambda kind: _fixed(kind))] = Field(
        "fixed", description="link 1 does not move"
    )
    pose: Annotated[Pose, BeforeValidator(lambda pose: _pose(pose))] = Field(
        "stand",
        description="stand or wall: link 1 level; ceiling: it hangs; vertical: it points up from "
        "the floor; any: as rpy says",
    )
    rpy: Vector | None = Field(None, description="rad, attitude of link 1, for pose any")
    height: NonNegative | None = Field(
        None,
        description="m, of the base above the floor; if absent, such that no posture reaches it "
        "(vertical: that no module of link 1 does)",
    )

    @model_validator(mode="after")
    def _one_attitude(self) -> "Base":
        own = _RPY.get(self.pose)
        if own is None and self.rpy is None:
            raise ValueError("base.rpy: pose any needs it, three angles in rad")
        if own is not None and self.rpy not in (None, own):
            raise ValueError(f"base.rpy: pose {self.pose} has its own {list(own)}; take pose any")
        return self


_MEANT: dict[str, Pose] = {
    "floor": "stand",
    "ground": "stand",
    "table": "stand",
    "pedestal": "stand",
    "wall_mounted": "wall",
    "hanging": "ceiling",
    "roof": "ceiling",
    "upside_down": "ceiling",
    "inverted": "ceiling",
    "upright": "vertical",
    "standing": "vertical",
}
"""What people write for a pose, and the pose."""


def _known(base: Any) -> Any:
    """Refuses a name that is no base, with the field in which a pose would work."""
    if base in ("floating", "fixed"):
        return base
    word = str(base).lower().replace("-", "_")
    poses = get_args(Pose)
    pose = _MEANT.get(word, word)
    works = f"write base.pose: {pose}" if pose in poses else f"base.pose is {_or(poses)}"
    raise ValueError(f"base: floating or fixed is needed (got '{base}'); of a fixed one, {works}")


def _pose(pose: Any) -> Any:
    """Refuses what is no pose, with the one that may be meant."""
    poses = get_args(Pose)
    if pose in poses:
        return pose
    meant = _MEANT.get(str(pose).lower().replace("-", "_"))
    hint = f"; try '{meant}'" if meant else ""
    raise ValueError(f"base.pose: {_or(poses)} is needed (got '{pose}'){hint}")


def _fixed(kind: Any) -> Any:
    """Refuses the pose of a base that is not fixed."""
    if kind == "fixed":
        return kind
    raise ValueError(
        f"base.kind: fixed is needed where a pose, rpy or height is given (got '{kind}')"
    )


def _or(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"


def _written(base: Any) -> str:
    return "name" if isinstance(base, str) else "mapping"


def _any_of(schema: dict[str, Any]) -> None:
    schema["anyOf"] = schema.pop("oneOf")


AnyBase = Annotated[
    Annotated[Literal["floating", "fixed"], BeforeValidator(_known), Tag("name")]
    | Annotated[Base, Tag("mapping")],
    Discriminator(_written),
    Field(json_schema_extra=_any_of),
]


def resolve_base(base: "str | Base", sections: dict[str, Any]) -> Any:
    """Returns the base as plain data: ``floating``, or pose, attitude and height of a fixed one.

    Args:
        base: as written.
        sections: the other sections of the spec, resolved.
    """
    if base == "floating":
        return base
    fixed = base if isinstance(base, Base) else Base()
    rpy = fixed.rpy if fixed.rpy is not None else _RPY[fixed.pose]
    height = _height(fixed.pose, sections) if fixed.height is None else fixed.height
    return {"kind": "fixed", "pose": fixed.pose, "rpy": list(rpy), "height": height}


def _height(pose: str, sections: dict[str, Any]) -> float:
    """Returns a height [m] at which the chain, however bent, stays above the floor."""
    chain, aside = sections["chain"], _overhang(sections)
    if pose == "vertical":
        return round(aside, 3) if aside > max(chain["radius"]) else 0.0
    out = sum(chain["length"][1:]) + sum(sections["joint"]["gap"]) + aside
    if pose in ("ceiling", "any"):
        out += chain["length"][0]
    return math.ceil((out + _CLEAR) * 20 - 1e-9) / 20


def _overhang(sections: dict[str, Any]) -> float:
    """Returns how far any part of the robot is from its links' axes [m], at most."""
    out = [*sections["chain"]["radius"]]
    part = sections.get("vectoring_apparatus")
    if part is not None:
        out += [
            math.hypot(separation / 2, offset) + diameter
            for separation, offset, diameter in zip(
                part["separation"], part["offset"], part["rotor_diameter"], strict=True
            )
        ]
    if "screw_drive" in sections:
        drive = sections["screw_drive"]
        out.append(math.hypot(drive["radius"], drive["length"] / 2) + drive["wheel_radius"])
    if "caster" in sections:
        caster = sections["caster"]
        out += [math.hypot(*pair) for pair in zip(caster["drop"], caster["track"], strict=True)]
    if "payload" in sections:
        part = sections["payload"]
        sizes = part.get("box_size") and [math.hypot(*part["box_size"])] * len(part["mass"])
        centre = math.hypot(*part.get("box_centre", (0.0,)))
        out += [
            math.hypot(*offset) + centre + size
            for offset, size in zip(part["offset"], sizes or part["radius"], strict=True)
        ]
    return float(max(out))
