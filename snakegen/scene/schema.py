"""The scene file: obstacles, start, goal and what must hold on the way between them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base import yaml_file
from snakegen.base.bounded_text import what_is_there
from snakegen.base.geometry import Floats, rotation_from_rpy, rotation_onto
from snakegen.errors import SceneError, near
from snakegen.scene.meshes import point_cloud, triangle_mesh
from snakegen.scene.openings import Opening, pipe, plate
from snakegen.scene.solids import Solid

FAR = 100.0  # m: a scene larger than this is probably in millimetres
_BESIDE = 0.45  # m, from the end of the way through an opening to a CoG above or below it
_KEYS = ("about", "obstacles", "start", "goal", "demands")
_FIELDS = {
    "box": ("centre", "size", "half", "rpy", "openings"),
    "cylinder": ("from", "to", "radius"),
    "pipe": ("points", "radius", "wall"),
    "half_space": ("point", "normal"),
    "mesh": ("file", "centre", "rpy", "scale"),
    "points": ("file", "radius", "scale"),
}
_ENDS = ("cog", "rpy", "joints", "above", "below", "within")


@dataclass(frozen=True, eq=False)
class Place:
    """Where the body starts or ends.

    Attributes:
        cog: (3,) m, of its centre of gravity.
        rpy: (3,) rad of the root link; None: any heading, level.
        joints: rad by name; None: spread out as the body rests in the air.
        within: m, how far from `cog` the CoG may be; 0: exactly there.
    """

    cog: Floats
    rpy: Floats | None
    joints: dict[str, float] | None
    within: float


@dataclass(frozen=True)
class Demands:
    """What must hold at every instant.

    Attributes:
        clearance: m, least distance of the body from obstacles.
        force_margin, torque_margin: N, N·m (THEORY A4, virtual single rotors).
        joint_rate: rad/s, of joints, in addition to their own limits.
        gimbal_rate: rad/s, of gimbals at hover away from vertical links, beside half their limits.
        thrust_rate: N/s, of an apparatus' thrust at hover.
        cog_speed: m/s.
        cog_acceleration: m/s².
        battery_share: of the battery's energy, that the motion may take.
        tracking_sigmas: standard deviations of the tracking error to expect of usual hardware that
            the clearance must cover at every instant looked at.
    """

    clearance: float = 0.03
    force_margin: float = 5.0
    torque_margin: float = 1.0
    joint_rate: float = 0.31
    gimbal_rate: float = 3.0
    thrust_rate: float = 20.0
    cog_speed: float = 0.3
    cog_acceleration: float = 0.3
    battery_share: float = 0.9
    tracking_sigmas: float = 2.0


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene as planners and simulations take it.

    Attributes:
        name: the file's.
        solids: obstacles in convex parts.
        openings: ways through them.
        start, goal: where the body is; None in a scene of obstacles alone.
        demands: what must hold.
    """

    name: str
    solids: tuple[Solid, ...]
    openings: tuple[Opening, ...] = ()
    start: Place | None = None
    goal: Place | None = None
    demands: Demands = field(default_factory=Demands)


def read_scene(path: Path, *, ground: bool = True) -> Scene:
    """Reads a scene file.

    Args:
        path: YAML.
        ground: add one at z = 0 where the scene has no half-space.

    Raises:
        SceneError: the place of the mistake and what would have worked.
    """
    data = yaml_file.read(path)
    where = path.name
    if not isinstance(data, dict) or not isinstance(data.get("obstacles", []), list):
        raise SceneError(f"{where}: a scene is a mapping with a list of 'obstacles'.")
    _known(data, _KEYS, where)
    solids: list[Solid] = []
    ways: list[Opening] = []
    for number, item in enumerate(data.get("obstacles") or [], 1):
        made, through = _obstacle(item, f"{where}: obstacle {number}", number, path.parent)
        taken = {s.name.partition(".")[0] for s in solids}
        if made and made[0].name.partition(".")[0] in taken:
            raise SceneError(f"{where}: obstacle {number}: '{made[0].name}' stands twice.")
        solids += made
        ways += through
    _check_units(solids, where)
    if ground and not any(
        s.kind == "half_space" for s in solids
    ):  # simulations have ground at z = 0
        solids.append(Solid("ground", "half_space", np.zeros(3)))
    ends = {k: _place(data[k], f"{where}: {k}", ways) for k in ("start", "goal") if k in data}
    return Scene(
        path.stem,
        tuple(solids),
        tuple(ways),
        ends.get("start"),
        ends.get("goal"),
        _demands(data.get("demands"), f"{where}: demands"),
    )


