"""RobotSpec: the grammar of chains and modules, typed and checked.

A quantity of a link, joint or apparatus may be one value or a list with an entry each. `resolved`
spells every list out and computes what was left open; the templates read nothing else.
"""

from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo, model_validator

from snakegen.base.yaml_file import refuse_executable
from snakegen.errors import SpecError
from snakegen.spec.resolution import resolve
from snakegen.spec.sections import SpecSections


class RobotSpec(SpecSections):
    """One robot: a chain on a base, and what its links carry."""

    @model_validator(mode="before")
    @classmethod
    def _plain(cls, data: Any) -> Any:
        try:
            refuse_executable(data)  # names of gain sets too: xacro would run what they hold
        except SpecError as error:
            raise ValueError(str(error).rstrip(".")) from None
        return data

    @cached_property
    def scaled(self) -> tuple[str, ...]:
        """Inertias that follow masses and sizes set over a file's; no field either."""
        return ()

    @cached_property
    def variant(self) -> str:
        """Name of the folder for what is made of it: `name`, and what was changed on the way."""
        return self.name

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> "RobotSpec":
        if info.context is not None:
            self.__dict__["folder"] = Path(info.context["folder"])
        if self.cables is not None and self.base == "floating":
            raise ValueError("cables: they start at a fixed base; this one is floating")
        resolve(self)  # every list length, link number and inertia is checked where it is used
        return self

    def __repr__(self) -> str:
        """Returns name, links, base and modules in one line."""
        modules = ("vectoring_apparatus", "screw_drive", "caster", "payload", "cables", "battery")
        carried = [name for name in modules if getattr(self, name) is not None]
        base = "floating" if self.base == "floating" else "fixed"
        parts = [f"{self.chain.links} links", f"{base} base", *carried]
        return f"RobotSpec({self.name}: {', '.join(parts)})"

    __str__ = __repr__

    def resolved(self) -> dict[str, Any]:
        """Returns the spec as plain data with lists spelled out and inertias computed."""
        return resolve(self)
