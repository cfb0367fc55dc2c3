"""Safe mends of a URDF: edits that change no number that a parser reads today.

Mended are axes that are not of length 1, inertials of massless frames, attributes and tags that
are misspelt, vectors over several lines, backslashes in paths, absolute paths to files below the
file's own folder, and blank text before the XML declaration. Everything else needs a person.
"""

import math
import re
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from snakegen.linter.finding import label, number, numbers
from snakegen.linter.grammar import GRAMMAR
from snakegen.linter.joint_rules import AXIS_TOLERANCE
from snakegen.linter.xml_tree import Node, parse_xml


class Mend(NamedTuple):
    """One edit: the bytes from `start` to `end` become `text`."""

    start: int
    end: int
    text: str
    line: int
    words: str  # what was done


def fix(text: str, folder: Path | None = None) -> tuple[str, list[str]]:
    """Returns the mended text and what was done, a sentence for each edit.

    Args:
        text: a URDF that parses.
        folder: where relative paths start, to shorten absolute ones; None leaves them.

    Raises:
        XmlFault: the text is not well-formed XML.
    """
    done = []
    body = text.removeprefix("\ufeff").lstrip(" \t\r\n")
    if body.startswith("<?xml") and body != text:
        text = body
        done.append("line 1: removed what preceded the XML declaration")
    data = text.encode("utf-8")
    mends = sorted(_mends(parse_xml(text), data, folder), key=lambda mend: mend.start)
    out, at = [], 0
    for mend in mends:
        if mend.start < at:
            continue  # inside an element that is removed
        out += [data[at : mend.start], mend.text.encode("utf-8")]
        at = mend.end
        done.append(f"line {mend.line}: {mend.words}")
    return b"".join([*out, data[at:]]).decode("utf-8"), done


def _one_line(node: Node, tag: bytes, owner: str) -> Iterator[Mend]:
    rule = GRAMMAR.get(node.tag)
    for name in (n for n, count in rule.numbers if count > 1) if rule else ():
        match = re.search(rb"""(?<=\s)%s\s*=\s*("[^"]*"|'[^']*')""" % name.encode(), tag)
        if match is not None and re.search(rb"[\t\n\r]", match[1]):
            words = f"put {name} of <{node.tag}> of {owner} on one line"
            value = " ".join(match[1][1:-1].decode("utf-8").split())
            yield from _attribute(node, tag, name, value, words)


def _mends(robot: Node, data: bytes, folder: Path | None) -> Iterator[Mend]:
    waiting = [(robot, label(robot))]
    while waiting:
        node, owner = waiting.pop()
        for child in node.children:
            if child.tag in ("snakegen", "mujoco", "gazebo"):
                continue
            waiting.append((child, label(child) if node is robot else owner))
            yield from _respell_tag(child, node, data)
        tag = data[node.start : _tag_end(data, node.start)]
        if node.tag == "axis":
            yield from _unit_axis(node, tag, owner)
        else:
            yield from _one_line(node, tag, owner)
        if node.tag == "link":
            yield from _drop_empty_inertial(node, data)
        elif node.tag in ("mesh", "texture"):
            yield from _portable_path(node, tag, owner, folder)
        yield from _respell(node, tag, owner)


def _tag_end(data: bytes, start: int) -> int:
    """Returns the offset behind the start tag at `start`, quoted ``>`` left alone."""
    match = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""").match(data, start)
    return match.end() if match else start


def _attribute(node: Node, tag: bytes, name: str, value: str, words: str) -> Iterator[Mend]:
    match = re.search(rb"""(?<=\s)%s\s*=\s*("[^"]*"|'[^']*')""" % re.escape(name.encode()), tag)
    if match is not None and '"' not in value:
        start = node.start + match.start(1)
        yield Mend(start, node.start + match.end(1), f'"{value}"', node.line, words)


def _unit_axis(node: Node, tag: bytes, owner: str) -> Iterator[Mend]:
    axis = numbers(node, "xyz", 3)
    length = math.hypot(*axis) if axis else 0.0
    if axis and length > 0 and abs(length - 1) > AXIS_TOLERANCE[0]:
        value = " ".join(f"{x / length:.17g}" for x in axis)
        yield from _attribute(node, tag, "xyz", value, f"normalised the axis of {owner}")


def _drop_empty_inertial(link: Node, data: bytes) -> Iterator[Mend]:
    inertial = link.find("inertial")
    if inertial is None or number(inertial.find("mass"), "value") != 0.0:
        return
    tensor = inertial.find("inertia")
    if tensor is not None and any(_number(v) != 0.0 for v in tensor.attrib.values()):
        return
    end = inertial.end if inertial.end > inertial.start else _tag_end(data, inertial.start)
    words = f"removed the empty <inertial> of {label(link)}"
    yield Mend(inertial.start, end, "", inertial.line, words)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _portable_path(node: Node, tag: bytes, owner: str, folder: Path | None) -> Iterator[Mend]:
    uri = node.attrib.get("filename", "")
    if "://" not in uri and "\\" in uri and not re.match(r"[A-Za-z]:", uri):
        path = uri.replace("\\", "/")
        yield from _attribute(node, tag, "filename", path, f"turned the backslashes of {uri!r}")
    path = uri.removeprefix("file://")
    if folder is not None and path.startswith("/") and Path(path).is_file():
        try:
            inside = Path(path).resolve().relative_to(folder.resolve()).as_posix()
        except ValueError:
            return  # elsewhere: nothing relative would be shorter-lived
        words = f"made a path of {owner} relative"
        yield from _attribute(node, tag, "filename", inside, words)


def _respell(node: Node, tag: bytes, owner: str) -> Iterator[Mend]:
    rule = GRAMMAR.get(node.tag)
    if rule is None:
        return
    known = (*rule.texts, *(name for name, _ in rule.numbers))
    for name in node.attrib:
        if name in known or ":" in name or name.startswith("xml"):
            continue
        swapped = [k for k in known if sorted(k) == sorted(name)]
        close = swapped or get_close_matches(name, known, n=2, cutoff=0.75)
        if len(close) != 1 or close[0] in node.attrib:
            continue
        match = re.search(rb"(?<=\s)%s(?=\s*=)" % re.escape(name.encode()), tag)
        if match is not None:
            start = node.start + match.start()
            words = f"corrected {name!r} to {close[0]!r} in <{node.tag}> of {owner}"
            yield Mend(start, start + len(name.encode()), close[0], node.line, words)


def _respell_tag(child: Node, parent: Node, data: bytes) -> Iterator[Mend]:
    rule = GRAMMAR.get(parent.tag)
    if rule is None or child.tag in (*rule.once, *rule.many) or child.tag in GRAMMAR:
        return
    close = get_close_matches(child.tag, [*rule.once, *rule.many], n=2, cutoff=0.75)
    if len(close) != 1 or (close[0] in rule.once and parent.find(close[0]) is not None):
        return
    words = f"corrected <{child.tag}> to <{close[0]}> in {label(parent)}"
    name = child.tag.encode()
    yield Mend(child.start + 1, child.start + 1 + len(name), close[0], child.line, words)
    closing = b"</" + name
    if child.end > child.start:
        at = data.rindex(closing, child.start, child.end)
        yield Mend(at + 2, at + 2 + len(name), close[0], child.line, words)
