"""A bare screw drive as MjSpec: just enough body, without a URDF, for contact to be tried alone."""

from dataclasses import dataclass

import mujoco
import numpy as np

from snakegen.description.mjcf.rolling_contact import (
    HEAD,
    ScrewContact,
    decorate_caster,
    decorate_screws,
    set_options,
)


@dataclass(frozen=True)
class BareChain:
    """A chain without a URDF: just enough body for the contact model to be tried alone."""

    contact: ScrewContact
    L0: float = 0.0
    L1: float = 0.103
    L2: float = 0.123
    mass: float = 8.0
    joint_stiffness: float = 300.0  # N·m/rad
    joint_damping: float = 6.0  # N·m·s/rad
    joint_torque: float = 30.0  # N·m
    track: float = 0.12  # m between the caster's balls


def _unit(chain: BareChain, parent: mujoco.MjsBody, unit: int) -> mujoco.MjsBody:
    """Adds link `unit` (from 0) with its joints, drum and wheels to `parent`; returns the link."""
    contact, n = chain.contact, len(chain.contact.alpha)
    share = chain.mass / n
    first = unit == 0
    position = [0, 0, contact.radius] if first else [chain.L1 + chain.L2, 0, 0]
    link = parent.add_body(name=f"link{unit + 1}", pos=position)
    if first:
        link.add_freejoint(name="root")
    else:
        link.add_joint(name=f"joint{unit}_pitch", axis=[0, 1, 0], armature=0.02)
        link.add_joint(name=f"joint{unit}_yaw", axis=[0, 0, 1], armature=0.02)
    _inertia(link, 0.55 * share, [chain.L1, 0, 0], [0.001, 0.005, 0.005])
    drum = link.add_body(name=f"screw{unit + 1}", pos=[chain.L1, 0, 0])
    drum.add_joint(name=drum.name, axis=[1, 0, 0])
    _inertia(drum, 0.35 * share, [0, 0, 0], [0.0015, 0.0015, 0.0015])
    layout = contact.layout(unit)
    for k in range(len(layout.blade)):
        wheel = drum.add_body(
            name=f"wheel{unit + 1}_{layout.blade[k]}_{layout.wheel[k]}",
            pos=layout.position[k],
            quat=_quaternion(layout.rotation[k]),
        )
        wheel.add_joint(name=wheel.name, axis=[0, 0, 1], armature=1e-6)
        mass = 0.1 * share / len(layout.blade)
        _inertia(wheel, mass, [0, 0, 0], [0.4 * mass * contact.wheel_radius**2] * 3)
    return link


def _inertia(body: mujoco.MjsBody, mass: float, com: list[float], moments: list[float]) -> None:
    """Writes an explicit inertia."""
    body.mass, body.ipos, body.inertia, body.explicitinertial = mass, com, moments, True


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """Returns MuJoCo's w, x, y, z of a rotation matrix."""
    out = np.empty(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(rotation).ravel())
    return out


def screw_mjcf(chain: BareChain, timestep: float = 0.002) -> mujoco.MjSpec:
    """Returns a complete drive on flat ground: bare chain, contact, servos, caster, floor."""
    spec = mujoco.MjSpec()
    set_options(spec, timestep)
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 0.1])
    parent = spec.worldbody
    for unit in range(len(chain.contact.alpha)):
        parent = _unit(chain, parent, unit)
        if unit == 0:
            caster = parent.add_body(name="caster1", pos=[-chain.L0, 0, -chain.contact.radius])
            _inertia(caster, 0.05, [0, 0, 0.01], [1e-5, 1e-5, 1e-5])
            parent.add_site(name=HEAD, pos=[-chain.L0, 0, 0])
    decorate_screws(spec, chain.contact)
    decorate_caster(spec, "caster1", chain.track, 0.012)
    for unit in range(1, len(chain.contact.alpha)):
        for axis in ("pitch", "yaw"):
            name = f"joint{unit}_{axis}"
            servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=chain.joint_stiffness, kv=chain.joint_damping)
            servo.forcerange = [-chain.joint_torque, chain.joint_torque]
            servo.forcelimited = True
    return spec
