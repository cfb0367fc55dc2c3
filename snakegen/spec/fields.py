"""What specs are made of: checked numbers, places on a chain, one value spread over many."""

import re
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema


def number(value: Any) -> Any:
    """Refuses booleans where a number is meant (YAML reads `yes` as true)."""
    if isinstance(value, bool):
        raise ValueError("a number is needed, not true or false")
    return value


# bounds stand before the check, or the JSON Schema does not know them
Real = Annotated[float, Field(allow_inf_nan=False), BeforeValidator(number)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False), BeforeValidator(number)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False), BeforeValidator(number)]
Fraction = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False), BeforeValidator(number)]
Diagonal = tuple[Positive, Positive, Positive]
Moments = tuple[Positive, Positive, Positive, Real, Real, Real]
Vector = tuple[Real, Real, Real]


class Part(BaseModel):
    """A section of a spec: unknown fields are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def spread(value: Any, count: int, place: str, what: str) -> list[Any]:
    """Returns `value` as a list of `count`: a list of that length as it is, else repeated."""
    if isinstance(value, list):
        if len(value) != count:
            raise ValueError(f"{place}: {len(value)} entries for {count} {what}")
        return list(value)
    return [value] * count


class Place(Part):
    """Where a module stands: link (from 1) and relative position on it."""

    link: Annotated[int, Field(ge=1), BeforeValidator(number)] = Field(
        description="number, from 1 at the root"
    )
    position: Fraction = Field(0.5, description="share of the link's length, 0 at its root end")


_PLACE = re.compile(r"\s*(\d+)\s*(?:@\s*([0-9.eE+-]+)\s*)?")


def place(item: Any) -> Any:
    """Returns the `Place` fields of ``3``, ``"3@0.7"`` or a mapping; others pass through."""
    if isinstance(item, int) and not isinstance(item, bool):
        if item < 1:
            raise ValueError(f"link {item} does not exist; links count from 1")
        return {"link": item}
    if isinstance(item, str):
        match = _PLACE.fullmatch(item)
        if not match:
            raise ValueError(f"'{item}' is no place; write a link number, or link@position")
        link, position = match.groups()
        return place(int(link)) | ({} if position is None else {"position": _share(item)})
    return item


def _share(item: str) -> float:
    try:
        position = float(item.partition("@")[2])
    except ValueError:
        position = -1.0
    if not 0 <= position <= 1:
        raise ValueError(f"'{item.strip()}' is off its link; the position is a share of it, 0…1")
    return position


def _places(value: Any) -> Any:
    if value == "all" or isinstance(value, (int, str)):
        return value if value == "all" else [place(v) for v in str(value).split(",")]
    return [place(v) for v in value] if isinstance(value, list) else value


_ONE_PLACE = {
    "anyOf": [
        {"type": "integer", "minimum": 1},
        {"type": "string", "pattern": f"^{_PLACE.pattern}$"},
        Place.model_json_schema(),
    ]
}
_AS_WRITTEN = WithJsonSchema(
    {
        "anyOf": [
            {"const": "all"},
            {"type": "integer", "minimum": 1},
            {"type": "string", "pattern": f"^{_PLACE.pattern}(,{_PLACE.pattern})*$"},
            {"type": "array", "items": _ONE_PLACE, "minItems": 1},
        ]
    }
)
Places = Annotated[Literal["all"] | list[Place], BeforeValidator(_places), _AS_WRITTEN]


def spell_out(at: Any, links: int, where: str) -> list[Place]:
    """Returns the places of `at` ("all": the middle of every link); errors name the link."""
    if at == "all":
        return [Place(link=i + 1) for i in range(links)]
    for p in at:
        if p.link > links:
            raise ValueError(f"{where}: link {p.link} does not exist; the chain has 1…{links}")
    return list(at)
