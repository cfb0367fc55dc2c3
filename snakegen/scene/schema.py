"""The scene file: obstacles, start, goal and what must hold on the way between them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base import yaml_file
from snakegen.base.geometry import Floats
from snakegen.errors import SceneError, near
from snakegen.scene.field_values import check_names, numbers, positive, vector
from snakegen.scene.obstacles import read_obstacle
from snakegen.scene.openings import Opening
from snakegen.scene.solids import Solid

FAR = 100.0  # m: a scene larger than this is probably in millimetres
_BESIDE = 0.45  # m, from the end of the way through an opening to a CoG above or below it
_KEYS = ("about", "obstacles", "start", "goal", "demands")
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
    check_names(data, _KEYS, where)
    solids: list[Solid] = []
    ways: list[Opening] = []
    for number, item in enumerate(data.get("obstacles") or [], 1):
        made, through = read_obstacle(item, f"{where}: obstacle {number}", number, path.parent)
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


def _place(item: Any, where: str, ways: list[Opening]) -> Place:
    if not isinstance(item, dict):
        raise SceneError(f"{where}: a mapping of {', '.join(_ENDS)}.")
    check_names(item, _ENDS, where)
    sides = [k for k in ("above", "below") if k in item]
    if len(sides) + ("cog" in item) != 1:
        raise SceneError(f"{where}: one of cog, above and below is needed.")
    within = positive(item, "within", where, 4.0 if sides else 0.0, zero=True)
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
        cog = vector(item, "cog", where)
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
        angles = {str(k): float(numbers([v], f"{where}: {k}", 1)[0]) for k, v in joints.items()}
    return Place(cog, vector(item, "rpy", where) if "rpy" in item else None, angles, within)


def _demands(item: Any, where: str) -> Demands:
    if item is None:
        return Demands()
    if not isinstance(item, dict):
        raise SceneError(f"{where}: a mapping, as in {{clearance: 0.03}}.")
    names = tuple(Demands.__dataclass_fields__)
    check_names(item, names, where)
    zero = ("clearance", "force_margin", "torque_margin", "tracking_sigmas")
    return Demands(**{k: positive(item, k, where, zero=k in zero) for k in item})
