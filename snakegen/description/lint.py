"""Finds what is wrong with a URDF before any parser sees it, each fault with its line.

Parsers accept loops, negative mass, NaN, zero axes, swapped limits and mistyped tags, each its own
subset. `lint` reads the text itself, so that every program behind it gets a sound tree.
"""

from collections.abc import Iterable
from pathlib import Path

from snakegen.description.finding import Finding, error
from snakegen.description.lint_files import mesh_faults
from snakegen.description.lint_rules import body_faults, joint_faults, tree_faults
from snakegen.description.urdf_grammar import EXTENSIONS, grammar_faults
from snakegen.description.xmltree import XmlFault, parse_xml
from snakegen.errors import DescriptionError

__all__ = ["Finding", "check", "lint", "refuse"]


def lint(
    urdf: str | Path, *, folder: str | Path | None = None, extensions: Iterable[str] = ()
) -> list[Finding]:
    """Reads a URDF and lists its faults by line; an empty list is a clean file.

    Args:
        urdf: the text (anything that begins with ``<``) or a path.
        folder: where relative mesh paths start; a path's own folder by default. Without one
            (plain text), missing meshes are not looked for.
        extensions: further tags allowed under ``<robot>`` and not looked into.

    Returns:
        Findings, errors and warnings, in the order of their lines.
    """
    base = None if folder is None else Path(folder)
    try:
        if _is_text(urdf):
            text = str(urdf)
        else:
            text = Path(urdf).read_text(encoding="utf-8")
            base = base or Path(urdf).parent
        robot = parse_xml(text)
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or getattr(fault, "reason", None) or str(fault)
        return [error("unreadable", "", 1, f"cannot be read as UTF-8 text: {reason}")]
    except XmlFault as fault:
        return [error(fault.code, "", fault.line, fault.message)]
    if robot.tag != "robot":
        message = f"the root element is <{robot.tag}>; a URDF begins with <robot name=…>"
        return [error("not_a_robot", f"<{robot.tag}>", robot.line, message)]
    found = [
        *grammar_faults(robot, EXTENSIONS | set(extensions)),
        *tree_faults(robot),
        *body_faults(robot),
        *joint_faults(robot),
        *mesh_faults(robot, base),
    ]
    return sorted(found, key=lambda finding: finding.line)


def check(
    urdf: str | Path, *, folder: str | Path | None = None, extensions: Iterable[str] = ()
) -> None:
    """Raises on the first error of `lint`; warnings pass.

    Args:
        urdf: the text or a path, as in `lint`.
        folder: where relative mesh paths start, as in `lint`.
        extensions: further tags allowed under ``<robot>``.

    Raises:
        DescriptionError: names the file, line, element and remedy, and counts the other errors.
    """
    refuse(
        lint(urdf, folder=folder, extensions=extensions), "URDF" if _is_text(urdf) else str(urdf)
    )


def refuse(found: Iterable[Finding], name: str) -> None:
    """Raises on the first error among findings of the file `name`, as `check` does."""
    errors = [finding for finding in found if finding.severity == "error"]
    if not errors:
        return
    more = len(errors) - 1
    others = f" (and {more} more error{'s' if more > 1 else ''})" if more else ""
    raise DescriptionError(f"{name}: {errors[0]}{others}")


def _is_text(urdf: str | Path) -> bool:
    return isinstance(urdf, str) and urdf.lstrip("\ufeff \t\r\n").startswith("<")
