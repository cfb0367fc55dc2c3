"""The rules of the linter about MJCF: what MuJoCo loads but should not be trusted."""

from collections.abc import Iterator

from snakegen.linter.finding import Finding, finding, label
from snakegen.linter.xml_tree import Node

_ALTERING = ("balanceinertia", "boundmass", "boundinertia")


def mjcf_faults(root: Node) -> Iterator[Finding]:
    """Yields findings of a ``<mujoco>`` file, in document order.

    Args:
        root: the root element, known to be ``<mujoco>``; included files are not opened.
    """
    settings = [node for node in root.children if node.tag == "compiler"]
    for node in settings:
        yield from _compiler_faults(node)
    angle = next((n.attrib["angle"] for n in settings if "angle" in n.attrib), "degree")
    limited = any(_ranged(node) for node in _walk(root))
    if angle == "degree" and limited:
        yield finding("mjcf_degrees", "<compiler>", root.line, "ranges are in degrees")
    computed = any(n.attrib.get("inertiafromgeom") == "true" for n in settings)
    for node in _walk(root):
        if node.tag == "body" and not computed:
            yield from _body_faults(node)
        elif _ranged(node) and node.attrib.get("limited") == "false":
            message = 'a range beside limited="false"'
            yield finding("mjcf_range_ignored", label(node), node.line, message)
        elif node.tag in ("motor", "general", "position", "velocity"):
            yield from _actuator_faults(node)


def _walk(root: Node) -> Iterator[Node]:
    waiting = [root]
    while waiting:
        node = waiting.pop()
        yield node
        waiting.extend(reversed(node.children))


def _ranged(node: Node) -> bool:
    return node.tag in ("joint", "hinge") and "range" in node.attrib


def _compiler_faults(node: Node) -> Iterator[Finding]:
    if node.attrib.get("inertiafromgeom") == "true":
        message = 'inertiafromgeom="true" replaces declared inertias'
        yield finding("mjcf_inertia_overridden", "<compiler>", node.line, message)
    for name in _ALTERING:
        if node.attrib.get(name, "false") not in ("false", "0"):
            message = f"{name}={node.attrib[name]!r} alters masses or inertias"
            yield finding("mjcf_inertia_altered", "<compiler>", node.line, message)
    if node.attrib.get("fusestatic") == "true":
        yield finding("mjcf_implicit_fuse", "<compiler>", node.line, 'fusestatic="true"')


def _body_faults(node: Node) -> Iterator[Finding]:
    if node.find("inertial") is not None:
        return
    geoms = node.findall("geom")
    silent = [g for g in geoms if not {"mass", "density", "class"} & g.attrib.keys()]
    moving = any(child.tag in ("joint", "freejoint") for child in node.children)
    if silent and "childclass" not in node.attrib:
        message = f"no <inertial>: {len(silent)} geoms weigh 1000 kg/m³"
        yield finding("mjcf_default_density", label(node), node.line, message)
    elif moving and not geoms and not any(c.tag == "body" for c in node.children):
        yield finding("mjcf_massless", label(node), node.line, "a joint, but no mass")


def _actuator_faults(node: Node) -> Iterator[Finding]:
    bounded = {"forcerange", "ctrlrange", "class"} & node.attrib.keys()
    if "joint" in node.attrib and not bounded:
        message = "neither forcerange nor ctrlrange"
        yield finding("mjcf_unlimited_actuator", label(node), node.line, message)
