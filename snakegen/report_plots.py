"""The plots of a report, one function an analysis; an analysis without one has no picture."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from snakegen.report import Page


def plots(page: "Page", folder: Path, stem: str) -> dict[str, list[Path]]:
    """Draws what the results of `page` allow into `folder`; returns the files by command."""
    from snakegen.picture import figure
    from snakegen.plot_robot import draw_robot

    folder.mkdir(parents=True, exist_ok=True)
    drawn: dict[str, list[Path]] = {}
    if "mass" in page.results:
        path = folder / f"{stem}_posture.png"
        draw_robot(path, **figure(page.robot, page.q))
        drawn["mass"] = [path]
    for command, draw in _DRAWERS.items():
        if command in page.results:
            path = folder / f"{stem}_{command}.png"
            if draw(page.results[command], page, path):
                drawn.setdefault(command, []).append(path)
    return drawn


def _actuation(result: Any, page: "Page", path: Path) -> bool:
    from snakegen.plot import singular_value_chart

    singular_value_chart(
        path,
        {f"Q {r.matrix}": r.singular_values for r in result.ranks},
        tolerance=result.tolerance,
    )
    return True


def _hover(result: Any, page: "Page", path: Path) -> bool:
    from snakegen.plot import hover_thrust_chart

    robot = page.robot
    names = [r.link for a in robot.modules.apparatuses for r in a.rotors]
    hover_thrust_chart(path, result.dual_thrust, robot.rotors.thrust_min, result.thrust_max, names)
    return True


_DRAWERS = {"actuation": _actuation, "hover": _hover}
