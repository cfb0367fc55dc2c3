"""The page that gathers every analysis of a robot in a posture: text, JSON, Markdown with plots."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from snakegen import __version__
from snakegen.analysis import catalogue
from snakegen.errors import AnalysisError
from snakegen.files import write_atomically
from snakegen.geometry import Floats, rpy_from_rotation
from snakegen.posture import angles_by_name
from snakegen.robot import Robot


@dataclass(frozen=True)
class Page:
    """The results of all analyses that apply, by command, in report order."""

    robot: Robot
    q: Floats
    results: dict[str, Any]


def collect(robot: Robot, q: Floats) -> Page:
    """Runs every analysis that applies to `robot` at q."""
    results = {}
    for command, entry in catalogue().items():
        if not entry.report:
            continue
        module = entry.load()
        if module.applies(robot):
            results[command] = module.analyze(robot, q)
    return Page(robot, q, results)


def refuse(command: str, robot: Robot, analysis: Any) -> NoReturn:
    """Raises the error of an analysis that does not apply to `robot`."""
    reason = " ".join((analysis.applies.__doc__ or "").split()).rstrip(".")
    raise AnalysisError(f"'{command}' does not apply to {robot.name}; it needs: {reason.lower()}.")


def plain(value: Any) -> Any:
    """Returns `value` with arrays as lists and NaN or infinity as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def to_json(page: Page) -> dict[str, Any]:
    """Returns the page as plain data: robot, posture, and each analysis under its command."""
    robot = page.robot
    base, _ = robot.base_pose(page.q)
    posture: dict[str, Any] = angles_by_name(robot, page.q)
    if robot.floating:
        posture["base_rpy"] = rpy_from_rotation(base).tolist()
    out = {
        "robot": robot.name,
        "snakegen": __version__,
        "urdf_sha256": robot.urdf_hash,
        "posture_rad": posture,
    }
    return out | {name: result.to_json() for name, result in page.results.items()}


def text_table(title: str, rows: list[tuple[str, str]], width: int = 100) -> str:
    """Returns rows of (label, text) aligned under a title; long text wraps."""
    import textwrap

    labels = max((len(label) for label, _ in rows), default=0) + 2
    lines = [title]
    for label, text in rows:
        room = max(width - labels - 2, 40)
        wrapped = textwrap.wrap(text, room, subsequent_indent="  ") or [""]
        lines.append(f"  {label:<{labels}}{wrapped[0]}")
        lines += [" " * (labels + 2) + more for more in wrapped[1:]]
    return "\n".join(lines)


def text_page(page: Page) -> str:
    """Returns the page for a terminal."""
    robot = page.robot
    bent = {n: a for n, a in angles_by_name(robot, page.q).items() if abs(a) > 1e-9}
    shown = ", ".join(f"{n} {a:+.3f}" for n, a in bent.items()) or "all joints at 0"
    head = f"{robot.name}, {'floating' if robot.floating else 'fixed'} base; {shown}"
    parts = [text_table(name, result.rows()) for name, result in page.results.items()]
    return "\n".join([head, *parts])


def write_markdown(page: Page, path: Path) -> None:
    """Writes the page as Markdown, its plots as PNG files beside it."""
    from snakegen.report_plots import plots

    robot = page.robot
    lines = [f"# {robot.name}", ""]
    lines += [f"snakegen {__version__}; URDF {robot.urdf_hash[:12]}; angles in rad.", ""]
    lines += ["| joint | angle |", "|---|---|"]
    lines += [f"| {n} | {a:+.4f} |" for n, a in angles_by_name(robot, page.q).items()]
    pictures = plots(page, path.parent, path.stem)
    for name, result in page.results.items():
        lines += ["", f"## {name}", "", "| | |", "|---|---|"]
        lines += [f"| {label} | {_cell(text)} |" for label, text in result.rows()]
        lines += [f"\n![{p.stem}]({p.name})" for p in pictures.get(name, [])]
    write_atomically(path, "\n".join(lines) + "\n")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
