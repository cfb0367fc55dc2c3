"""What holds a fixed base in its scene: a column, wall, ceiling or foot, and the floor's height.

The world's origin is the base; so the floor lies below it. Supports begin behind link 1's root end,
where no part of the robot is at rest.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.description.mjcf.scene_elements import lowest_point
from snakegen.robot.modules import Modules

_CLEAR = 0.01  # m, between a support and the parts of the robot beside it
_THICK = 0.06  # m, half, of walls, ceilings and columns
_PLATE = 0.3  # m, half, of the part of a wall or ceiling that is there


@dataclass(frozen=True)
class Support:
    """A solid part of the scene that does not move.

    Attributes:
        name: of its geom.
        kind: ``box`` or ``cylinder``.
        size: m, half lengths of a box; radius and half length of a cylinder.
        position: (3,) m, of its centre, world.
        rotation: (3, 3) attitude.
    """

    name: str
    kind: str
    size: tuple[float, ...]
    position: Floats
    rotation: Floats


def floor_height(model: mujoco.MjModel, modules: Modules) -> float:
    """Returns z [m] of the floor: 0 under a free base, below the base where that is fixed.

    A description that does not give the height of its base stands on z = 0 if it is clear of it,
    else above a floor that it does not reach at rest.
    """
    if modules.floating:
        return 0.0
    if modules.mount is not None:
        return -modules.mount.height
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    low = lowest_point(model, data)
    return 0.0 if low > 0.0 else float(np.floor(20.0 * low - 1.0) / 20.0)


def supports(model: mujoco.MjModel, modules: Modules, link: str) -> tuple[Support, ...]:
    """Returns what holds the base in the scene.

    Args:
        model: the robot's, at rest in its reference posture.
        modules: with its mount; none, and no support is known.
        link: the link that is fixed.
    """
    if modules.floating or modules.mount is None:
        return ()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.body(link).id
    x = data.xmat[body].reshape(3, 3)[:, 0]
    radius, back = _extent(model, data, body, x)
    half = 0.5 * (back + _CLEAR)
    stub = Support("mount", "cylinder", (radius, half), -half * x, _along(x))
    height, face = modules.mount.height, -(back + _CLEAR) * x
    wide = max(2.0 * radius, _THICK)
    flat = np.eye(3)
    if modules.mount.pose in ("stand", "wall"):
        top = 2.0 * radius
        if modules.mount.pose == "wall":
            top, wide = _PLATE, _PLATE
        depth = _THICK
        size = (depth, wide, 0.5 * (height + top))
        centre = face + np.array([-depth, 0.0, 0.5 * (top - height)])
        return stub, Support(modules.mount.pose, "box", size, centre, flat)
    if modules.mount.pose == "ceiling":
        centre = face + np.array([0.0, 0.0, _THICK])
        return stub, Support("ceiling", "box", (_PLATE, _PLATE, _THICK), centre, flat)
    if modules.mount.pose == "vertical" and height < 2.0 * half:
        return ()  # link 1 itself is on the floor
    return (stub,)


def _extent(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, x: Floats
) -> tuple[float, float]:
    """Returns the rod's radius and how far other parts reach behind the base along -x [m]."""
    rod = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body]
    radius = min((float(model.geom_size[g][0]) for g in rod), default=0.02)
    behind = [
        float(model.geom_rbound[g] - data.geom_xpos[g] @ x)
        for g in range(model.ngeom)
        if model.geom_bodyid[g] != body
    ]
    return radius, max(0.0, *behind) if behind else 0.0


def _along(x: Floats) -> Floats:
    """Returns an attitude whose z lies along x (3,)."""
    aside = np.eye(3)[int(np.argmin(np.abs(x)))]
    y = np.cross(x, aside) / np.linalg.norm(np.cross(x, aside))
    return np.column_stack([np.cross(y, x), y, x])
