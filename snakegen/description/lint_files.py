"""The rules of the lint about files: meshes and textures that are missing or will not travel."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath

from snakegen.description.finding import Finding, error, label, shapes, warning
from snakegen.description.xmltree import Node

MAX_BYTES = 256_000_000  # of a mesh or a texture


def mesh_faults(robot: Node, folder: Path | None) -> Iterator[Finding]:
    """Yields mesh and texture files that are missing, or that will not be found elsewhere.

    Args:
        robot: the root element.
        folder: where relative paths start; None skips the look for relative files.
    """
    counts: Counter[str] = Counter()
    for owner in robot.children:
        nodes = list(shapes(owner)) if owner.tag == "link" else []
        materials = [owner] if owner.tag == "material" else []
        materials += [m for part in owner.findall("visual") for m in part.findall("material")]
        nodes += [texture for material in materials for texture in material.findall("texture")]
        for node in nodes:
            uri = node.attrib.get("filename", "")
            # thirty rotors share one fan: its fault is told once
            counts[uri] += 1
            if node.tag in ("mesh", "texture") and uri and counts[uri] == 1:
                yield from _file_faults(node, label(owner), uri, folder)


def _file_faults(node: Node, where: str, uri: str, folder: Path | None) -> Iterator[Finding]:
    scheme, _, rest = uri.rpartition("://")
    if scheme and scheme != "file":
        message = (
            f"{uri!r} is not found by MuJoCo or the log viewer; use a path relative to the URDF"
        )
        code = "package_mesh" if scheme in ("package", "model") else "remote_mesh"
        yield warning(code, where, node.line, message)
        return
    path = rest if scheme else uri
    absolute = PurePosixPath(path).is_absolute() or PureWindowsPath(path).is_absolute()
    if scheme or absolute:
        message = f"{uri!r} is absolute and breaks on another machine; make it relative to the URDF"
        yield warning("absolute_mesh", where, node.line, message)
    if not absolute and folder is None:
        return
    file = Path(path) if absolute else (folder or Path()) / path
    if not file.is_file():
        message = f"the {node.tag} file {uri!r} does not exist"
        yield error(f"missing_{node.tag}", where, node.line, message)
    elif file.stat().st_size > MAX_BYTES:
        message = (
            f"the {node.tag} file {uri!r} has {file.stat().st_size / 1e6:.4g} MB; up to "
            f"{MAX_BYTES / 1e6:g} MB are read"
        )
        yield error(f"large_{node.tag}", where, node.line, message)
