"""Contact that rolls: what MuJoCo needs beyond the URDF for screw drums, their wheels and casters.

Decorates an MjSpec that has bodies `link{i}`, `screw{i}` (a hinge of that name turning about the
link's x), wheels `wheel{i}_{b}_{k}` (free hinges) and `caster{j}`. Only this file knows friction,
solver settings and contact masks of a drive; HA itself has no contact model.
"""

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from snakegen.errors import DescriptionError
from snakegen.robot.modules import Modules
from snakegen.spec.wheel_layout import WheelLayout, wheel_layout

HEAD = "control_point"  # site at P
GROUND_BIT = 2  # contact bit of floors, ceilings and steps: rollers meet these and nothing else

# A wheel of a few grams creeps at rad/s under MuJoCo's default friction of joints before it holds.
_STICKS = [0.9999, 0.9999, 0.001, 0.5, 2.0]
DRUM_BIT = 4  # contact bit of drums' envelopes: these meet one another


@dataclass(frozen=True)
class ScrewContact:
    """How the drums of a drive touch the ground; values are HA's or assumed (parameters.md)."""

    alpha: tuple[float, ...]
    radius: float = 0.075
    blades: int = 8
    wheels_per_blade: int = 4
    rollers: str = "ring_sphere"
    wheel_radius: float = 0.012
    friction: float = 0.8
    # Beyond gain · timestep ≈ armature the solver, which does not see the servo's damping, takes
    # the drum for lighter than it is: at 20 N·m·s and 0.005 kg·m² the balls slip 0.05 m/s.
    screw_gain: float = 10.0  # N·m·s/rad of the screw's velocity servo
    screw_torque: float = 10.0  # N·m
    screw_armature: float = 0.02  # kg·m², motor and gear reflected to the drum

    def layout(self, unit: int) -> WheelLayout:
        """Returns the wheels of unit `unit`, counted from 0."""
        return wheel_layout(
            self.alpha[unit],
            self.radius,
            self.blades,
            self.wheels_per_blade,
            self.rollers,
            self.wheel_radius,
        )


def set_options(spec: mujoco.MjSpec, timestep: float = 0.002) -> None:
    """Sets the integrator and solver under which rolling contact neither creeps nor chatters."""
    option = spec.option
    option.timestep = timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.impratio = 20.0
    option.iterations = 30


def _body(spec: mujoco.MjSpec, name: str) -> mujoco.MjsBody:
    """Returns the body of that name, else raises."""
    body = spec.body(name)
    if body is None:
        raise DescriptionError(f"the model has no body '{name}', which a screw drive needs.")
    return body


def _hinge(spec: mujoco.MjSpec, unit: int) -> mujoco.MjsJoint:
    """Returns the hinge that turns a drum, else raises."""
    joint = spec.joint(f"screw{unit + 1}")
    if joint is None:
        raise DescriptionError(f"the model has no joint 'screw{unit + 1}' to turn that drum.")
    return joint


