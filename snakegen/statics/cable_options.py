"""Loads and sizes of cables, as options give them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.errors import AnalysisError
from snakegen.robot.modules import Cables
from snakegen.robot.robot import Robot
from snakegen.statics.cable_stiffness import PointLoad
from snakegen.statics.joint_torques import Wrenches, finite, link_loads
from snakegen.statics.tip import find_tip


def load_at(robot: Robot, load: PointLoad) -> Any:
    from snakegen.statics.tip import Tip

    return Tip("", load.body, load.point)


def loads_of(
    robot: Robot, wrenches: Wrenches, tip_force: ArrayLike | None
) -> tuple[PointLoad, ...]:
    """Returns the loads of links and of the tip."""
    found = link_loads(robot, wrenches)
    out = [
        PointLoad(int(b), np.asarray(p), np.asarray(w[:3]), np.asarray(w[3:]))
        for b, p, w in zip(found.body, found.point, found.wrench, strict=True)
    ]
    if tip_force is not None:
        tip = find_tip(robot)
        out.append(
            PointLoad(tip.body, tip.point, finite(tip_force, (3,), "tip force"), np.zeros(3))
        )
    return tuple(out)


def cables_from_options(robot: Robot, sizes: dict[str, Any]) -> tuple[Cables, bool]:
    """Returns the cables of a robot with `sizes` in place of its own; whether any were given."""
    known = robot.modules.cables or Cables()
    places = ("count", "radius", "phase", "standoff", "sheathed")
    given: dict[str, Any] = {}
    for name, value in sizes.items():
        if not isinstance(value, int | float) or value != value:
            raise AnalysisError(f"{name}: {value!r} is not a number.")
        given[name] = value
    cables = replace(known, **given)
    if not 0 <= cables.minimum <= cables.maximum or not np.isfinite(cables.minimum):
        raise AnalysisError(
            f"tensions {cables.minimum:g} … {cables.maximum:g} N are no range above 0."
        )
    for name in ("stiffness", "elasticity"):
        if not getattr(cables, name) > 0:
            raise AnalysisError(f"{name} = {getattr(cables, name):g}: more than 0 is needed.")
    if not 0 <= cables.friction < np.inf:
        raise AnalysisError(f"friction = {cables.friction:g}: 0 or more is needed.")
    return cables, any(n in given and given[n] != getattr(Cables(), n) for n in places)