def _check_units(solids: list[Solid], where: str) -> None:
    """Refuses lengths that look like millimetres, or like kilometres.

    Raises:
        SceneError: the solid, its size and what it would be in the other unit.
    """
    spans = []
    for solid in solids:
        found = solid.bounds()
        if found is None:
            continue
        spans.append(float(np.max(found[1] - found[0])))
        reach = float(max(np.abs(found[0]).max(), np.abs(found[1]).max()))
        if reach > FAR:
            raise SceneError(
                f"{where}: {solid.name} reaches {reach:g} m from the origin; lengths are in metres"
                f" (as millimetres it is {1e-3 * reach:g} m: divide by 1000, or scale: 0.001)."
            )
    if spans and max(spans) < 0.01:
        raise SceneError(
            f"{where}: the largest obstacle is {1e3 * max(spans):.2g} mm; lengths are in metres "
            f"(multiplied by 1000 it would be {1e3 * max(spans):.2g} m)."
        )


def _obstacle(
    item: Any, where: str, number: int, folder: Path
) -> tuple[list[Solid], list[Opening]]:
    if not isinstance(item, dict):
        raise SceneError(f"{where} is no mapping, as in {{box: …}} with centre and size.")
    kind = item.get("kind", "box")
    if kind not in _FIELDS:
        raise SceneError(f"{where}: kind: {kind!r} is none.{near(str(kind), _FIELDS)}")
    _known(item, ("name", "kind", *_FIELDS[kind]), where)
    name = str(item.get("name", f"{kind}{number}"))
    if "." in name:
        raise SceneError(f"{where}: name: '{name}' must not hold a dot.")
    make: Callable[..., tuple[list[Solid], list[Opening]]] = {
        "box": _box,
        "cylinder": _cylinder,
        "pipe": _pipe,
        "half_space": _half_space,
        "mesh": _mesh,
        "points": _points,
    }[kind]
    return make(item, name, where, folder)


