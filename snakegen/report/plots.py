"""The plots of a report, one function an analysis; an analysis without one has no picture."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.atomic_io import replace_whole, writing
from snakegen.report.collection import Page

_GRID = (25, 49)  # directions of a margin map: 7.5° apart


def plots(page: Page, folder: Path, stem: str) -> dict[str, list[Path]]:
    """Draws what the results of `page` allow into `folder`; returns the files by command.

    Raises:
        SnakegenError: the folder cannot be made or written.
    """
    drawn: dict[str, list[Path]] = {}
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for command, drawers in _DRAWERS.items():
            for name, draw in drawers.items():
                path = folder / f"{stem}_{name}.png"
                if command in page.results and draw(page.results[command], page, path):
                    shrink(path)
                    drawn.setdefault(command, []).append(path)
    return drawn


def shrink(path: Path) -> None:
    """Rewrites a PNG with a palette: a third of the bytes for charts and maps."""
    from PIL import Image

    with Image.open(path) as picture:
        # an octree keeps small marks of a colour of their own; a median cut drops them
        small = picture.convert("RGB").quantize(
            256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
        )
    replace_whole(path, lambda part: small.save(part, format="PNG", optimize=True))


def _posture(result: Any, page: Page, path: Path) -> bool:
    from snakegen.picture.robot_figure import draw_robot
    from snakegen.picture.robot_picture import figure

    hover = page.results.get("hover")
    thrusts = None if hover is None else np.asarray(hover.dual_thrust, float)
    draw_robot(path, figure(page.robot, page.q, thrusts))
    return True


def _singular_values(result: Any, page: Page, path: Path) -> bool:
    from snakegen.report.charts import singular_value_chart

    sigma = {f"Q {r.matrix}": r.singular_values for r in result.ranks}
    singular_value_chart(path, sigma, tolerance=result.tolerance)
    return True


def _thrusts(result: Any, page: Page, path: Path) -> bool:
    from snakegen.report.charts import hover_thrust_chart

    robot = page.robot
    names = [r.label for a in robot.modules.apparatuses for r in a.rotors]
    hover_thrust_chart(path, result.dual_thrust, robot.rotors.thrust_min, result.thrust_max, names)
    return True


def _joint_torques(result: Any, page: Page, path: Path) -> bool:
    from snakegen.report.charts import joint_torque_chart

    chain = set(page.robot.chain_joints)
    kept = [
        i
        for i, name in enumerate(result.joints)
        if name in chain and np.isfinite(result.limit[i]) and result.limit[i] > 0
    ]
    if not kept:
        return False
    names = [result.joints[i] for i in kept]
    torque = np.where(np.abs(result.torque[kept]) < 1e-9, 0.0, result.torque[kept])
    joint_torque_chart(path, torque, result.limit[kept], names)
    return True


def _margin_map(first: int, title: str, unit: str) -> Callable[[Any, Page, Path], bool]:
    """Returns a drawer of the reach in every direction of force (0) or torque (3), the rest held.

    Gimbals free where there are any, else with the rotors as they stand.
    """

    def draw(result: Any, page: Page, path: Path) -> bool:
        from snakegen.analysis.allocation import allocation
        from snakegen.report.charts import margin_map, sphere_grid
        from snakegen.wrench_margins.thrust import thrust_margins
        from snakegen.wrench_margins.vectored import set_margins

        robot = page.robot
        a = allocation(robot, page.q)
        scale: dict[str, Any] = {
            "force_scale": robot.force_scale,
            "torque_scale": robot.torque_scale,
        }
        margins: Any
        if robot.gimbal_names:
            margins = set_margins(robot.force_sets(page.q), a.hover_wrench, **scale)
        else:
            low, high = robot.rotors.thrust_min, robot.rotors.thrust_max
            margins = thrust_margins(a.dual, low, high, a.hover_wrench, **scale)
        if not margins.feasible:
            return False
        twists = np.zeros((*_GRID, 6))
        twists[..., first : first + 3] = sphere_grid(*_GRID)
        reach = np.array([margins.directional(u) for u in twists.reshape(-1, 6)]).reshape(_GRID)
        name = "torque" if first else "force"
        direction = margins.worst(name)[first : first + 3]
        known = (float(getattr(margins, name)), direction.tolist())
        margin_map(path, reach, title=title, unit=unit, weakest=known)
        return True

    return draw


def _motion(result: Any, page: Page, path: Path) -> bool:
    from snakegen.report.charts import time_series

    curves = dict(zip(page.robot.chain_joints, result.torque.T, strict=False))
    time_series(path, result.along.time, {"torque [N·m]": curves}, title=result.name)
    return True


def _tip_polytopes(result: Any, page: Page, path: Path) -> bool:
    from snakegen.report.tip_chart import Set, tip_polytope_chart

    load = result.tip_load
    if load is None or not (len(load.corners) or len(load.torque_corners)):
        return False
    force = Set("force at the tip", "N", load.corners, load.force_radius, load.free)
    torque = Set(
        "torque at the tip", "N·m", load.torque_corners, load.torque_radius, load.torque_free
    )
    tip_polytope_chart(path, [s for s in (force, torque) if len(s.corners)])
    return True


_Drawer = Callable[[Any, Page, Path], bool]
_DRAWERS: dict[str, dict[str, _Drawer]] = {
    "mass": {"posture": _posture},
    "actuation": {"singular_values": _singular_values},
    "hover": {"hover_thrusts": _thrusts},
    "margin": {
        "force_margin": _margin_map(0, "force margin by direction, torque held", "N"),
        "torque_margin": _margin_map(3, "torque margin by direction, force held", "N·m"),
    },
    "statics": {"joint_torques": _joint_torques, "tip_polytopes": _tip_polytopes},
    "motion": {"motion_torques": _motion},
}
