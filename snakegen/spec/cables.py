"""Cables that bend an arm in place of servos: where they run, how stiff and how tight they are."""

from typing import Annotated

from pydantic import BeforeValidator, Field, model_validator

from snakegen.spec.fields import NonNegative, Part, Positive, Real, number


class Cables(Part):
    """Cables round the rods of a chain on a fixed base, the same number in every segment."""

    count: Annotated[int, Field(ge=3, le=100), BeforeValidator(number)] = Field(
        3, description="cables a segment"
    )
    radius: Positive = Field(0.03, description="m, of the circle of holes")
    phase: Real = Field(0.0, description="rad, of the first hole from y towards z")
    standoff: Positive = Field(0.02, description="m, from a joint to the holes on either side")
    sheathed: bool = Field(
        False, description="cables start at their own joint instead of running through all before"
    )
    minimum: NonNegative = Field(5.0, description="N, least tension")
    maximum: Positive | None = Field(None, description="N, highest tension; none if absent")
    stiffness: Positive = Field(50000.0, description="N/m, of a winch")
    elasticity: Positive | None = Field(
        None, description="N, EA of a cable; if absent a cable does not stretch"
    )
    friction: NonNegative = Field(0.0, description="coefficient of cable on hole (capstan)")

    @model_validator(mode="after")
    def _range(self) -> "Cables":
        if self.maximum is not None and self.maximum < self.minimum:
            raise ValueError(
                f"cables.minimum: {self.minimum:g} N is above maximum {self.maximum:g} N"
            )
        return self
