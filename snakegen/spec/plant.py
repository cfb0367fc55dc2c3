"""Imperfections of the simulated robot, its sensors and surroundings."""

from typing import Annotated

from pydantic import BeforeValidator, Field

from snakegen.spec.fields import (
    NonNegative,
    Part,
    Real,
    number,
)

Share = Annotated[float, Field(ge=0, lt=1), BeforeValidator(number)]


class Uncertainty(Part):
    """Half ranges of uniform draws: what is not known well of a robot (assumed).

    Flights draw them with `--trials`; drives and arms draw masses, inertias and arms' friction in
    every run, the rest with `--trials`.

    Shares of the nominal value, for a mass or an inertia of each body on its own.
    """

    mass: Share = Field(0.05, description="of each body's mass, its inertia with it")
    inertia: Share = Field(0.10, description="of each body's inertia, in addition to its mass")
    thrust: Share = Field(0.05, description="of all rotors' thrust together")
    lag: Share = Field(0.30, description="of all motors' lag")
    delay: NonNegative = Field(0.010, description="s, added to the delay: 0 … this")
    noise: Share = Field(0.50, description="of all sensors' noise")
    ground: Share = Field(0.25, description="of the friction of a drive's wheels on the ground")
    losses: Share = Field(0.50, description="of all of a drive's `plant.losses`")
    friction: Share = Field(
        0.005, description="dry friction of an arm's joints, share of the servo's limit: 0 … this"
    )


class Losses(Part):
    """What a screw drive loses; 0 switches one off."""

    rolling: NonNegative = Field(
        0.0002,
        description="m, moment of rolling friction over the load of a wheel on the ground, for a "
        "hard tyre on a hard floor (assumed)",
    )
    bearing: NonNegative = Field(
        0.0001,
        description="m, moment of a wheel's bearing over its load: friction 0.1 on a pin of 1 mm "
        "radius (assumed)",
    )
    play: NonNegative = Field(
        0.0058,
        description="rad, of yaw and pitch joints from stop to stop (20', as ROBOTIS states it of "
        "MX servos); their encoders are on the motor's side of it",
    )
    cable_mass: NonNegative = Field(
        0.0, description="kg/m of a cable that the tail drags behind; 0: no cable"
    )
    cable_friction: NonNegative = Field(0.4, description="of that cable on the ground (assumed)")
    cable_length: NonNegative = Field(
        1.0, description="m of that cable laid out behind the tail at the start (assumed)"
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
        0.1, description="N·m, standard deviation of the offset of a servo's torque (assumed)"
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
        description="N·m/rad, EI/L of a bending link; 0: rigid. A 25 x 1 mm CFRP tube: 1300",
    )
    link_damping: NonNegative = Field(
        0.0002, description="s, over stiffness: 2 % of critical at 30 Hz (assumed)"
    )
    losses: Losses = Field(Losses(), description="of screw drives: friction, play, a cable")
    uncertainty: Uncertainty = Field(
        Uncertainty(), description="ranges of what many trials are flown over"
    )
