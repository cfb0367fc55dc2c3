"""XML with line numbers and nothing else: no DOCTYPE, no entities, no recursion.

ElementTree forgets lines, and expat expands entities: a lint that reads files of strangers needs
the first and must refuse the second before anything is expanded.
"""

from dataclasses import dataclass, field
from xml.parsers import expat


class XmlFault(Exception):
    """Text that is not plain XML: `code` is ``malformed_xml`` or ``doctype``, `line` is 1-based."""

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
        XmlFault: malformed text, or a DOCTYPE (the only place where entities can be declared).
    """
    parser = expat.ParserCreate(encoding="utf-8")
    top = Node("", {}, 0)
    stack = [top]

    def start(tag: str, attrib: dict[str, str]) -> None:
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
