"""How a spec's robot is flown: mode, rates, gain sets."""

from typing import Literal

from pydantic import Field, model_validator

from snakegen.spec.fields import (
    NonNegative,
    Part,
    Positive,
    Real,
    Vector,
)


class GainSet(Part):
    """Gains of eqs 15–19 (ZN23), per axis, and of eqs 23–28 for under-actuated models."""

    force_p: Vector = Field(
        (3.6, 3.6, 2.8), description="1/s²: force per mass and metre of error; x, y, z"
    )
    force_i: Vector = Field((0.03, 0.03, 1.2), description="1/s³; x, y, z")
    force_d: Vector = Field((4.0, 4.0, 2.8), description="1/s; x, y, z")
    torque_p: Vector = Field(
        (15.0, 15.0, 10.0), description="1/s²: torque per inertia and radian of error; x, y, z"
    )
    torque_i: Vector = Field((0.3, 0.3, 0.1), description="1/s³; x, y, z")
    torque_d: Vector = Field((5.0, 5.0, 5.0), description="1/s; x, y, z")
    attitude_roll: Real = Field(1.0, description="k_φ")
    attitude_pitch: Real = Field(0.0, description="k_θ")
    vectoring_roll: Real | list[Real] = Field(1.0, description="k_φi, per apparatus")
    vectoring_pitch: Real | list[Real] = Field(1.0, description="k_θi, per apparatus")


class Control(Part):
    """Which law flies the robot, with which gains."""

    mode: Literal["virtual_single_rotor", "dual_rotor"] = Field(
        "virtual_single_rotor", description="both rotors of a pair alike, or each on its own"
    )
    axes: Literal["auto", "root", "middle"] = Field(
        "auto", description="link whose axes the CoG frame has; auto: root up to 8 links"
    )
    attitude_rate: Positive = Field(200.0, description="Hz")
    position_rate: Positive = Field(40.0, description="Hz")
    sigma_min: NonNegative = Field(0.02, description="least scaled σ_min(J_w) that is flown")
    vibration_damping: NonNegative = Field(
        0.0, description="N s/m, of internal forces that damp what bends; 0: off (ZN23 section 6)"
    )
    vibration_bandwidth: Positive = Field(
        5.0, description="Hz, up to which elastic modes are damped (assumed: motors lag beyond)"
    )
    rate_filter: NonNegative | None = Field(
        None,
        description="Hz, cut-off of the low-pass on body rates and the CoG's velocity; 0: none. If "
        "absent 10 where links bend (plant.link_stiffness) or are more than 8, else none (assumed)",
    )
    gains: str = Field("paper", description="the gain set used unless asked otherwise")
    gain_sets: dict[str, GainSet] = Field({"paper": GainSet()}, description="gains by name")

    @model_validator(mode="after")
    def _known(self) -> "Control":
        if self.gains not in self.gain_sets:
            raise ValueError(
                f"gains must be one of {', '.join(self.gain_sets)} (got '{self.gains}')"
            )
        half = 0.5 * self.attitude_rate
        if self.rate_filter is not None and not self.rate_filter < half:
            raise ValueError(
                f"rate_filter: {self.rate_filter:g} Hz; below {half:g} Hz, half the "
                "attitude_rate, would do"
            )
        return self
