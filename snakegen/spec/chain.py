"""The chain of a spec: links, and the joints between them."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, field_validator

from snakegen.spec.fields import (
    Diagonal,
    Fraction,
    NonNegative,
    Part,
    Positive,
    Real,
    number,
    spread,
)
from snakegen.spec.modules import Servo

MAX_LINKS = 1000


Axis = Literal["roll", "pitch", "yaw"]


class Chain(Part):
    """N links in a row; link frames stand at the root end with x along the rod."""

    links: Annotated[int, Field(ge=1, le=MAX_LINKS), BeforeValidator(number)] = Field(
        description="number of links"
    )
    length: Positive | list[Positive] = Field(description="m, per link")
    mass: Positive | list[Positive] = Field(description="kg, per link, without modules")
    radius: Positive | list[Positive] = Field(0.0125, description="m, of the rod")
    wall: Positive | list[Positive] | None = Field(None, description="m; solid if absent")
    com: Fraction | list[Fraction] = Field(0.5, description="centre of mass along the link, 0…1")
    inertia: Diagonal | list[Diagonal] | None = Field(
        None, description="kg·m², Ixx Iyy Izz about the centre of mass; from rod and mass if absent"
    )


def _pitch_yaw() -> list[Axis]:
    return ["pitch", "yaw"]


class Joint(Part):
    """What joins two links: one or two axes, with a body in the gap.

    The body of a two-axis joint is its cross, between the axes. That of a one-axis joint is a
    block between the link before and the axis; it is there if a gap, mass or inertia is given.
    """

    axes: list[Axis] | list[list[Axis]] = Field(
        default_factory=_pitch_yaw,
        description="axes from root to tip; or a list of them per joint",
    )
    gap: NonNegative | list[NonNegative] = Field(
        0.0, description="m, first to second axis, or link's end to the axis where it is one"
    )
    mass: Positive | list[Positive | None] | None = Field(
        None,
        description="kg, of the joint's body; if absent 0.1 for a two-axis joint or with a gap, "
        "else no body",
    )
    inertia: Diagonal | list[Diagonal | None] | None = Field(
        None, description="kg·m², of that body; of a box if absent"
    )
    lower: Real | list[Real] | None = Field(None, description="rad; -upper if absent")
    upper: Real | list[Real] = Field(1.5707963267948966, description="rad")
    effort: Positive | list[Positive] = Field(7.0, description="N·m, servo limit")
    velocity: Positive | list[Positive] = Field(1.0, description="rad/s, servo limit")
    servo: Servo = Field(Servo(), description="the servo of every axis")

    @field_validator("axes")
    @classmethod
    def _one_or_two(cls, axes: Any) -> Any:
        nested = not axes or isinstance(axes[0], list)
        for one in axes if nested else [axes]:
            if len(one) not in (1, 2) or len(set(one)) != len(one):
                raise ValueError(f"{one}: one axis, or two different ones, of roll, pitch, yaw")
        return axes

    def axes_of(self, count: int) -> list[list[str]]:
        """Returns the axes of each of `count` joints."""
        nested = not self.axes or isinstance(self.axes[0], list)
        per_joint = self.axes if nested else [list(self.axes)] * count
        return spread(list(per_joint), count, "joint.axes", "joints")
