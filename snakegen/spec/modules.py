"""What links carry, in the grammar of a spec: apparatuses, screw drums, casters, payloads."""

from typing import Literal

from pydantic import Field

from snakegen.spec.fields import (
    Diagonal,
    Moments,
    NonNegative,
    Part,
    Place,
    Places,
    Positive,
    Real,
    Vector,
    spread,
)


class Servo(Part):
    """A position servo as the simulator sees it."""

    stiffness: Positive = Field(200.0, description="N·m/rad")
    damping: NonNegative = Field(10.0, description="N·m·s/rad")
    armature: NonNegative = Field(0.005, description="kg·m², reflected rotor inertia")
    friction: NonNegative = Field(0.0, description="N·m, dry friction of the joint")


class VectoringApparatus(Part):
    """Rotors behind a roll and a pitch gimbal (ZN23 Fig 2B), on any subset of links."""

    at: Places = Field("all", description='"all", or places: 1, "2@0.3", {link: 2, position: 0.8}')
    rotors: Literal[1, 2] | list[Literal[1, 2]] = Field(2, description="1 or 2, per apparatus")
    separation: Positive | list[Positive] = Field(0.223, description="m, between the two rotors")
    offset: Real | list[Real | None] | None = Field(
        None,
        description="m, pitch axis above the roll axis; if absent 0.037 for a pair of rotors, and "
        "for one rotor as far below as its duct takes to clear the link",
    )
    thrust_min: Real | list[Real] = Field(
        0.0, description="N a rotor; negative where it can turn backwards"
    )
    thrust_max: Positive | list[Positive] = Field(16.0, description="N a rotor")
    drag_ratio: NonNegative | list[NonNegative] = Field(0.0125, description="κ, m")
    spin: Literal["alternating", "same"] | list[list[Literal[-1, 1]]] = Field(
        "alternating", description="(+,−) on odd, (−,+) on even apparatuses; or a list for each"
    )
    roll_limit: Positive | list[Positive] = Field(3.14159265, description="rad, |φ|")
    pitch_limit: Positive | list[Positive] = Field(3.14159265, description="rad, |θ|")
    effort: Positive | list[Positive] = Field(3.0, description="N·m, both gimbal servos")
    velocity: Positive | list[Positive] = Field(12.5, description="rad/s, both gimbal servos")
    servo: Servo = Field(
        Servo(stiffness=100.0, damping=2.1, armature=0.005), description="of both gimbals"
    )
    roll_mass: Positive | list[Positive] = Field(0.46, description="kg, module on the roll axis")
    roll_inertia: Diagonal | list[Diagonal] | None = Field(
        None, description="kg·m², Ixx Iyy Izz on the roll axis; of a box if absent"
    )
    pitch_mass: Positive | list[Positive] = Field(0.53, description="kg, module with the rotors")
    pitch_inertia: Diagonal | list[Diagonal] | None = Field(
        None, description="kg·m², Ixx Iyy Izz on the pitch axis; of a box if absent"
    )
    rotor_diameter: Positive | list[Positive] = Field(0.07, description="m")
    rotor_inertia: NonNegative | list[NonNegative] = Field(
        1.5e-5, description="kg·m², of one spinning rotor about its axis (assumed)"
    )
    rotor_speed: Positive | list[Positive] = Field(
        3500.0, description="rad/s at thrust_max (assumed); speed grows as the root of thrust"
    )
    motor_lag: NonNegative | list[NonNegative] = Field(0.035, description="s, first order")

    def spins(self, count: int) -> list[list[int]]:
        """Returns the spin (±1) of each rotor of each of `count` apparatuses."""
        rotors = spread(self.rotors, count, "vectoring_apparatus.rotors", "apparatuses")
        if isinstance(self.spin, list):
            spins = spread(self.spin, count, "vectoring_apparatus.spin", "apparatuses")
            for j, (one, n) in enumerate(zip(spins, rotors, strict=True)):
                if len(one) != n:
                    raise ValueError(
                        f"vectoring_apparatus.spin[{j}]: {len(one)} spins for {n} rotors"
                    )
            return [[int(s) for s in one] for one in spins]
        flip = -1 if self.spin == "alternating" else 1
        return [[flip**j, -(flip**j)][:n] for j, n in enumerate(rotors)]


class Wheels(Part):
    """The passive wheels of one drum, blade by blade, in the drum's frame."""

    position: list[Vector] = Field(description="m, of each wheel's centre")
    rpy: list[Vector] = Field(description="rad; the axle is the wheel's z")
    blade: list[int] = Field(description="from 1")
    wheel: list[int] = Field(description="place on its blade, from 1")
    half_length: NonNegative = Field(description="m, along the axle; 0 for a ball")


Hand = Literal["left", "right"]


