"""What a screw drive loses: rolling and bearing friction of its wheels, play, a trailing cable.

A description's wheels turn freely: both frictions go with a wheel's load, which drives know. As a
constant of the MJCF they would keep wheels with little load from rolling: tried with the nominal
load, `screw4` drove 9 % too fast and 54 mm to one side in 4 s.
"""

from dataclasses import dataclass, fields

from snakegen.errors import SpecError, near


@dataclass(frozen=True)
class Losses:
    """Values of a spec's `plant.losses`, with its defaults; 0 switches one off."""

    rolling: float = 2e-4  # m, moment of rolling friction over load, wheel on ground
    bearing: float = 1e-4  # m, moment of a wheel's bearing over its load
    play: float = 0.0058  # rad, of yaw and pitch joints, between stops
    cable_mass: float = 0.0  # kg/m
    cable_friction: float = 0.4
    cable_length: float = 1.0  # m, laid out behind the tail at the start

    @property
    def arm(self) -> float:
        """Moment that holds a loaded wheel from rolling, over its load [m]."""
        return self.rolling + self.bearing

    @staticmethod
    def of(values: dict[str, float]) -> "Losses":
        """Returns those of a `<losses>` element; absent ones are default."""
        known = [f.name for f in fields(Losses)]
        for name in values:
            if name not in known:
                raise SpecError(f"plant.losses has no field '{name}'.{near(name, known)}")
        return Losses(**values)


NONE = Losses(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""An ideal drive: wheels that roll freely, joints without play, no cable."""
