"""The rules of the linter about the tree: names, ends of joints, roots, loops."""

from collections.abc import Iterator

from snakegen.errors import near
from snakegen.linter.finding import Finding, finding, label
from snakegen.linter.xml_tree import Node


def end_of(joint: Node, side: str) -> str | None:
    """Returns the link on the `side` (``parent`` or ``child``) of a joint, None if absent."""
    node = joint.find(side)
    return None if node is None else node.attrib.get("link")


def tree_faults(robot: Node) -> Iterator[Finding]:
    """Yields duplicate names, dangling ends, second parents, loops, and missing or extra roots."""
    for tag in ("link", "joint", "material"):
        yield from _duplicates(robot.findall(tag), tag)
    links = {node.attrib.get("name", ""): node for node in robot.findall("link")}
    parent_of: dict[str, str] = {}
    via: dict[str, Node] = {}
    for joint in robot.findall("joint"):
        ends = {side: end_of(joint, side) for side in ("parent", "child")}
        for side, end in ends.items():
            if end is not None and end not in links:
                known = [name for name in links if name]
                message = f"its {side} link {end!r} does not exist.{near(end, known)}"
                line = getattr(joint.find(side), "line", joint.line)
                yield finding(f"dangling_{side}", label(joint), line, message)
        parent, child = ends["parent"], ends["child"]
        if parent not in links or child not in links or parent is None or child is None:
            continue
        if child in via:
            message = f"link {child!r} already hangs on {label(via[child])}"
            yield finding("two_parents", label(joint), joint.line, message)
        else:
            parent_of[child], via[child] = parent, joint
    yield from _root_faults(robot, links, parent_of)
    yield from _loop_faults(parent_of, via)


def _duplicates(nodes: list[Node], tag: str) -> Iterator[Finding]:
    first: dict[str, Node] = {}
    for node in nodes:
        name = node.attrib.get("name", "")
        if name in first and not (tag == "material" and _same(node, first[name])):
            message = f"the name is already taken on line {first[name].line}"
            yield finding(f"duplicate_{tag}", label(node), node.line, message)
        first.setdefault(name, node)


def _same(one: Node, other: Node) -> bool:
    """Tells whether two elements say the same."""
    alike = one.tag == other.tag and one.attrib == other.attrib
    pairs = zip(one.children, other.children, strict=False)
    return alike and len(one.children) == len(other.children) and all(_same(a, b) for a, b in pairs)


def _root_faults(
    robot: Node, links: dict[str, Node], parent_of: dict[str, str]
) -> Iterator[Finding]:
    # links that a dangling joint was meant to hold are reported with that joint, not as roots
    children = {end_of(joint, "child") for joint in robot.findall("joint")}
    if not children <= {None, *links}:
        return
    roots = [name for name in links if name not in parent_of and name not in children]
    if not roots:
        reason = "every link is some joint's child" if links else "there is no link"
        yield finding("no_root", label(robot), robot.line, f"the tree has no root: {reason}")
    for name in roots[1:]:
        message = f"a second root beside link {roots[0]!r}; join the two with a joint"
        yield finding("two_roots", label(links[name]), links[name].line, message)
    for name, node in links.items():
        if name == "world" and name in parent_of:
            message = "the name is that of the simulators' own world body"
            yield finding("link_named_world", label(node), node.line, message)


def _loop_faults(parent_of: dict[str, str], via: dict[str, Node]) -> Iterator[Finding]:
    done: set[str] = set()
    for start in parent_of:
        path: list[str] = []
        name: str | None = start
        while name is not None and name not in done:
            done.add(name)
            path.append(name)
            name = parent_of.get(name)
        if name in path:
            loop = path[path.index(name) :]
            message = f"the links {' < '.join([*loop, loop[0]])} form a closed loop"
            yield finding("loop", label(via[loop[0]]), via[loop[0]].line, message)