def _strip(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> None:
    """Takes away what of a body could touch something; what is only seen stays."""
    for geom in list(body.geoms):
        if geom.contype or geom.conaffinity:
            spec.delete(geom)


def _roller(geom: mujoco.MjsGeom, contact: ScrewContact) -> None:
    """Gives a geom the friction and masks of a roller: it touches the ground and nothing else."""
    geom.contype, geom.conaffinity = 0, GROUND_BIT
    geom.condim = 3
    geom.friction = [contact.friction, 0.0, 0.0]
    geom.priority = 1
    # A tyre: at five time steps the load passes from wheel to wheel without lifting a unit off;
    # at two, the mean twist error over fifteen shapes and twists rises from 0.3 to 1.4 %.
    # Long ellipsoids share the load by two or three; damped critically, the wheel that enters takes
    # more of it than the one that leaves, and the twist is off by 2 %: half of that damping.
    geom.solref = [0.01, 0.5 if contact.rollers == "ellipsoid" else 1.0]
    geom.solimp = [0.9, 0.95, 0.001, 0.5, 2.0]
    geom.mass = 0.0
    geom.group = 3


def _wheels(spec: mujoco.MjSpec, unit: int, contact: ScrewContact) -> None:
    """Replaces the collision shapes of one unit's wheels by those of the contact model."""
    layout = contact.layout(unit)
    kind, size = {
        "ring_sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, [layout.radius, 0, 0]),
        "helix_capsule": (mujoco.mjtGeom.mjGEOM_CAPSULE, [layout.radius, layout.half_length, 0]),
        "ellipsoid": (
            mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            [layout.radius, layout.radius, layout.half_length],
        ),
    }[contact.rollers]
    for blade, wheel in zip(layout.blade, layout.wheel, strict=True):
        body = _body(spec, f"wheel{unit + 1}_{blade}_{wheel}")
        _strip(spec, body)
        _roller(body.add_geom(name=f"{body.name}_contact", type=kind, size=size), contact)
        for joint in body.joints:
            joint.solimp_friction = _STICKS
    _drum(spec, _body(spec, f"screw{unit + 1}"), layout, contact)


def _drum(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, layout: WheelLayout, contact: ScrewContact
) -> None:
    """Adds the envelope of a drum, which meets other drums and nothing else."""
    half = float(np.abs(layout.position[:, 0]).max()) + layout.radius
    turn = [math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0]  # the cylinder's z along the drum's x
    _strip(spec, body)
    geom = body.add_geom(
        name=f"{body.name}_envelope",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[contact.radius, half, 0.0],
        quat=turn,
    )
    geom.contype = geom.conaffinity = DRUM_BIT
    geom.mass, geom.group = 0.0, 3
    geom.rgba = [0.5, 0.5, 0.5, 0.0]


def _ball(spec: mujoco.MjSpec, unit: int, contact: ScrewContact) -> None:
    """Turns a drum into one ball: its joint and wheels go, a ball joint and a sphere come."""
    drum = _body(spec, f"screw{unit + 1}")
    for child in list(drum.bodies):
        drum.mass += child.mass
        spec.delete(child)
    # A ball turns about every axis: one moment for all, or its spin would be lopsided.
    drum.inertia = [float(np.mean(drum.inertia))] * 3
    _strip(spec, drum)
    for joint in list(drum.joints):
        spec.delete(joint)
    joint = drum.add_joint(name=drum.name, type=mujoco.mjtJoint.mjJNT_BALL)
    joint.armature = contact.screw_armature
    joint.solimp_friction = _STICKS
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    _roller(
        drum.add_geom(name=f"{drum.name}_contact", type=sphere, size=[contact.radius, 0, 0]),
        contact,
    )


def _screw_servo(spec: mujoco.MjSpec, unit: int, contact: ScrewContact) -> None:
    """Sets the velocity servo of a screw; its command is θ̇ whatever the rollers are.

    A ball of radius r rolls along the axle of eq 3 at ``-r θ̇ sin α`` where its spin obeys
    ``ω · [-sin α, cos α, 0] = -θ̇ sin α``; so θ̇ is read off it with the gear [1, -cot α, 0].
    """
    name = f"screw{unit + 1}"
    servo = spec.actuator(name) or spec.add_actuator(name=name)
    servo.target, servo.trntype = name, mujoco.mjtTrn.mjTRN_JOINT
    if contact.rollers == "ball":
        servo.trntype = mujoco.mjtTrn.mjTRN_JOINTINPARENT
        servo.gear = [1.0, -1.0 / math.tan(contact.alpha[unit]), 0, 0, 0, 0]
    servo.set_to_velocity(kv=contact.screw_gain)
    servo.forcerange = [-contact.screw_torque, contact.screw_torque]
    servo.forcelimited = True


def decorate_screws(spec: mujoco.MjSpec, contact: ScrewContact) -> None:
    """Makes the drums of an imported MjSpec roll; units are numbered along the chain from 1.

    Every geom of the world gets GROUND_BIT. Raises DescriptionError on a missing body or joint.
    """
    for unit in range(len(contact.alpha)):
        if contact.rollers == "ball":
            _ball(spec, unit, contact)
        else:
            _wheels(spec, unit, contact)
            _hinge(spec, unit).armature = contact.screw_armature
        _screw_servo(spec, unit, contact)
    meet_rollers(spec)


def meet_rollers(spec: mujoco.MjSpec) -> None:
    """Lets rollers touch every geom of the world: floors, ceilings, steps."""
    for geom in spec.worldbody.geoms:
        geom.contype = geom.contype | GROUND_BIT


def decorate_caster(spec: mujoco.MjSpec, name: str, track: float, wheel_radius: float) -> None:
    """Gives caster `name` two frictionless balls at y = ±track/2 that touch z = 0 of its frame.

    Two, for a robot that is straight stands on a line: they carry the drums' reaction moment.
    """
    body = _body(spec, name)
    _strip(spec, body)
    for side in (1, -1):
        geom = body.add_geom(
            name=f"{name}_contact{1 if side > 0 else 2}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[wheel_radius, 0, 0],
            pos=[0, side * track / 2, wheel_radius],
        )
        geom.contype, geom.conaffinity = 0, GROUND_BIT
        geom.condim, geom.priority, geom.mass, geom.group = 1, 2, 0.0, 3
        geom.solref = [0.004, 1.0]


def decorate_drive(
    spec: mujoco.MjSpec, modules: Modules, rollers: str | None = None, timestep: float = 0.002
) -> None:
    """Makes an MjSpec imported from a URDF drive: drums, casters, solver, and the head's site.

    Args:
        spec: the model, its root link first under the world.
        modules: what its links carry; drums must be numbered screw1, screw2 … along the chain.
        rollers: contact representation, in place of the modules' own.
        timestep: [s].

    Raises:
        DescriptionError: no drum, drums of unlike build, or a body that is missing.
    """
    screws = modules.screws
    if not screws:
        raise DescriptionError("the robot has no screw unit; there is nothing to roll on.")
    alike = {replace(screw, joint="", link="", alpha=0.0) for screw in screws}
    if len(alike) > 1:
        raise DescriptionError("drums must be alike but for their helix angles to drive together.")
    one = screws[0]
    contact = ScrewContact(
        tuple(screw.alpha for screw in screws),
        one.radius,
        one.blades,
        one.wheels_per_blade,
        rollers or one.rollers,
        one.wheel_radius,
        one.friction,
        one.gain,
        one.torque,
        one.armature,
    )
    set_options(spec, timestep)
    decorate_screws(spec, contact)
    for caster in modules.casters:
        decorate_caster(spec, caster.link, caster.track, caster.radius)
    root = spec.worldbody.first_body()
    if modules.floating:
        root.pos = [0.0, 0.0, one.radius]
    root.add_site(name=HEAD)
