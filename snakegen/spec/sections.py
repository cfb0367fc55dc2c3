"""The sections of a spec, typed; `resolution` spells them out, `RobotSpec` checks them together."""

from functools import cached_property
from pathlib import Path

from pydantic import Field

from snakegen.spec.base import AnyBase
from snakegen.spec.cables import Cables
from snakegen.spec.chain import Chain, Joint
from snakegen.spec.control import Control
from snakegen.spec.fields import (
    Part,
)
from snakegen.spec.modules import Battery, Caster, Payload, ScrewDrive, VectoringApparatus
from snakegen.spec.plant import Plant


class SpecSections(Part):
    """One robot: a chain on a base, and what its links carry."""

    name: str = Field(
        pattern=r"^[A-Za-z][A-Za-z0-9_]*$",
        max_length=64,
        description="of robot and files: a letter, then letters, digits and _",
    )
    about: str = Field("", description="one line for `snakegen presets`")
    base: AnyBase = Field(
        "floating", description="free, or link 1 fixed to the world, mounted as `pose` says"
    )
    chain: Chain = Field(description="the links")
    joint: Joint = Field(Joint(), description="what joins two links")
    vectoring_apparatus: VectoringApparatus | None = Field(None, description="rotors on gimbals")
    screw_drive: ScrewDrive | None = Field(None, description="drums with passive wheels")
    caster: Caster | None = Field(None, description="balls that hold the body upright")
    payload: Payload | None = Field(None, description="lumps fixed to links")
    cables: Cables | None = Field(None, description="cables of an arm, for `analyze cables`")
    battery: Battery | None = Field(None, description="a battery of its own mass")
    control: Control = Field(Control(), description="which law flies the robot, and its gains")
    plant: Plant = Field(Plant(), description="what is imperfect in the simulated robot")

    @cached_property
    def folder(self) -> Path:
        """The folder that file names in the spec start from; no field, so no part of equality."""
        return Path()
