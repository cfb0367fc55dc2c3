"""The rules of the linter about the XML itself: blanks in vectors, prefixes, namespaces."""

import re
from collections.abc import Iterator

from snakegen.linter.finding import Finding, finding, label
from snakegen.linter.grammar import GRAMMAR
from snakegen.linter.xml_tree import Node

_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
_VALUE = re.compile(rb"""\b([\w.-]+)\s*=\s*("[^"]*[\t\n\r][^"]*"|'[^']*[\t\n\r][^']*')""")


def text_faults(root: Node, text: str) -> Iterator[Finding]:
    """Yields what parsers differ about, whatever the elements mean.

    Args:
        root: the root element.
        text: that it was read from.
    """
    yield from _prefix_faults(root)
    if re.search(r"""=\s*["'][^"'<>]*[\t\n]""", text) is None:
        return
    data = text.removeprefix("\ufeff").encode("utf-8")
    for node, owner in _walk(root):
        names = dict(GRAMMAR[node.tag].numbers) if node.tag in GRAMMAR else {}
        tag = _TAG.match(data, node.start) if names else None
        for match in _VALUE.finditer(tag[0]) if tag else ():
            name = match[1].decode("utf-8")
            if names.get(name, 1) > 1:
                message = f"{name} of <{node.tag}> holds a tab or a line end"
                yield finding("attribute_blanks", label(owner), node.line, message)


def _prefix_faults(root: Node) -> Iterator[Finding]:
    declared = {n.partition(":")[2] for n in root.attrib if n.startswith("xmlns:")} | {"xml"}
    if "xmlns" in root.attrib:
        message = f"its default namespace is {root.attrib['xmlns']!r}"
        yield finding("default_namespace", label(root), root.line, message)
    seen: set[str] = set()
    waiting = [(root, frozenset(declared))]
    while waiting:
        node, known = waiting.pop()
        own = {n.partition(":")[2] for n in node.attrib if n.startswith("xmlns:")}
        known = known | own if own else known
        for name in (node.tag, *node.attrib):
            prefix, colon, _ = name.partition(":")
            left = name == node.tag and prefix == "xacro"  # a template, another rule's
            if colon and not left and prefix != "xmlns" and prefix not in known | seen:
                seen.add(prefix)
                message = f"the prefix of {name!r} is not declared"
                yield finding("undeclared_prefix", f"<{node.tag}>", node.line, message)
        waiting += [(child, known) for child in reversed(node.children)]


def _walk(root: Node) -> Iterator[tuple[Node, Node]]:
    """Yields each element of the format with the child of the root that holds it."""
    waiting = [(child, child) for child in reversed(root.children)]
    while waiting:
        node, owner = waiting.pop()
        yield node, owner
        waiting += [(child, owner) for child in reversed(node.children)]
