"""How far gimbals turn a thrust sideways: what of the vectoring gains of eqs 25-28 is flown."""

from typing import Any

import numpy as np

from snakegen.control.controller import Controller
from snakegen.control.frame import cog_frame
from snakegen.control.gains import Floats
from snakegen.control.underactuated import gimbals_for
from snakegen.robot.gimbal_geometry import joint_order, thrust_line

_STEP = 1e-4  # of the weight: a sideways force that gimbals are asked for


def vectoring_share(controller: Controller, angles: Any = None, rotation: Any = None) -> Floats:
    """Returns the sideways acceleration per g that gimbals make of a unit of f'_y and f'_x, (2,).

    The mean over the apparatuses, which share the thrust, of ``∂u_y/∂(f'_y / m g)`` and
    ``∂u_x/∂(f'_x / m g)`` at hover: k_φi and k_θi (eqs 25-28) of an apparatus with both gimbal
    axes, less with one axis, 0 without gimbals or at a limit.

    Args:
        controller: gains and limits.
        angles: (n-1,) rad, every joint; 0 if not given.
        rotation: (3, 3) attitude of body 0; level if not given.
    """
    joints = np.zeros(len(controller.tree.parent) - 1) if angles is None else np.array(angles)
    frame = cog_frame(controller, joints, rotation)
    count, law = controller.apparatuses, controller.law
    still = gimbals_for(controller, frame, np.zeros(3), frame.axes)
    step = _STEP * frame.mass * law.gravity
    heading = np.arctan2(frame.axes[1, 0], frame.axes[0, 0])
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    left = np.array([-np.sin(heading), np.cos(heading), 0.0])
    out = np.zeros(2)
    for k, direction in enumerate((left, ahead)):
        ends = []
        for sign in (1.0, -1.0):
            turned = gimbals_for(controller, frame, sign * step * direction, frame.axes, still)
            x = joint_order(frame.mounts, turned)
            u, p = np.empty(3), np.empty(3)
            moved = np.zeros(3)
            for j in range(count):
                thrust_line(frame.mounts, j, x[j], u, p)
                moved += frame.axes @ u / count
            ends.append(float(moved @ direction))
        out[k] = (ends[0] - ends[1]) / (2.0 * _STEP)
    return out