def _box(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    centre = _vector(item, "centre", where)
    if ("size" in item) == ("half" in item):
        raise SceneError(f"{where}: a box has either 'size' or 'half' lengths.")
    half = _vector(item, "half", where) if "half" in item else 0.5 * _vector(item, "size", where)
    if np.any(half <= 0.0):
        raise SceneError(f"{where}: lengths must be above 0.")
    rotation = rotation_from_rpy(_vector(item, "rpy", where, default=(0.0, 0.0, 0.0)))
    listed = item.get("openings", [])
    if not isinstance(listed, list) or not all(isinstance(x, dict) for x in listed):
        raise SceneError(f"{where}: openings: a list of {{centre: [0, 0], size: [0.5, 0.5]}}.")
    holes = []
    for k, one in enumerate(listed, 1):
        _known(one, ("centre", "size"), f"{where}: opening {k}")
        size = _vector(one, "size", f"{where}: opening {k}", 2)
        if np.any(size <= 0.0):
            raise SceneError(f"{where}: opening {k}: size must be above 0.")
        holes.append((_vector(one, "centre", f"{where}: opening {k}", 2, (0.0, 0.0)), size))
    return plate(name, centre, half, rotation, holes)


def _cylinder(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    start, end = _vector(item, "from", where), _vector(item, "to", where)
    length = float(np.linalg.norm(end - start))
    if length < 1e-9:
        raise SceneError(f"{where}: 'from' and 'to' are the same point.")
    size = _positive(item, "radius", where), 0.5 * length
    rotation = rotation_onto((end - start) / length)
    return [Solid(name, "cylinder", 0.5 * (start + end), rotation, size)], []


def _pipe(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    listed = item.get("points")
    if not isinstance(listed, list) or len(listed) < 2:
        raise SceneError(f"{where}: points: two at least, as in [[0, 0, 1], [0, 0, 2]].")
    points = np.array([_numbers(x, f"{where}: point {i}") for i, x in enumerate(listed, 1)])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if np.any(steps < 1e-6):
        raise SceneError(f"{where}: point {int(np.argmin(steps)) + 2} repeats the one before.")
    wall = _positive(item, "wall", where, 0.02)
    return pipe(name, points, _positive(item, "radius", where), wall)


def _half_space(item: Any, name: str, where: str, _: Path) -> tuple[list[Solid], list[Opening]]:
    normal = _vector(item, "normal", where, default=(0.0, 0.0, 1.0))
    if np.linalg.norm(normal) < 1e-9:
        raise SceneError(f"{where}: normal must not be zero; it points out of the solid.")
    point = _vector(item, "point", where, default=(0.0, 0.0, 0.0))
    return [Solid(name, "half_space", point, rotation_onto(normal / np.linalg.norm(normal)))], []


def _mesh(item: Any, name: str, where: str, folder: Path) -> tuple[list[Solid], list[Opening]]:
    scale = _positive(item, "scale", where, 1.0)
    vertices, faces = triangle_mesh(_file(item, where, folder), scale, where)
    rotation = rotation_from_rpy(_vector(item, "rpy", where, default=(0.0, 0.0, 0.0)))
    centre = _vector(item, "centre", where, default=(0.0, 0.0, 0.0))
    return [Solid(name, "mesh", centre, rotation, (), vertices, faces)], []


def _points(item: Any, name: str, where: str, folder: Path) -> tuple[list[Solid], list[Opening]]:
    radius = _positive(item, "radius", where, 0.02)
    scale = _positive(item, "scale", where, 1.0)
    centres, size = point_cloud(_file(item, where, folder), scale, radius, where)
    eye = np.eye(3)
    return [Solid(f"{name}.{k}", "sphere", c, eye, (size,)) for k, c in enumerate(centres, 1)], []


def _place(item: Any, where: str, ways: list[Opening]) -> Place:
    if not isinstance(item, dict):
        raise SceneError(f"{where}: a mapping of {', '.join(_ENDS)}.")
    _known(item, _ENDS, where)
    sides = [k for k in ("above", "below") if k in item]
    if len(sides) + ("cog" in item) != 1:
        raise SceneError(f"{where}: one of cog, above and below is needed.")
    within = _positive(item, "within", where, 4.0 if sides else 0.0, zero=True)
    if sides:
        named = [w for w in ways if w.name == str(item[sides[0]])]
        if not named:
            known = sorted({w.name for w in ways})
            raise SceneError(
                f"{where}: no opening '{item[sides[0]]}'.{near(str(item[sides[0]]), known)}"
            )
        line = named[0].line if sides[0] == "above" else named[0].line[::-1]
        out = line[-1] - line[-2]
        cog = line[-1] + _BESIDE * out / np.linalg.norm(out)
    else:
        cog = _vector(item, "cog", where)
    if np.abs(cog).max() > FAR:
        raise SceneError(
            f"{where}: cog is {np.abs(cog).max():g} m from the origin; lengths are in metres (as "
            f"millimetres it is {1e-3 * np.abs(cog).max():g} m)."
        )
    joints = item.get("joints")
    if joints is not None and not isinstance(joints, dict):
        raise SceneError(f"{where}: joints: a mapping of names to angles, as in joint1_yaw: 0.5.")
    angles = None
    if joints is not None:
        angles = {str(k): float(_numbers([v], f"{where}: {k}", 1)[0]) for k, v in joints.items()}
    return Place(cog, _vector(item, "rpy", where) if "rpy" in item else None, angles, within)


def _demands(item: Any, where: str) -> Demands:
    if item is None:
        return Demands()
    if not isinstance(item, dict):
        raise SceneError(f"{where}: a mapping, as in {{clearance: 0.03}}.")
    names = tuple(Demands.__dataclass_fields__)
    _known(item, names, where)
    zero = ("clearance", "force_margin", "torque_margin", "tracking_sigmas")
    return Demands(**{k: _positive(item, k, where, zero=k in zero) for k in item})


def _known(item: dict[str, Any], names: tuple[str, ...], where: str) -> None:
    for key in item:
        if key not in names:
            raise SceneError(f"{where} has no field '{key}'.{near(str(key), names)}")


def _file(item: dict[str, Any], where: str, folder: Path) -> Path:
    if not isinstance(item.get("file"), str):
        raise SceneError(f"{where}: file: the name of a file is needed.")
    path = folder / item["file"]
    if not path.is_file():
        raise SceneError(f"{where}: file: {item['file']}: {what_is_there(path)}.")
    return path


def _vector(
    item: dict[str, Any], key: str, where: str, count: int = 3, default: Any = None
) -> Floats:
    if key not in item and default is not None:
        return np.array(default, float)
    return _numbers(item.get(key), f"{where}: {key}", count)


def _numbers(value: Any, where: str, count: int = 3) -> Floats:
    good = isinstance(value, list) and len(value) == count
    good = good and all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
    if not good or not np.all(np.isfinite(np.array(value, float))):
        raise SceneError(f"{where}: {count} finite numbers are needed, not {value!r}.")
    return np.array(value, float)


def _positive(
    item: dict[str, Any], key: str, where: str, default: float | None = None, zero: bool = False
) -> float:
    if key not in item and default is not None:
        return default
    number = float(_numbers([item.get(key)], f"{where}: {key}", 1)[0])
    if number < 0.0 or (number == 0.0 and not zero):
        raise SceneError(f"{where}: {key}: {number:g} must be above 0.")
    return number
