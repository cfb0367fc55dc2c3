"""RobotSpec: the grammar of chains and modules, typed and checked.

A quantity of a link, joint or apparatus may be one value or a list with an entry each. `resolved`
spells every list out and computes what was left open; the templates read nothing else.
"""

from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from snakegen.base.yaml_file import refuse_executable
from snakegen.errors import SpecError
from snakegen.spec.base import AnyBase
from snakegen.spec.cables import Cables
from snakegen.spec.fields import (
    Diagonal,
    Fraction,
    NonNegative,
    Part,
    Positive,
    Real,
    Vector,
    number,
    spread,
)
from snakegen.spec.modules import Battery, Caster, Payload, ScrewDrive, Servo, VectoringApparatus

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
        None, description="kg m², Ixx Iyy Izz about the centre of mass; from rod and mass if absent"
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
        None, description="kg m², of that body; of a box if absent"
    )
    lower: Real | list[Real] | None = Field(None, description="rad; -upper if absent")
    upper: Real | list[Real] = Field(1.5707963267948966, description="rad")
    effort: Positive | list[Positive] = Field(7.0, description="N m, servo limit")
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
            raise ValueError(f"gains: '{self.gains}' is none of {list(self.gain_sets)}")
        half = 0.5 * self.attitude_rate
        if self.rate_filter is not None and not self.rate_filter < half:
            raise ValueError(
                f"rate_filter: {self.rate_filter:g} Hz; below {half:g} Hz, half the "
                "attitude_rate, would do"
            )
        return self


Share = Annotated[float, Field(ge=0, lt=1), BeforeValidator(number)]


class Uncertainty(Part):
    """Half ranges of uniform draws: what is not known well of a robot (assumed).

    Flights draw them with `--trials`, drives and arms in every run.

    Shares of the nominal value, for a mass or an inertia of each body on its own.
    """

    mass: Share = Field(0.05, description="of each body's mass, its inertia with it")
    inertia: Share = Field(0.10, description="of each body's inertia, beside its mass")
    thrust: Share = Field(0.05, description="of all rotors' thrust together")
    lag: Share = Field(0.30, description="of all motors' lag")
    delay: NonNegative = Field(0.010, description="s, added to the delay: 0 … this")
    noise: Share = Field(0.50, description="of all sensors' noise")
    friction: Share = Field(
        0.005, description="dry friction of an arm's joints, share of the servo's limit: 0 … this"
    )


class Plant(Part):
    """Imperfections of the simulated robot, its sensors and its surroundings.

    Each has a default with its source; 0 or false switches it off. Servo stiffness, friction and
    torque limits, drag torque, rotor inertia, payload and battery are fields of the parts that have
    them.
    """

    thrust_mismatch: NonNegative = Field(
        0.03, description="standard deviation, relative, per rotor, constant a run (assumed)"
    )
    drive_mismatch: NonNegative = Field(
        0.01,
        description="standard deviation, relative, of what each screw drum turns of what it is "
        "asked, constant a run: radius and helix as made (assumed)",
    )
    position_noise: NonNegative = Field(
        0.0005, description="m, standard deviation of motion capture, < 2 of them (ZN23: < 1 mm)"
    )
    attitude_bias: NonNegative = Field(
        0.00698,
        description="rad, standard deviation between runs, < 2 of them (0.4°; ZN23: IMU < 1°)",
    )
    attitude_noise: NonNegative = Field(
        0.00175, description="rad, white, < 2 standard deviations (0.1°, assumed)"
    )
    gyro_noise: NonNegative = Field(0.01, description="rad/s, white (assumed)")
    velocity_noise: NonNegative = Field(0.01, description="m/s, white (assumed)")
    joint_noise: NonNegative = Field(
        0.00175, description="rad, standard deviation of a joint's offset (0.1°, assumed)"
    )
    torque_noise: NonNegative = Field(
        0.1, description="N m, standard deviation of the offset of a servo's torque (assumed)"
    )
    imu_rate: NonNegative = Field(
        500.0, description="Hz, of attitude and angular rate (assumed); 0: at every physics step"
    )
    delay: NonNegative = Field(
        0.005,
        description="s, from sensing to command: one tick at 200 Hz (assumed); between two ticks "
        "it is interpolated",
    )
    motor_lag: bool = Field(True, description="motors lag (vectoring_apparatus.motor_lag)")
    servo_speed: bool = Field(True, description="commands keep to the servos' speed limits")
    gyroscopic: bool = Field(True, description="moments of the spinning rotors, -d(HΩ)/dt")
    air_density: NonNegative = Field(
        1.2, description="kg/m³ (20 °C, sea level); 0: no drag, wind, streams, ground effect"
    )
    drag_coefficient: NonNegative = Field(
        1.1, description="of links across the flow (Hoerner: a cylinder, subcritical)"
    )
    ground_effect: bool = Field(True, description="Cheeseman and Bennett (1955)")
    downwash: bool = Field(True, description="rotors' streams act on rotors and links (assumed)")
    wind_speed: NonNegative = Field(0.0, description="m/s, steady")
    wind_direction: Real = Field(0.0, description="rad, where the wind blows to, from +x")
    turbulence: NonNegative = Field(0.0, description="m/s, standard deviation (Dryden)")
    battery_energy: NonNegative = Field(
        0.0, description="Wh, of a full battery; 0: endless. `hover` has the flight time"
    )
    voltage_sag: Share = Field(
        0.1,
        description="share of voltage lost from full to empty (assumed); thrust limits go as V², "
        "what a rotor gives below them is regulated",
    )
    link_stiffness: NonNegative = Field(
        0.0,
        description="N m/rad, EI/L of a bending link; 0: rigid. A 25 x 1 mm CFRP tube: 1300",
    )
    link_damping: NonNegative = Field(
        0.0002, description="s, over stiffness: 2 % of critical at 30 Hz (assumed)"
    )
    uncertainty: Uncertainty = Field(
        Uncertainty(), description="ranges of what many trials are flown over"
    )


class RobotSpec(Part):
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

    @model_validator(mode="before")
    @classmethod
    def _plain(cls, data: Any) -> Any:
        try:
            refuse_executable(data)  # names of gain sets too: xacro would run what they hold
        except SpecError as error:
            raise ValueError(str(error).rstrip(".")) from None
        return data

    @cached_property
    def folder(self) -> Path:
        """The folder that file names in the spec start from; no field, so no part of equality."""
        return Path()

    @cached_property
    def scaled(self) -> tuple[str, ...]:
        """Inertias that follow masses and sizes set over a file's; no field either."""
        return ()

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> "RobotSpec":
        from snakegen.spec.resolution import resolve

        if info.context is not None:
            self.__dict__["folder"] = Path(info.context["folder"])
        if self.cables is not None and self.base == "floating":
            raise ValueError("cables: they start at a fixed base; this one is floating")
        resolve(self)  # every list length, link number and inertia is checked where it is used
        return self

    def resolved(self) -> dict[str, Any]:
        """Returns the spec as plain data with lists spelled out and inertias computed."""
        from snakegen.spec.resolution import resolve

        return resolve(self)
