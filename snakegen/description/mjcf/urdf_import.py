"""A URDF of any origin made ready for MuJoCo's importer: meshes located, its own settings merged.

MuJoCo reads meshes from the current folder, no ``package://`` paths, no COLLADA files, of an OBJ
the first object alone, one ``<mujoco>`` element, and stops at shapes of zero size and at impossible
inertias of welded frames. The masses that move, joints and names are not touched.
"""

import io
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from snakegen.description.mjcf.welded_inertia import weld_inertias
from snakegen.errors import DescriptionError
from snakegen.linter.file_rules import MAX_BYTES, READ_BY_MUJOCO, resolve_package

_SIZES = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}
_MOST_FACES = 200_000  # of an STL that MuJoCo reads
_SINGLE = frozenset(
    ("inertial", "origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration",
     "safety_controller")
)  # fmt: skip
_SHOWN = 6  # links in a message
_ALTERING = ("balanceinertia", "inertiafromgeom", "boundmass", "boundinertia")


@dataclass(frozen=True)
class Import:
    """What MuJoCo is handed.

    Attributes:
        text: the URDF with mesh paths that name `assets`.
        assets: bytes of each mesh file by that path.
        dropped: shapes and settings left out, a sentence each.
        sources: the mesh files that were read.
    """

    text: str
    assets: dict[str, bytes]
    dropped: tuple[str, ...]
    sources: tuple[Path, ...] = ()


def importable(
    urdf: str, folder: Path | None, known: Mapping[str, bytes] = {}, *, visuals: bool = True
) -> Import:
    """Prepares a URDF for MuJoCo.

    Args:
        urdf: URDF text.
        folder: where relative paths start; None where `known` has every mesh.
        known: meshes in memory, by the path that the URDF gives.
        visuals: keep what is only seen.

    Raises:
        DescriptionError: a mesh too large to read.
    """
    if folder is None and "<mujoco" not in urdf and visuals:
        return Import(urdf, dict(known), ())  # a build's own: nothing to locate
    robot = ET.fromstring(urdf)
    weld_inertias(robot)
    folders, dropped = _own_settings(robot, folder)
    dropped += _repeats(robot)
    assets = dict(known)
    names: dict[Path, str] = {}
    lost: dict[tuple[str, str], list[str]] = {}  # links by what was lost, and why
    for link in robot.iterfind("link"):
        for part in [p for p in link if p.tag in ("visual", "collision")]:
            if part.tag == "visual" and not visuals:
                link.remove(part)
                continue
            fault = _settle(part, folders, assets, names)
            if fault is not None:
                link.remove(part)
                lost.setdefault((part.tag, fault), []).append(str(link.get("name")))
    dropped += [f"{tag} of {_links(links)}: {fault}" for (tag, fault), links in lost.items()]
    return Import(ET.tostring(robot, encoding="unicode"), assets, tuple(dropped), tuple(names))


def _links(names: list[str]) -> str:
    """Returns links in words, the first few of many."""
    if len(names) == 1:
        return f"link '{names[0]}'"
    shown = ", ".join(f"'{n}'" for n in names[:_SHOWN]) + (", …" if len(names) > _SHOWN else "")
    return f"{len(names)} links ({shown})"


def _own_settings(robot: ET.Element, folder: Path | None) -> tuple[tuple[Path, ...], list[str]]:
    """Removes ``<mujoco>`` elements; returns the folders of meshes, and what does not apply.

    Of MuJoCo's own settings the mesh folder counts; those that alter masses would make another
    robot of it, and the settings of the simulation are made afresh.
    """
    folders = [] if folder is None else [folder]
    dropped = []
    for element in robot.findall("mujoco"):
        robot.remove(element)
        for compiler in element.findall("compiler"):
            if "meshdir" in compiler.attrib and folder is not None:
                folders.append(folder / compiler.attrib["meshdir"])
            dropped += [
                f"<mujoco> {name}: it would alter masses or inertias"
                for name in _ALTERING
                if compiler.get(name, "false") not in ("false", "auto", "0")
            ]
        others = sorted({child.tag for child in element} - {"compiler"})
        dropped += [f"<mujoco> <{tag}>: settings of a simulation are not kept" for tag in others]
    return tuple(folders), dropped


def _repeats(robot: ET.Element) -> list[str]:
    """Removes what stands twice where once is allowed: parsers read the first, MuJoCo refuses."""
    dropped = []
    for part in (*robot.iterfind("link"), *robot.iterfind("joint")):
        seen: set[str] = set()
        for child in list(part):
            if child.tag in seen and child.tag in _SINGLE:
                part.remove(child)
                dropped.append(f"second <{child.tag}> of {part.tag} '{part.get('name')}'")
            seen.add(child.tag)
    return dropped


