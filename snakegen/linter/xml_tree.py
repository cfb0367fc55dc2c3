"""XML with line numbers and nothing else: no DOCTYPE, no entities, no recursion.

ElementTree forgets lines, and expat expands entities: a lint that reads files of strangers needs
the first and must refuse the second before anything is expanded.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

MOST_ELEMENTS = 1_000_000  # some 1 GB of nodes, of 40,000 links
LONGEST = 1_000_000  # bytes of one tag; expat reads what is longer again with each such piece
_BLANK = bytes(c if c == 10 else 32 for c in range(256))  # all but the ends of lines
_SECTION = re.compile(rb"<!--|<!\[CDATA\[|<\?")
_ENDS = {b"<!--": b"-->", b"<![CDATA[": b"]]>", b"<?": b"?>"}


class XmlFault(Exception):
    """Text that is not plain XML: `code` is that of a lint rule, `line` is 1-based.

    Codes are ``malformed_xml``, ``doctype``, ``too_large`` and ``unreadable``.
    """

    def __init__(self, code: str, line: int, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.line = line
        self.message = message


@dataclass
class Node:
    """One element: its tag, attributes, 1-based line, child elements in order.

    `start` and `end` are the byte offsets of the element in the UTF-8 text, -1 where unknown.
    """

    tag: str
    attrib: dict[str, str]
    line: int
    children: list["Node"] = field(default_factory=list)
    start: int = -1
    end: int = -1

    def find(self, tag: str) -> "Node | None":
        """Returns the first child with this tag, or None."""
        return next((child for child in self.children if child.tag == tag), None)

    def findall(self, tag: str) -> list["Node"]:
        """Returns the children with this tag."""
        return [child for child in self.children if child.tag == tag]


def parse_xml(text: str) -> Node:
    """Reads one XML document into nodes.

    Args:
        text: the document; an encoding declaration in it is ignored, text is text already.

    Returns:
        The root element.

    Raises:
        XmlFault: malformed text, a DOCTYPE (the only place where entities can be declared), more
            elements than `MOST_ELEMENTS` or a tag longer than `LONGEST`.
    """
    parser = expat.ParserCreate(encoding="utf-8")
    top = Node("", {}, 0)
    stack = [top]

    count = 0

    def start(tag: str, attrib: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            line = parser.CurrentLineNumber
            raise XmlFault("too_large", line, f"more than {MOST_ELEMENTS} elements")
        node = Node(tag, attrib, parser.CurrentLineNumber, start=parser.CurrentByteIndex)
        stack[-1].children.append(node)
        stack.append(node)

    def end(_tag: str) -> None:
        at = parser.CurrentByteIndex  # of the end tag, or of the element where it has none
        tail = data.find(b">", at) + 1 if data[at : at + 2] == b"</" else 0
        stack.pop().end = max(at, tail)

    def doctype(*_args: object) -> None:
        line = parser.CurrentLineNumber
        raise XmlFault("doctype", line, "a DOCTYPE (and so any entity) is refused; remove it")

    try:
        data = text.removeprefix("\ufeff").encode("utf-8")
    except UnicodeEncodeError:
        raise XmlFault("malformed_xml", 1, "the text holds characters that no XML allows") from None
    if len(data) > LONGEST:
        data = _without_comments(data)
        if match := re.search(rb"<[^<>!?][^<>]{%d}" % LONGEST, data):
            line = data.count(b"\n", 0, match.start()) + 1
            raise XmlFault("too_large", line, f"a tag of more than {LONGEST / 1e6:g} MB")
    if words := _other_format(data):
        raise XmlFault("unreadable", 1, words)
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code) or "unreadable"
        raise XmlFault(
            "malformed_xml", error.lineno, f"not well-formed XML at column {error.offset}: {reason}"
        ) from None
    return top.children[0]


def _other_format(data: bytes) -> str:
    """Returns what a text is that is no XML at all; empty for what may be XML."""
    head = data[:2000].lstrip().lower()
    if not head:
        return "the file is empty" if not data.strip() else ""
    if head.startswith(b"version https://git-lfs"):
        return "it is a Git LFS pointer, not the file: run git lfs pull"
    if head.startswith((b"<!doctype html", b"<html")):
        return "it is a page of HTML, as a web site answers for the file"
    if not head.startswith(b"<"):
        return "it does not begin with '<', so it is no XML"
    return ""


def short_of_comments(text: str) -> str:
    """Returns XML of more than `LONGEST` bytes without its comments; lines keep their numbers."""
    if len(text) <= LONGEST:
        return text
    data = text.encode("utf-8", "surrogatepass")
    lines = (b"\n" * part.count(b"\n") if comment else part for part, comment in _parts(data))
    return b"".join(lines).decode("utf-8", "surrogatepass")


def _without_comments(data: bytes) -> bytes:
    """Returns XML with comments blanked: expat's time grows as the square of their length.

    Lines and offsets stay.
    """
    return b"".join(part.translate(_BLANK) if comment else part for part, comment in _parts(data))


def _parts(data: bytes) -> Iterator[tuple[bytes, bool]]:
    """Yields consecutive pieces of XML and whether each is a comment; a malformed one is not."""
    at = 0
    while match := _SECTION.search(data, at):
        end = data.find(_ENDS[match[0]], match.end())
        if end < 0:
            break
        stop = end + len(_ENDS[match[0]])
        yield data[at : match.start()], False
        comment = match[0] == b"<!--" and data.find(b"--", match.end(), end) < 0
        yield data[match.start() : stop], comment
        at = stop
    yield data[at:], False
