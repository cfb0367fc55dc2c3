"""The CoG frame at a posture, and the gimbals seen from it: what every allocation starts from."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.control.controller import Controller
from snakegen.control.gains import Floats
from snakegen.robot.gimbal_geometry import mounts
from snakegen.robot.kinematics import forward, mass_properties


@dataclass(frozen=True, eq=False)
class CogFrame:
    """A posture as the allocators see it; wrenches are in the frame's axes, about the CoG.

    Attributes:
        mass: kg.
        cog: (3,) m, world.
        axes: (3, 3) attitude of the frame in the world.
        inertia: (3, 3) kg·m², in the frame's axes.
        mounts: (Ñ, 10, 3) gimbal geometry, `kernels.vectoring.mounts`.
        rotors: (n_rotors, 3, 3) rotor rows, likewise.
        scale: (6,) S of THEORY A3.
        hover_wrench: (6,) that carries the weight.
    """

    mass: float
    cog: Floats
    axes: Floats
    inertia: Floats
    mounts: Floats
    rotors: Floats
    scale: Floats
    hover_wrench: Floats


def cog_frame(
    controller: Controller, angles: Any, rotation: Any = None, position: Any = None
) -> CogFrame:
    """Returns the CoG frame at joint `angles` (n-1,) and a base pose (level at 0 by default)."""
    c, law = controller, controller.law
    base = np.eye(3) if rotation is None else np.array(rotation, float)
    origin = np.zeros(3) if position is None else np.array(position, float)
    bodies, places = forward(c.tree, base, origin, np.array(angles, float))
    mass, cog, inertia = mass_properties(c.tree, bodies, places)
    axes = bodies[law.axes_body] @ law.axes_rotation
    geometry, rows = mounts(c.tree, c.rotors, c.gimbals, bodies, places, cog, axes)
    weight = np.concatenate([mass * law.gravity * axes[2], np.zeros(3)])
    scale = np.repeat([1.0, 1.0 / law.length], 3) / (mass * law.gravity)  # S: THEORY A3
    return CogFrame(mass, cog, axes, axes.T @ inertia @ axes, geometry, rows, scale, weight)
