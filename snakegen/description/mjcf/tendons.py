"""Cables as MuJoCo spatial tendons: a winch each, in place of the joints' servos, and the proof.

The winch of a cable holds its length: its pull is ``k (l - u)``, never a push, with u the length to
which it is wound in. Wound to ``u = l - t/k`` the cable has the tension t in the posture.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.description.mjcf.decorate import decorate
from snakegen.description.mjcf.files import load_model, write
from snakegen.errors import DescriptionError
from snakegen.robot.modules import Modules

KEY = "held"
DAMPING = 0.02  # s: a winch's damping over its stiffness
_COLOURS = ((0.85, 0.35, 0.15, 1.0), (0.2, 0.45, 0.8, 1.0), (0.2, 0.6, 0.35, 1.0))
_ROD = (0.55, 0.57, 0.6, 0.35)
_WIDTH = 0.0015  # m, as drawn


@dataclass(frozen=True)
class Cable:
    """A cable: holes in links from base to tip, its tension and length in the posture.

    Attributes:
        name: ``cable2_3``.
        group: which segment it bends, for its colour.
        links: (h,) names of the links that hold its holes.
        points: (h, 3) m, in those links' frames.
        tension: N.
        length: m.
        maximum: N, inf where there is no limit.
        stiffness: N/m, with its winch.
    """

    name: str
    group: int
    links: tuple[str, ...]
    points: Floats
    tension: float
    length: float
    maximum: float
    stiffness: float


@dataclass(frozen=True)
class Held:
    """What MuJoCo says of a cabled robot in its posture.

    Attributes:
        acceleration: rad/s², the largest at the start; zero where the tensions balance.
        torque: N·m by joint, of the cables alone.
        drift: rad, the farthest any joint goes in `seconds`.
        tension: N, of each cable at the end.
        seconds: of simulation.
        pushed: rad, how far the softest direction was bent before it was let go.
        farthest, end: rad, how far from the posture that got, and where it was at the end.
        left: whether it went away for good (ten times as far as it was bent), True, or came back
            to a third of it, False; None where neither happened in `waited`.
        waited: s.
    """

    acceleration: float
    torque: dict[str, float]
    drift: float
    tension: Floats
    seconds: float
    pushed: float = 0.0
    farthest: float = 0.0
    end: float = 0.0
    left: bool | None = None
    waited: float = 0.0


def write_cabled(
    path: Path,
    urdf: str,
    modules: Modules,
    cables: Sequence[Cable],
    posture: Mapping[str, float],
    gravity: Floats,
) -> None:
    """Writes the MJCF of a robot whose joints have cables for servos, in one file.

    Links are drawn by their collision bodies, so that no mesh is needed beside it. The keyframe
    ``held`` is the posture with every cable wound in to its tension.

    Args:
        path: of the MJCF.
        urdf: URDF text.
        modules: what its links carry; the servos are left out.
        cables: from base to tip.
        posture: rad by joint; others at 0.
        gravity: (3,) m/s².

    Raises:
        DescriptionError: MuJoCo cannot take the model, or the file cannot be written.
    """
    spec = decorate(urdf, replace(modules, servos=()), {}, visuals=False)
    try:
        spec.option.gravity = gravity
        for geom in spec.geoms:
            geom.group, geom.rgba = 1, _ROD  # seen: these are not hidden behind visuals
        for joint in spec.joints:
            # A servo's limit would clip what the cables make of the joint.
            joint.actfrclimited, joint.actfrcrange = mujoco.mjtLimited.mjLIMITED_FALSE, [0.0, 0.0]
        for key in list(spec.keys):
            spec.delete(key)
        for cable in cables:
            _add(spec, cable)
        model = spec.compile()
        qpos = np.array(model.qpos0)
        for joint, angle in posture.items():
            qpos[model.joint(joint).qposadr[0]] = angle
        wound = [c.length - c.tension / c.stiffness for c in cables]
        spec.add_key(name=KEY, qpos=qpos, ctrl=wound)
    except ValueError as error:
        raise DescriptionError(f"MuJoCo cannot take the cables: {error}") from None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(spec, path)
    except OSError as error:
        raise DescriptionError(f"{path}: cannot be written ({error.strerror}).") from None


def _add(spec: mujoco.MjSpec, cable: Cable) -> None:
    """Adds a cable's holes as sites, its tendon and its winch."""
    tendon: Any = spec.add_tendon(name=cable.name, width=_WIDTH)
    tendon.rgba = _COLOURS[cable.group % len(_COLOURS)]
    for k, (link, point) in enumerate(zip(cable.links, cable.points, strict=True)):
        name = f"{cable.name}_hole{k + 1}"
        spec.body(link).add_site(name=name, pos=point, size=[0.002] * 3, group=4)
        tendon.wrap_site(name)
    winch = spec.add_actuator(
        name=cable.name, trntype=mujoco.mjtTrn.mjTRN_TENDON, target=cable.name
    )
    winch.set_to_position(kp=cable.stiffness, kv=DAMPING * cable.stiffness)
    winch.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
    winch.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    winch.forcerange = [-min(cable.maximum, 1e6), 0.0]  # a cable cannot push
    spec.add_sensor(
        name=f"{cable.name}_force",
        type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
        objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
        objname=cable.name,
    )


def holding(path: Path, seconds: float = 1.0) -> Held:
    """Returns what becomes of a cabled robot that is let go in its posture.

    Args:
        path: the MJCF that `write_cabled` wrote.
        seconds: of simulation, winches at rest.
    """
    model = load_model(path)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(KEY).id)
    start = np.array(data.qpos)
    mujoco.mj_forward(model, data)
    dofs = {model.joint(j).name: int(model.joint(j).dofadr[0]) for j in range(model.njnt)}
    torque = {name: float(data.qfrc_actuator[dof]) for name, dof in dofs.items()}
    acceleration = float(np.abs(data.qacc).max(initial=0.0))
    drift = 0.0
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        drift = max(drift, float(np.abs(data.qpos - start).max(initial=0.0)))
        if not np.isfinite(drift):
            break
    return Held(acceleration, torque, drift, -np.array(data.actuator_force), seconds)


def let_go(
    path: Path, direction: Mapping[str, float], size: float = 1e-3, seconds: float = 30.0
) -> tuple[float, float, bool | None, float]:
    """Bends a cabled robot out of its posture and lets go.

    Args:
        path: the MJCF that `write_cabled` wrote.
        direction: by joint, rad; its largest entry is scaled to `size`.
        size: rad.
        seconds: of simulation at most, winches at rest.

    Returns:
        farthest and last distance from the posture [rad], the largest over joints; whether it left
        for good (True), came back (False) or neither (None); the time that took [s].
    """
    model = load_model(path)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(KEY).id)
    start = np.array(data.qpos)
    scale = size / max(abs(x) for x in direction.values())
    for joint, x in direction.items():
        data.qpos[model.joint(joint).qposadr[0]] += scale * x
    farthest = away = size
    window = 0.0
    for k in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        away = float(np.abs(data.qpos - start).max())
        farthest, window = max(farthest, away), max(window, away)
        if not away < 10.0 * size:
            return farthest, away, True, float(data.time)
        if (k + 1) % 1000 == 0:  # one second of swinging within a third of it: it is back
            if window < size / 3.0:
                return farthest, away, False, float(data.time)
            window = 0.0
    return farthest, away, None, float(data.time)