class ScrewDrive(Part):
    """Drums with passive wheels on helical blades (HA section II), turning about their links.

    Drums are alike but for place, helix angle and hand: one radius, or the body would not lie
    level.
    """

    at: Places = Field("all", description='"all", or places as of an apparatus')
    offset: NonNegative | list[NonNegative] | None = Field(
        None, description="m, link's start to the drum's centre (HA's L1); or by the place's share"
    )
    helix_angle: Real | list[Real] = Field(
        0.7853981633974483, description="rad, |α|, more than 0 and less than 90°"
    )
    hand: Literal["left", "right", "alternating"] | list[Hand] = Field(
        "alternating", description="left is α > 0; alternating: right, left, right …"
    )
    radius: Positive = Field(0.075, description="m, from the drum's centre to the ground")
    length: Positive | None = Field(
        None, description="m, of the drum; what its wheels need if absent"
    )
    blades: int = Field(8, ge=1, le=64, description="of a drum")
    wheels_per_blade: int = Field(4, ge=1, le=64, description="on each blade")
    wheel_radius: Positive = Field(0.012, description="m, across its axle (assumed)")
    rollers: Literal["helix_capsule", "ring_sphere", "ellipsoid", "ball"] = Field(
        "helix_capsule",
        description="wheels on their blades, or in one ring; ball: one for all, in the MJCF alone",
    )
    mass: Positive | list[Positive] = Field(0.7, description="kg, of a drum without wheels")
    inertia: Diagonal | list[Diagonal] | None = Field(None, description="kg·m², of the drum")
    wheel_mass: Positive = Field(0.00625, description="kg, of one wheel")
    friction: Positive = Field(0.8, description="of the wheels on the ground (assumed)")
    effort: Positive = Field(10.0, description="N·m, of a screw's motor")
    velocity: Positive = Field(10.0, description="rad/s, of a screw's motor")
    gain: Positive = Field(10.0, description="N·m·s/rad, of its rate servo")
    armature: NonNegative = Field(0.02, description="kg·m², of motor and gear")
    alpha: list[Real] | None = Field(None, description="rad, signed; computed by `build`")
    wheels: list[Wheels] | None = Field(None, description="computed by `build`")

    def signs(self, count: int) -> list[int]:
        """Returns the sign of α of each of `count` drums: +1 left, -1 right."""
        if self.hand == "alternating":
            return [(-1) ** (i + 1) for i in range(count)]
        hands = spread(self.hand, count, "screw_drive.hand", "drums")
        return [1 if hand == "left" else -1 for hand in hands]


class Caster(Part):
    """Two frictionless balls side by side under a link: they carry what the drums cannot."""

    at: Places = Field(
        [{"link": 1, "position": 0.0}], validate_default=True, description="places; 1@0 if absent"
    )
    drop: Positive | list[Positive] | None = Field(
        None, description="m, from the link's axis down to the ground; the drums' radius if absent"
    )
    track: Positive | list[Positive] = Field(0.12, description="m, between the balls (assumed)")
    radius: Positive | list[Positive] = Field(0.012, description="m, of a ball (assumed)")
    mass: Positive | list[Positive] = Field(0.05, description="kg (assumed)")
    inertia: Diagonal | list[Diagonal] | None = Field(
        None, description="kg·m², Ixx Iyy Izz; of the balls if absent"
    )


class Payload(Part):
    """Lumps fixed to links: spheres of `radius`, or solids that a mesh file bounds."""

    at: Places = Field(description='places: 1, "2@0.3", {link: 2, position: 0.8}')
    mass: Positive | list[Positive] = Field(description="kg each")
    offset: Vector | list[Vector] = Field((0.0, 0.0, 0.0), description="m, from the link's axis")
    radius: Positive | list[Positive] = Field(0.03, description="m, of the sphere")
    mesh: str | None = Field(
        None, description="binary STL or OBJ file, metres, in the spec's folder; for the sphere"
    )
    com: Vector | list[Vector] | None = Field(
        None, description="m, centre of mass in the payload's axes; the mesh's, or 0, if absent"
    )
    inertia: Diagonal | Moments | list[Diagonal | Moments] | None = Field(
        None,
        description="kg·m², Ixx Iyy Izz, or these with Ixy Ixz Iyz, about the centre of mass; "
        "from the sphere or the mesh if absent",
    )
    box_size: Diagonal | None = Field(
        None, description="m, the box that represents the mesh in contacts; around it if absent"
    )
    box_centre: Vector | None = Field(None, description="m, of that box")


class Battery(Part):
    """A battery whose mass the links' masses leave out; its energy is `plant.battery_energy`."""

    mass: Positive = Field(description="kg")
    at: Places = Field([Place(link=1)], description='one place: 1, "2@0.3"')
    radius: Positive = Field(0.03, description="m, of the sphere that gives its inertia")