def _settle(
    part: ET.Element, folders: tuple[Path, ...], assets: dict[str, bytes], names: dict[Path, str]
) -> str | None:
    """Makes one visual or collision readable for MuJoCo; returns why it cannot be, or None."""
    geometry = part.find("geometry")
    shapes = list(geometry) if geometry is not None else []
    if len(shapes) != 1:
        return f"{len(shapes)} shapes instead of one"
    shape = shapes[0]
    if shape.tag in _SIZES:
        values = " ".join(shape.get(name, "") for name in _SIZES[shape.tag]).split()
        return None if all(float(v) > 0 for v in values) else f"a <{shape.tag}> of no size"
    if shape.tag != "mesh":
        return f"a <{shape.tag}>, which MuJoCo does not know"
    uri = shape.get("filename", "")
    if uri in assets:
        return None
    file = locate(uri, folders)
    if file is None:
        package = uri.partition("://")[2].partition("/")[0]
        where = f" (set ROS_PACKAGE_PATH to the folder that holds {package})" if package else ""
        return f"mesh '{uri}' was not located{where}"
    if file not in names:
        name, content = _content(file)
        if content is None:
            return f"mesh '{uri}' cannot be read"
        taken = set(assets)
        names[file] = next(n for n in _numbered(name) if n not in taken)
        assets[names[file]] = content
    shape.set("filename", names[file])
    return None


def locate(uri: str, folders: tuple[Path, ...]) -> Path | None:
    """Returns the mesh file of a URI: of a package, a file, or a path relative to `folders`.

    The first of `folders` is the URDF's own; in the others MuJoCo looks by the file's name alone.
    """
    scheme, _, path = uri.rpartition("://")
    if scheme in ("package", "model"):
        return resolve_package(path, folders[0]) if folders else None
    if scheme not in ("", "file"):
        return None
    path = path.replace("\\", "/")
    if path.startswith("/"):
        return Path(path) if Path(path).is_file() else None
    tried = [folders[0] / path] if folders else []
    tried += [base / name for base in folders[1:] for name in (path, Path(path).name)]
    return next((file for file in tried if file.is_file()), None)


def _content(file: Path) -> tuple[str, bytes | None]:
    """Returns name and bytes of a mesh in a format that MuJoCo reads; None if unreadable."""
    if file.stat().st_size > MAX_BYTES:
        raise DescriptionError(f"{file}: too large; up to {MAX_BYTES / 1e6:g} MB are read.")
    suffix = file.suffix.lower()
    foreign = {".stl": _foreign_stl, ".obj": _foreign_obj}.get(suffix, lambda _: False)
    if suffix in READ_BY_MUJOCO and not foreign(file):
        return f"meshes/{file.stem}{suffix}", file.read_bytes()
    import trimesh

    try:
        mesh = trimesh.load_mesh(file, process=False)
        if isinstance(mesh, trimesh.Scene):
            mesh = mesh.to_mesh()
        if len(mesh.faces) == 0:
            return file.name, None
        kind = "stl" if len(mesh.faces) <= _MOST_FACES else "obj"
        stream = io.BytesIO()
        mesh.export(stream, file_type=kind)
    except Exception:  # whatever a damaged file makes a reader raise
        return file.name, None
    return f"meshes/{file.stem}.{kind}", stream.getvalue()


def _foreign_stl(file: Path) -> bool:
    """Tells whether an STL is of a kind that MuJoCo does not read: text, empty or too fine."""
    size = file.stat().st_size
    with file.open("rb") as stream:
        head = stream.read(84)
    faces = int.from_bytes(head[80:84], "little")
    return len(head) < 84 or size != 84 + 50 * faces or not 1 <= faces <= _MOST_FACES


def _foreign_obj(file: Path) -> bool:
    """Tells whether MuJoCo would lose faces of an OBJ: it reads the first of several objects.

    And of faces with and without texture coordinates in one file only some.
    """
    groups, kinds, here = set(), set(), b""
    with file.open("rb") as stream:
        for number, line in enumerate(stream):
            if line.startswith((b"o ", b"g ")):
                here = b"%d" % number
            elif line.startswith(b"f "):
                groups.add(here)
                kinds.add(b"//" in line or b"/" not in line)
                if len(groups) > 1 or len(kinds) > 1:
                    return True
    return False


def _numbered(name: str) -> list[str]:
    """Returns the name and variants of it for files of one name in several folders."""
    stem, _, suffix = name.rpartition(".")
    return [name, *(f"{stem}_{k}.{suffix}" for k in range(2, 1000))]
