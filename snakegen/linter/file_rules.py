"""The rules of the linter about files: meshes and textures, where they are and whether they fit."""

import os
import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np

from snakegen.base.bounded_text import what_is_there
from snakegen.linter.finding import Finding, finding, label, numbers, shapes
from snakegen.linter.xml_tree import Node

READ_BY_MUJOCO = (".stl", ".obj", ".msh")
MAX_BYTES = 256_000_000  # of a mesh or a texture
FAR = 50.0  # m
_STL_HEAD, _STL_TRIANGLE = 84, 50  # bytes


def mesh_faults(robot: Node, folder: Path | None) -> Iterator[Finding]:
    """Yields mesh and texture files that are missing, do not fit, or are not found elsewhere.

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
            counts[uri] += 1  # thirty rotors share one fan: its fault is reported once
            if node.tag in ("mesh", "texture") and uri and counts[uri] == 1:
                yield from _file_faults(node, label(owner), uri, folder)


def _file_faults(node: Node, where: str, uri: str, folder: Path | None) -> Iterator[Finding]:
    scheme, _, path = uri.rpartition("://")
    line = node.line
    if scheme in ("package", "model"):
        file = resolve_package(path, folder) if folder is not None else None
        yield finding("package_mesh", where, line, f"{uri!r} names a package")
        if file is None and folder is not None:
            yield finding("unresolved_package", where, line, f"{uri!r} was not located")
    elif scheme not in ("", "file"):
        yield finding("remote_mesh", where, line, f"{uri!r} is at a network address")
        return
    else:
        absolute = PurePosixPath(path).is_absolute() or PureWindowsPath(path).is_absolute()
        if scheme or absolute:
            yield finding("absolute_mesh", where, line, f"{uri!r} is absolute")
        if "\\" in path and not absolute:
            yield finding("backslash_path", where, line, f"{uri!r} holds backslashes")
            path = path.replace("\\", "/")
        if not absolute and folder is None:
            return
        file = Path(path) if absolute else (folder or Path()) / path
        if not file.is_file():
            yield _missing(node, where, uri, file)
            return
    if file is not None and file.stat().st_size > MAX_BYTES:
        message = f"{uri!r} has {file.stat().st_size / 1e6:.4g} MB; up to {MAX_BYTES / 1e6:g} MB "
        yield finding(f"large_{node.tag}", where, line, f"{message}are read")
    elif file is not None and node.tag == "mesh":
        yield from _content_faults(node, where, uri, file)


def resolve_package(path: str, folder: Path) -> Path | None:
    """Returns the file of ``package://<path>``; None where no such package is at hand.

    Looked for below ``ROS_PACKAGE_PATH`` and in the folders above `folder`, by the package's name
    as a folder, and with its name dropped where a folder above has that name.
    """
    package, _, rest = path.partition("/")
    roots = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    here = folder.resolve()
    for root in [*roots, here, *here.parents]:
        for base in (root / package, root) if root.name == package else (root / package,):
            if (base / rest).is_file():
                return base / rest
    return None


def _missing(node: Node, where: str, uri: str, file: Path) -> Finding:
    code = f"missing_{node.tag}"
    try:
        others = [p.name for p in file.parent.iterdir()] if file.parent.is_dir() else []
    except OSError:
        others = []
    twin = next((o for o in others if o.lower() == file.name.lower()), None)
    if twin is not None and file.name not in others:
        return finding("case_mismatch", where, node.line, f"{uri!r} is called {twin!r}")
    there = what_is_there(file) if file.exists() else "does not exist"
    there = "is a link to nothing" if file.is_symlink() and not file.exists() else there
    return finding(code, where, node.line, f"the {node.tag} file {uri!r} {there}")


def _content_faults(node: Node, where: str, uri: str, file: Path) -> Iterator[Finding]:
    suffix, size = file.suffix.lower(), file.stat().st_size
    if suffix not in READ_BY_MUJOCO:
        yield finding("mesh_format", where, node.line, f"{uri!r} is of format '{suffix}'")
    if size == 0:
        yield finding("empty_mesh", where, node.line, f"{uri!r} is empty")
    elif suffix == ".stl":
        extent = stl_extent(file, size)
        scale = max(map(abs, numbers(node, "scale", 3) or (1.0,)))
        if extent == 0.0:
            yield finding("empty_mesh", where, node.line, f"{uri!r} holds no triangle")
        elif extent is not None and extent * scale > FAR:
            message = f"{uri!r} reaches {extent * scale:.3g} m"
            yield finding("mesh_scale", where, node.line, message)


def stl_extent(file: Path, size: int, most: int = 2000) -> float | None:
    """Returns the largest coordinate of a binary STL's first triangles; None for other files."""
    with file.open("rb") as stream:
        head = stream.read(_STL_HEAD)
        if len(head) < _STL_HEAD:
            return None
        count = struct.unpack("<I", head[80:])[0]
        if size != _STL_HEAD + _STL_TRIANGLE * count:
            return None  # text, or damaged
        data = stream.read(_STL_TRIANGLE * min(count, most))
    rows = np.frombuffer(data, np.uint8).reshape(-1, _STL_TRIANGLE)
    points = np.ascontiguousarray(rows[:, 12:48]).view("<f4")
    return float(np.fmax.reduce(np.abs(points), axis=None, initial=0.0))
