"""xacro on long chains: a macro's expansion is put in its place in one step.

`xacro.replace_node` inserts the nodes of an expansion one by one, and minidom looks for the place
from the beginning each time: quadratic in the elements of a robot, half of the time of a thousand
links. Within `one_step_replacement` the same tree results from one slice.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any
from xml.dom import minidom


@contextmanager
def one_step_replacement() -> Iterator[None]:
    """Replaces `xacro.replace_node` by its linear twin while the block runs."""
    import xacro

    before = xacro.replace_node
    xacro.replace_node = replace_node
    try:
        yield
    finally:
        xacro.replace_node = before


def replace_node(node: Any, by: Any, content_only: bool = False) -> None:
    """Puts `by` (a node, a list of them, or None), or their children, in the place of `node`."""
    parent, new = node.parentNode, []
    for part in by if isinstance(by, list) else [] if by is None else [by]:
        if content_only:
            new += part.childNodes
            del part.childNodes[:]
        else:
            if part.parentNode is not None:
                part.parentNode.removeChild(part)
            new.append(part)
    children = parent.childNodes
    at = children.index(node)
    chain = [node.previousSibling, *new, node.nextSibling]
    children[at : at + 1] = new
    for first, second in pairwise(chain):
        if first is not None:
            first.nextSibling = second
        if second is not None:
            second.previousSibling = first
    for child in new:
        child.parentNode = parent
    node.parentNode = node.previousSibling = node.nextSibling = None
    minidom._clear_id_cache(parent)  # type: ignore[attr-defined]
