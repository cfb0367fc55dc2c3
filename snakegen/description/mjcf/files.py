"""MJCF on disk: bit-exact text, and deep chains split over files that MuJoCo can read back."""

import re
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import mujoco

from snakegen.errors import DescriptionError

DEEPEST = 400  # bodies nested in one file before the chain goes on in the next
_ROOM = 0.2  # share of that by which a short branch may go deeper; MuJoCo's reader stops at 490
_OPEN = re.compile(r'^( *)<body name="([^"]+)"[^>]*(?<!/)>$')
_ATTACH = re.compile(r'^ *<attach model="([^"]+)"')
_MODEL = re.compile(r'^<mujoco model="([^"]+)">$')


@dataclass
class _Body:
    """A body in the text: its lines [start, stop), and the bodies nested right under it."""

    name: str
    start: int
    stop: int = 0
    children: list["_Body"] = field(default_factory=list)
    height: int = 1  # levels of bodies, its own included


def write(spec: mujoco.MjSpec, path: Path) -> None:
    """Writes `spec` to `path`, deep chains split into ``<name>_part2.xml`` … beside it."""
    try:
        text = str(spec.to_xml())
    except ValueError as error:
        raise DescriptionError(f"MuJoCo cannot write the model: {error}") from None
    for file, content in split(text, path.name).items():
        path.with_name(file).write_text(content, encoding="utf-8")


def load_model(path: Path) -> mujoco.MjModel:
    """Returns the compiled model of an MJCF file.

    MuJoCo warns of every empty prefix, on stderr and in a log file in the current folder; here
    the prefix is meant, and other warnings become Python's.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_on_warning)
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    finally:
        mujoco.set_mju_user_warning(before)


def _on_warning(message: str) -> None:
    if "empty prefix" not in message:
        warnings.warn(f"MuJoCo: {message}", RuntimeWarning, stacklevel=2)


def split(text: str, name: str, deepest: int = DEEPEST) -> dict[str, str]:
    """Returns MJCF text by file name; a chain nested deeper than `deepest` goes on in parts.

    A part is a model of the sub-tree under its cut, with the compiler settings and defaults
    without which that would read differently. The file before it attaches the sub-tree where it
    stood; the prefix is empty, so names, order and all that refers to them stay as they are.

    Args:
        text: as MjSpec writes it: two spaces a level, a tag's opening on one line.
        name: of the first file, as in ``dragon4.xml``.
        deepest: bodies nested in one file.
    """
    lines = text.splitlines()
    cuts = [cut for root in _bodies(lines) for cut in _cuts(root, 1, deepest)]
    if not cuts:
        return {name: text}
    stem = name.removesuffix(".xml")
    parts = {cut.start: f"{stem}_part{k + 2}" for k, cut in enumerate(cuts)}
    by_start = {cut.start: cut for cut in cuts}
    found = (_MODEL.match(line) for line in lines)
    model = next((m[1] for m in found if m), stem)
    out = {name: _text(_with_models(_kept(lines, 0, len(lines), by_start, parts)))}
    shared = [*_section(lines, "compiler"), *_section(lines, "default")]
    for cut in cuts:
        indent = lines[cut.start].index("<") - 4
        inside = _kept(lines, cut.start + 1, cut.stop, by_start, parts)
        body = [line[indent:] for line in (lines[cut.start], *inside)]
        head = f'<mujoco model="{model}_{parts[cut.start].removeprefix(stem + "_")}">'
        whole = [head, *shared, "  <worldbody>", *body, "  </worldbody>", "</mujoco>"]
        out[f"{parts[cut.start]}.xml"] = _text(_with_models(whole))
    return out


def _text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def _bodies(lines: list[str]) -> list[_Body]:
    """Returns the outermost bodies, each with the tree under it; no recursion, however deep."""
    roots: list[_Body] = []
    open_: list[_Body] = []
    for number, line in enumerate(lines):
        if match := _OPEN.match(line):
            body = _Body(match[2], number)
            (open_[-1].children if open_ else roots).append(body)
            open_.append(body)
        elif line.endswith("</body>") and open_:
            done = open_.pop()
            done.stop = number + 1
            if open_:
                open_[-1].height = max(open_[-1].height, done.height + 1)
    return roots


def _cuts(root: _Body, depth: int, deepest: int) -> Iterator[_Body]:
    """Yields the bodies that begin a new file, from the root on."""
    waiting = [(root, depth)]
    while waiting:
        body, level = waiting.pop()
        if level > deepest and body.height > _ROOM * deepest:
            yield body
            level = 1
        waiting += [(child, level + 1) for child in reversed(body.children)]


def _kept(
    lines: list[str], start: int, stop: int, cuts: Mapping[int, _Body], parts: Mapping[int, str]
) -> list[str]:
    """Returns lines [start, stop) with an ``<attach>`` in the place of each cut sub-tree."""
    out = []
    number = start
    while number < stop:
        cut = cuts.get(number)
        if cut is None:
            out.append(lines[number])
            number += 1
            continue
        indent = " " * lines[number].index("<")
        out.append(f'{indent}<attach model="{parts[number]}" body="{cut.name}" prefix=""/>')
        number = cut.stop
    return out


def _section(lines: list[str], tag: str) -> list[str]:
    """Returns the lines of a section right under ``<mujoco>``, and the blank line after it."""
    for start, line in enumerate(lines):
        if line.startswith(f"  <{tag}") and line.endswith("/>"):
            return [line, ""]
        if line == f"  <{tag}>":
            stop = lines.index(f"  </{tag}>", start)
            return [*lines[start : stop + 1], ""]
    return []


def _with_models(lines: list[str]) -> list[str]:
    """Adds the models that a file attaches to its ``<asset>``, to be read before its bodies."""
    found = (_ATTACH.match(line) for line in lines)
    models = [f'    <model name="{m[1]}" file="{m[1]}.xml"/>' for m in found if m]
    if not models:
        return lines
    if "  <asset>" in lines:
        at = lines.index("  <asset>") + 1
        return [*lines[:at], *models, *lines[at:]]
    at = lines.index("  <worldbody>")
    return [*lines[:at], "  <asset>", *models, "  </asset>", "", *lines[at:]]
