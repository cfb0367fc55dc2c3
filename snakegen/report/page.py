"""The page that gathers every analysis of a robot in a posture: text, JSON, Markdown with plots."""

import math
import re
import textwrap
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from snakegen import __version__
from snakegen.analysis import catalogue
from snakegen.base.atomic_io import check_writable, require_suffix, work_folder
from snakegen.base.file_lock import exclusive
from snakegen.base.file_name import file_stem
from snakegen.base.folder_swap import move_files
from snakegen.base.geometry import rpy_from_rotation
from snakegen.base.rounding import rounded
from snakegen.errors import AnalysisError, SnakegenError
from snakegen.report.answers import answers
from snakegen.report.collection import Page
from snakegen.report.explanations import explained
from snakegen.robot.posture import angles_by_name, posture_line
from snakegen.robot.robot import Robot

MARKDOWN = (".md", ".markdown")
HTML = (".html", ".htm")
_SHOWN = 8  # rows of an analysis on the one-screen page


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
    """Returns the page as plain data: robot, posture, and each analysis under its command.

    Numbers have ten digits of the largest of their list: those that no processor changes.
    """
    robot = page.robot
    out = {
        "robot": robot.name,
        "snakegen": __version__,
        "urdf_sha256": robot.urdf_hash,
        "posture_rad": posture_json(robot, page.q),
    }
    found = {name: plain(result.to_json()) for name, result in page.results.items()}
    return dict(rounded(plain(out) | found))


def posture_json(robot: Robot, q: ArrayLike) -> dict[str, Any]:
    """Returns every joint angle of q [rad] by name, and the attitude of a floating base."""
    at = robot.validate_configuration(q)
    out: dict[str, Any] = angles_by_name(robot, at)
    if robot.floating:
        out["base_rpy"] = rpy_from_rotation(at.base_rotation).tolist()
    return out


def text_table(title: str, rows: list[tuple[str, str]], width: int = 100) -> str:
    """Returns rows of (label, text) aligned under a title; long text wraps."""
    labels = max((len(label) for label, _ in rows), default=0) + 2
    lines = [title]
    for label, text in rows:
        room = max(width - labels - 2, 40)
        wrapped = textwrap.wrap(tidy(text), room, subsequent_indent="  ") or [""]
        lines.append(f"  {label:<{labels}}{wrapped[0]}")
        lines += [" " * (labels + 2) + more for more in wrapped[1:]]
    return "\n".join(lines)


def tidy(text: str) -> str:
    """Returns `text` with what rounding leaves of zero written as zero: 4e-17, -0, -0.00."""
    text = re.sub(r"(?<![\w.])-?\d(?:\.\d+)?e-(?:1[3-9]|[2-9]\d|\d{3})\b", "0", text)
    sign = "+" if re.search(r"(?<![\w.])\+\d", text) else ""
    return re.sub(r"(?<![\w.])-(0(?:\.0+)?)(?![\d.e])", rf"{sign}\1", text)


def text_page(page: Page, width: int = 100, *, explain: bool = False) -> str:
    """Returns the page for a terminal: an analysis with many rows shows the first ones.

    Args:
        page: the results.
        width: characters a line.
        explain: add a sentence to each kind of row, and where to read more.
    """
    parts = [text_table(heading(page), answers(page), width)]
    for name, result in page.results.items():
        rows = result.rows()
        hidden = len(rows) - _SHOWN
        if hidden > 1:
            rows = [*rows[:_SHOWN], ("…", f"{hidden} more: snakegen analyze {name}")]
        rows = explained(name, rows) if explain else rows
        parts.append(text_table(name, rows, width))
    return "\n".join(parts)


def heading(page: Page) -> str:
    """Returns the robot, its base and the joints that are not at 0, in one line."""
    robot = page.robot
    base = "floating" if robot.floating else "fixed"
    return f"{robot.name}, {base} base; {posture_line(robot, page.q)}"


def write_markdown(page: Page, path: Path) -> None:
    """Writes the page as Markdown, its plots as PNG files next to it; all of them or none.

    Raises:
        SnakegenError: no Markdown suffix, or the folder cannot be made or written.
    """
    from snakegen.report.plots import plots

    require_suffix(path, *MARKDOWN)
    check_writable(path)
    made = not path.parent.exists()
    folder = path.resolve().parent
    try:
        shown = path.parent
        with exclusive(path), work_folder(folder, path, shown=shown) as beside:
            pictures = plots(page, beside, path.stem)
            text = "\n".join(_markdown(page, path, pictures)) + "\n"
            (beside / path.name).write_text(text, encoding="utf-8")
            move_files(beside, folder)
    except SnakegenError:
        if made:
            with suppress(OSError):
                path.parent.rmdir()
        raise


def _markdown(page: Page, path: Path, pictures: dict[str, list[Path]]) -> list[str]:
    """Returns the lines of the page that will stand at `path`."""
    robot, about = page.robot, catalogue()
    lines = [f"# {robot.name}", "", f"{heading(page)} (rad).", ""]
    lines += [f"snakegen {__version__}, URDF {robot.urdf_hash[:12]}."]
    file = f"{file_stem(robot.name)}.png"
    if (path.parent / file).is_file():
        lines += ["", f"![{robot.name}]({file})"]
    answered = answers(page)
    if answered:
        lines += ["", "| | |", "|---|---|"]
        lines += [f"| {_cell(question)} | {_cell(tidy(text))} |" for question, text in answered]
    for name, result in page.results.items():
        lines += ["", f"## {name}", "", about[name].help, "", "| | |", "|---|---|"]
        lines += [f"| {_cell(label)} | {_cell(tidy(text))} |" for label, text in result.rows()]
        for picture in pictures.get(name, []):
            lines += ["", f"![{picture.stem.replace('_', ' ')}]({picture.name})"]
    return lines


def _cell(text: str) -> str:
    return text.strip().replace("|", "\\|")
