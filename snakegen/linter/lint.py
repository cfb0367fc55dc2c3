"""Findings about a URDF or MJCF before any parser sees it, each with its line, tier and remedy.

Parsers accept loops, negative mass, NaN, zero axes, swapped limits and misspelt tags, each its own
subset. `lint` reads the text itself, so that every program behind it gets a sound tree. Errors are
what makes a model wrong or unloadable; everything else is a warning or a note (docs/lint.md).
"""

import re
from collections.abc import Iterable
from pathlib import Path

from snakegen.errors import DescriptionError
from snakegen.linter.body_rules import body_faults
from snakegen.linter.file_rules import mesh_faults
from snakegen.linter.finding import Finding, finding
from snakegen.linter.grammar import EXTENSIONS, grammar_faults
from snakegen.linter.joint_rules import joint_faults
from snakegen.linter.mesh_rules import mesh_inertia_faults
from snakegen.linter.mjcf_rules import mjcf_faults
from snakegen.linter.rotor_rules import rotor_faults
from snakegen.linter.text_rules import text_faults
from snakegen.linter.tree_rules import tree_faults
from snakegen.linter.xml_text import conforming, read_xml
from snakegen.linter.xml_tree import XmlFault, parse_xml

__all__ = ["Finding", "check", "lint", "refuse", "refuse_mjcf"]

_HEAD = 100_000  # characters in which the root element begins
LARGEST = 100_000_000  # bytes of text: some 15,000 links


def lint(
    source: str | Path,
    *,
    folder: str | Path | None = None,
    extensions: Iterable[str] = (),
    quick: bool = False,
) -> list[Finding]:
    """Reads a URDF or MJCF and lists what is to be said of it by line; an empty list is clean.

    Args:
        source: the text (anything that begins with ``<``) or a path.
        folder: where relative mesh paths start; a path's own folder by default. Without one
            (plain text), missing meshes are not looked for.
        extensions: further tags allowed under ``<robot>`` and not looked into.
        quick: leave out what reads whole meshes: whether they contradict declared inertias.

    Returns:
        Findings (errors, warnings, notes) in the order of their lines.
    """
    base = None if folder is None else Path(folder)
    try:
        encoding = ""
        if _is_text(source):
            text = str(source)
        else:
            path = Path(source)
            if path.is_file() and path.stat().st_size > LARGEST:
                message = f"the file has {path.stat().st_size / 1e6:.0f} MB, at most "
                return [finding("too_large", "", 1, f"{message}{LARGEST / 1e6:.0f} are read")]
            text, encoding = read_xml(path, LARGEST)
            base = base or path.parent
        found = _findings(text, base, frozenset(extensions), quick)
        if encoding:
            message = f"its text is {encoding}, not UTF-8"
            found.insert(0, finding("foreign_encoding", "", 1, message))
        return found
    except OSError as fault:
        return [finding("unreadable", "", 1, f"cannot be read: {fault.strerror or fault}")]
    except ValueError as fault:
        reason = getattr(fault, "reason", None) or str(fault)
        return [finding("unreadable", "", 1, f"cannot be read: {reason}")]


def _findings(
    text: str, folder: Path | None, extensions: frozenset[str], quick: bool
) -> list[Finding]:
    text = text.removeprefix("\ufeff")
    body = text.lstrip(" \t\r\n")
    late = body.startswith("<?xml") and body != text
    found = []
    if late:
        lines = text[: len(text) - len(body)].count("\n")
        message = "blank text precedes the XML declaration"
        found.append(finding("late_declaration", "", lines + 1, message))
        text = "\n" * lines + body.partition("?>")[2]  # lines keep their numbers
    try:
        root = parse_xml(text)
    except XmlFault as fault:
        return [finding(fault.code, "", fault.line, fault.message)]
    if root.tag == "mujoco":
        found += mjcf_faults(root)
    elif root.tag != "robot":
        message = f"the root element is <{root.tag}>; a URDF begins with <robot name=…>"
        found.append(finding("not_a_robot", f"<{root.tag}>", root.line, message))
    else:
        found += [
            *text_faults(root, text),
            *grammar_faults(root, EXTENSIONS | extensions),
            *tree_faults(root),
            *body_faults(root),
            *joint_faults(root),
            *mesh_faults(root, folder),
            *rotor_faults(root),
        ]
        if folder is not None and not quick and all(f.severity != "error" for f in found):
            found += mesh_inertia_faults(root, conforming(text), folder)
    return sorted(found, key=lambda item: item.line)


def check(
    source: str | Path, *, folder: str | Path | None = None, extensions: Iterable[str] = ()
) -> None:
    """Raises on the first error of `lint`; warnings and notes pass.

    Args:
        source: the text or a path, as in `lint`.
        folder: where relative mesh paths start, as in `lint`.
        extensions: further tags allowed under ``<robot>``.

    Raises:
        DescriptionError: names the file, line, element and remedy, and counts the other errors.
    """
    refuse(
        lint(source, folder=folder, extensions=extensions, quick=True),
        "URDF" if _is_text(source) else str(source),
    )


def refuse(found: Iterable[Finding], name: str) -> None:
    """Raises on the first error among findings of the file `name`, as `check` does."""
    errors = [finding for finding in found if finding.severity == "error"]
    if not errors:
        return
    more = len(errors) - 1
    others = f" (and {more} more error{'s' if more > 1 else ''})" if more else ""
    raise DescriptionError(f"{name}: {errors[0]}{others}. {errors[0].remedy}")


def refuse_mjcf(text: str, name: str) -> None:
    """Raises where a text is an MJCF and a URDF is needed; its root element tells.

    Raises:
        DescriptionError: names the file.
    """
    head = re.sub(r"<!--.*?-->|<\?.*?\?>", "", text[:_HEAD], flags=re.S)
    first = re.search(r"<([A-Za-z_][\w:.-]*)", head)
    if first is not None and first[1] == "mujoco":
        raise DescriptionError(
            f"{name}: is an MJCF, its root element is <mujoco>; a URDF with <robot> is needed."
        )


def _is_text(source: str | Path) -> bool:
    return isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<")
