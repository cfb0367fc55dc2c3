"""A study: what of a robot is free, what a design must keep to, and what it is judged by."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationError

from snakegen.base import yaml_file
from snakegen.base.bounded_text import what_is_there
from snakegen.design_search.grammar import FIGURES, MEASURES, NAMES, unknown
from snakegen.errors import SnakegenError
from snakegen.spec.fields import NonNegative, Part, Positive, Real, number

FORMAT = 1


class StudyError(SnakegenError):
    """A mistake in a study file, or a study that has no answer."""


class CatalogueEntry(Part):
    """A part that can be bought: what it sets on every apparatus or joint."""

    name: str = Field(description="of the part")
    mass: Positive = Field(description="kg, of one; sets the mass of the module that holds it")
    price: NonNegative = Field(0.0, description="of one")
    set: dict[str, Real] = Field(default_factory=dict, description="spec fields: their values")


class Variable(Part):
    """One free variable: a range, a choice, or a catalogue; exactly one of them."""

    range: tuple[Real, Real] | None = Field(None, description="least and largest value")
    choices: list[Any] | None = Field(None, description="values to choose from")
    catalogue: list[CatalogueEntry] | None = Field(None, description="parts to choose from")
    of: Literal["apparatus", "joint"] = Field("apparatus", description="what a part belongs to")


class Objective(Part):
    """What a design is judged by."""

    quantile: Annotated[float, Field(gt=0, le=0.5), BeforeValidator(number)] = Field(
        0.01, description="share of postures that may be worse"
    )
    over: Literal["range", "motion"] = Field("range", description="which postures")

    @property
    def option(self) -> list[str]:
        """Which of quantile and over are given."""
        return sorted(self.model_fields_set & {"quantile", "over"})


class Bound(Objective):
    """Limits of a figure of a design."""

    min: Real | None = Field(None, description="least value")
    max: Real | None = Field(None, description="largest value")


class Opening(Part):
    """An upright rectangle that some posture is to pass."""

    width: Positive = Field(description="m")
    height: Positive = Field(description="m")


class Postures(Part):
    """The postures over which margins are taken."""

    yaw: Positive = Field(1.5707963267948966, description="rad, largest |yaw| of a joint")
    pitch: Positive = Field(1.5707963267948966, description="rad, largest |pitch| of a joint")
    away: NonNegative = Field(
        0.0, description="rad, least norm of the joint angles: distance from the straight body"
    )
    search: Annotated[int, Field(ge=64, le=8192)] = Field(256, description="postures in the search")
    certify: Annotated[int, Field(ge=256, le=65536)] = Field(
        4096, description="other postures, of which the figures that are shown are taken"
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="of both sets")
    motion: list[dict[str, Real]] = Field(
        default_factory=list, description="waypoints by joint, rad; joints not named are at 0"
    )
    step: Positive = Field(0.05, description="rad, largest joint motion between instants")
    holding: NonNegative = Field(
        1.0, description="N·m, torque margin that a posture must keep for reach and opening"
    )


class Search(Part):
    """How long to search."""

    evaluations: Annotated[int, Field(ge=50, le=1_000_000)] = Field(
        3000, description="designs, about"
    )
    weights: Annotated[int, Field(ge=1, le=21)] = Field(
        5, description="trades between objectives that are searched"
    )
    bound: bool = Field(False, description="prove how good the first objective can get at best")
    gap: Annotated[float, Field(gt=0, lt=1)] = Field(0.05, description="of that proof")


class Study(Part):
    """A design study; `snakegen design --example` prints one with comments."""

    format: int = Field(description="of this file: 1")
    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="of the study")
    about: str = Field("", description="the question, in a sentence")
    robot: str = Field(description="preset or spec file that the designs are variations of")
    fixed: dict[str, Any] = Field(default_factory=dict, description="fields set in all designs")
    variables: dict[str, Variable] = Field(description="free fields of the spec")
    constraints: dict[str, Bound] = Field(default_factory=dict, description="by figure")
    objectives: dict[str, Objective | None] = Field(description="by name")
    opening: Opening | None = Field(None, description="of opening_clearance_m")
    postures: Postures = Field(Postures(), description="over which margins are taken")
    search: Search = Field(Search(), description="how long to search")


def read_study(path: Path) -> Study:
    """Reads and checks a study file.

    Raises:
        StudyError: one line that says what, where and what would have worked.
    """
    if not path.is_file():
        there = what_is_there(path)
        raise StudyError(f"{path}: {there}; `snakegen design --example` prints a study.")
    data = yaml_file.read(path)
    if not isinstance(data, dict):
        raise StudyError(f"{path.name}: a study is a mapping with 'robot' and 'variables'.")
    return check_study(data, path.name)


def check_study(data: dict[str, Any], label: str) -> Study:
    """Returns the checked study of plain data; `label` names it in errors."""
    if data.get("format") != FORMAT:
        raise StudyError(
            f"{label}: format {data.get('format')!r} is of another version of snakegen; this one "
            f"reads format {FORMAT}."
        )
    try:
        study = Study.model_validate(data)
    except ValidationError as error:
        raise StudyError(f"{label}: {_explained(error, data)}") from None
    if not study.variables:
        raise StudyError(f"{label}: no free variables; name at least one field under 'variables'.")
    for name, variable in study.variables.items():
        given = [variable.range, variable.choices, variable.catalogue]
        if sum(x is not None for x in given) != 1 or not any(given):
            raise StudyError(
                f"{label}: variables.{name}: one of 'range', 'choices', 'catalogue' is needed."
            )
        if variable.range is not None and not variable.range[0] < variable.range[1]:
            raise StudyError(f"{label}: variables.{name}: the range {variable.range} is empty.")
    if not study.objectives:
        raise StudyError(f"{label}: no objectives; known are {', '.join(NAMES)}.")
    for section in ("objectives", "constraints"):
        for name in getattr(study, section):
            if name not in NAMES:
                raise StudyError(f"{label}: {section}.{name}{unknown(name)}")
    _check_options(study, label)
    asked = {*study.objectives, *study.constraints}
    if "opening_clearance_m" in asked and study.opening is None:
        raise StudyError(
            f"{label}: opening_clearance_m needs the opening: "
            "write 'opening: {width: 0.6, height: 0.5}', m."
        )
    priced = "price" in study.objectives or "price" in study.constraints
    if priced and not any(v.catalogue for v in study.variables.values()):
        raise StudyError(f"{label}: a price needs a variable with a catalogue.")
    return study


def _check_options(study: Study, label: str) -> None:
    """Checks limits, and how each figure is taken."""
    for name, bound in study.constraints.items():
        if bound.min is None and bound.max is None:
            raise StudyError(f"{label}: constraints.{name}: 'min' or 'max' is needed.")
        if bound.min is not None and bound.max is not None and bound.min > bound.max:
            raise StudyError(
                f"{label}: constraints.{name}: min {bound.min:g} and max {bound.max:g} contradict "
                "each other."
            )
        if bound.option and name in study.objectives:
            raise StudyError(
                f"{label}: constraints.{name}: '{bound.option[0]}' is that of the objective of "
                "this name; leave it out here."
            )
    rows = [("objectives", n, o or Objective()) for n, o in study.objectives.items()]
    rows += [("constraints", n, b) for n, b in study.constraints.items()]
    for section, name, ask in rows:
        used = [o for o in ask.option if name in FIGURES or not _uses(name, o)]
        if used:
            raise StudyError(f"{label}: {section}.{name}: '{used[0]}' has no meaning for it.")
        if ask.over == "motion" and len(study.postures.motion) < 2:
            raise StudyError(f"{label}: {section}.{name}: postures.motion needs two waypoints.")


def _uses(name: str, option: str) -> bool:
    """Tells whether a figure over postures has an option."""
    return option == "over" or MEASURES[name].how == "quantile"


def _explained(error: ValidationError, data: Any) -> str:
    """Returns the first of pydantic's errors by its place."""
    first = error.errors()[0]
    place = ".".join(str(k) for k in first["loc"])
    if first["type"] == "missing" and place.endswith("mass"):
        return f"{place}: a catalogue's parts need masses, in kg."
    if first["type"] == "extra_forbidden":
        return f"there is no field '{place}'."
    text = first["msg"].removeprefix("Value error, ")
    return f"{place}: {text[0].lower()}{text[1:]}."
