"""The modules file: what a URDF of someone else carries, in a YAML file next to it."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from snakegen.base import yaml_file
from snakegen.errors import DescriptionError, near
from snakegen.robot.losses import Losses
from snakegen.robot.modules import Apparatus, Modules, Rotor, Servo
from snakegen.robot.rotor_shafts import rotor_shafts
from snakegen.spec.control import Control, GainSet
from snakegen.spec.defaults import rate_filter
from snakegen.spec.plant import Plant, Uncertainty

FIELDS = ("floating_root", "link_length", "apparatuses", "servos", "control", "plant")
_MOST = 2000  # entries of a list
_ARMATURE = 0.005  # kg·m², of a servo that the file says nothing about (assumed)


def from_file(path: Path, root: str) -> Modules:
    """Reads a modules file for a URDF whose root link is `root`.

    Raises:
        DescriptionError: an unknown key, a missing value, or a root that the URDF does not have.
    """
    return from_data(yaml_file.read(path), path.name, root)


def from_data(data: Any, place: str, root: str) -> Modules:
    """Returns the modules that a modules file holds, read already.

    Args:
        data: a mapping, as `snakegen.adopt` returns.
        place: how errors call it, as in ``modules.yaml``.
        root: name of the URDF's root link.

    Raises:
        DescriptionError: an unknown key, a missing value, or a root that the URDF does not have.
    """
    if not isinstance(data, dict):
        raise DescriptionError(f"{place}: write 'floating_root:' and 'apparatuses:'.")
    _known(data, FIELDS, place)
    floating = data.get("floating_root")
    if floating is not None and floating != root:
        raise DescriptionError(
            f"{place}: floating_root '{floating}' is not the URDF's root link '{root}'."
        )
    lengths = {}
    if "link_length" in data:
        lengths[root] = _listed_real(data["link_length"], f"{place}: link_length")
        if lengths[root] <= 0:
            raise DescriptionError(f"{place}: link_length {lengths[root]:g} m is no length.")
    found = Modules(
        floating=floating is not None,
        lengths=lengths,
        apparatuses=tuple(
            _listed_apparatus(a, f"{place}: apparatuses[{i + 1}]", i + 1)
            for i, a in enumerate(_listed(data, "apparatuses", place))
        ),
        servos=tuple(
            _listed_servo(s, f"{place}: servos[{i + 1}]")
            for i, s in enumerate(_listed(data, "servos", place))
        ),
        **_flying(data, place),
    )
    found = _with_mode(found, data, place)
    named: dict[str, str] = {}
    for j, apparatus in enumerate(found.apparatuses):
        for name in (*apparatus.rotor_labels, apparatus.roll, apparatus.pitch):
            here = f"apparatuses[{j + 1}]"
            if name is not None and name in named:
                raise DescriptionError(f"{place}: {here} names '{name}', as {named[name]} does.")
            named[str(name)] = here
    return found


def _flying(data: dict[str, Any], name: str) -> dict[str, Any]:
    """Returns control, gain sets and plant, said as a spec says them."""
    out: dict[str, Any] = {}
    try:
        if data.get("control") is not None:
            checked = Control.model_validate(data["control"])
            control = checked.model_dump(mode="python")
            asked, rate = control["rate_filter"], control["attitude_rate"]
            bends = bool((data.get("plant") or {}).get("link_stiffness"))
            count = len(data.get("apparatuses") or [])  # a body's links are not told apart here
            control["rate_filter"] = rate_filter(asked, rate, count, bends=bends)
            control.pop("gain_sets")
            named = checked.gain_sets if "gain_sets" in data["control"] else {}
            # defaults depend on the gimbals: what a set does not name stays open here
            sets = {k: v.model_dump(exclude_unset=True) for k, v in named.items()}
            control["gains"] = control["gains"] if sets else ""
            out |= {"control": control, "gain_sets": sets}
        if data.get("plant") is not None:
            plant = Plant.model_validate(data["plant"]).model_dump(mode="python")
            out["losses"] = Losses.of(plant.pop("losses"))
            out |= {"uncertainty": plant.pop("uncertainty"), "plant": plant}
    except ValidationError as error:
        raise DescriptionError(f"{name}: {_first_mistake(error)}") from None
    return out


def _with_mode(found: Modules, data: dict[str, Any], name: str) -> Modules:
    """Returns `found` in dual-rotor mode where no gimbal turns its rotors.

    Raises:
        DescriptionError: a mode that needs gimbals is asked for where there are none.
    """
    if not found.apparatuses or any(a.roll or a.pitch for a in found.apparatuses):
        return found
    asked = (data.get("control") or {}).get("mode", "dual_rotor")
    if asked != "dual_rotor":
        raise DescriptionError(
            f"{name}: control.mode '{asked}' turns gimbals, and no apparatus names any; "
            "write 'mode: dual_rotor'."
        )
    return replace(found, control={**found.control, "mode": asked})


def _first_mistake(error: ValidationError) -> str:
    first = error.errors()[0]
    where = ".".join(str(k) for k in first["loc"])
    if first["type"] == "extra_forbidden":
        known = Control.model_fields | Plant.model_fields | GainSet.model_fields
        known |= Uncertainty.model_fields
        return f"has no field '{where}'.{near(str(first['loc'][-1]), known)}"
    what = first["msg"].removeprefix("Value error, ")
    return f"'{where}': {what[0].lower()}{what[1:]}." if where else f"{what}."


def _listed(data: dict[str, Any], key: str, place: str) -> list[Any]:
    value = data.get(key)
    if value is None:
        return []
    if not isinstance(value, list):
        raise DescriptionError(f"{place}: '{key}' is a list; begin each entry with '- '.")
    if len(value) > _MOST:
        raise DescriptionError(f"{place}: '{key}' has {len(value)} entries; at most {_MOST}.")
    return value


def _listed_apparatus(data: Any, place: str, number: int) -> Apparatus:
    _known(data, ("roll", "pitch", "link", "rotors"), place)
    rotors = _listed(data, "rotors", place)
    if not rotors:
        raise DescriptionError(f"{place}: 'rotors' is needed, a list of {{link, thrust_max, …}}.")
    joints = [_listed_name(data, key, place) for key in ("roll", "pitch", "link")]
    return Apparatus(
        tuple(
            _listed_rotor(r, f"{place}.rotors[{k + 1}]", f"rotor{number}_{k + 1}")
            for k, r in enumerate(rotors)
        ),
        *joints,
    )


def _listed_rotor(data: Any, place: str, default: str) -> Rotor:
    """Returns a rotor; one with a position is named `default` where it has no name."""
    _known(data, Rotor.__dataclass_fields__, place)
    link = _listed_name(data, "link", place)
    for key in ("link", "thrust_max"):
        if data.get(key) is None:
            raise DescriptionError(f"{place}: '{key}' is needed.")
    given = data.get("axis", (0.0, 0.0, 1.0))
    wrong = f"{place}.axis: {given!r} is no direction; write [0, 0, 1]."
    axis = _listed_vector(given, f"{place}.axis", wrong)
    norm = sum(x * x for x in axis) ** 0.5
    if not norm > 0:
        raise DescriptionError(wrong)
    at = data.get("position", (0.0, 0.0, 0.0))
    wrong = f"{place}.position: {at!r} is no point; write three numbers in m, as [0.2, 0, 0]."
    position = _listed_vector(at, f"{place}.position", wrong)
    values = {k: v for k, v in data.items() if k not in ("link", "axis", "position", "name")}
    numbers = {"thrust_min": 0.0, "drag_ratio": 0.0} | {
        k: _listed_real(v, f"{place}.{k}") for k, v in values.items()
    }
    x, y, z = axis
    name = _listed_name(data, "name", place) or (default if "position" in data else "")
    rotor = Rotor(
        link=str(link), axis=(x / norm, y / norm, z / norm), position=position, name=name, **numbers
    )
    if not max(rotor.thrust_min, 0.0) < rotor.thrust_max:  # a negative least one: reversible
        pulls = rotor.thrust_min < rotor.thrust_max <= 0.0
        remedy = "turn the axis round" if pulls else "thrust_max must be above 0 and thrust_min"
        raise DescriptionError(
            f"{place}: thrust limits {rotor.thrust_min:g} … {rotor.thrust_max:g} N are no range; "
            f"{remedy}."
        )
    for key in ("lag", "inertia", "diameter", "speed", "stream_efficiency"):
        if getattr(rotor, key) < 0:
            raise DescriptionError(f"{place}.{key}: {getattr(rotor, key):g} is negative.")
    if rotor.stream_efficiency > 1:
        raise DescriptionError(
            f"{place}.stream_efficiency: {rotor.stream_efficiency:g} is no share; write 0 … 1."
        )
    return rotor


def _listed_servo(data: Any, place: str) -> Servo:
    _known(data, Servo.__dataclass_fields__, place)
    joint = _listed_name(data, "joint", place)
    if joint is None:
        raise DescriptionError(f"{place}: 'joint' is needed.")
    numbers = {k: _listed_real(v, f"{place}.{k}") for k, v in data.items() if k != "joint"}
    for key, value in numbers.items():
        if value < 0:
            raise DescriptionError(f"{place}.{key}: {value:g} is negative.")
    return Servo(joint, **numbers)


def _listed_vector(value: Any, place: str, wrong: str) -> tuple[float, float, float]:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise DescriptionError(wrong)
    x, y, z = (_listed_real(part, place) for part in value)
    return x, y, z


def _listed_name(data: dict[str, Any], key: str, place: str) -> str | None:
    value = data.get(key)
    if value is not None and not isinstance(value, str):
        raise DescriptionError(f"{place}.{key}: {value!r} is no name.")
    return value


def _listed_real(value: Any, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise DescriptionError(f"{place}: {value!r} is not a number.")
    return float(value)


def _known(data: Any, names: Any, place: str) -> Any:
    if not isinstance(data, dict):
        raise DescriptionError(f"{place}: a mapping with {', '.join(names)} is needed.")
    for key in data:
        if key not in names:
            raise DescriptionError(f"{place} has no field '{key}'.{near(str(key), names)}")
    return data


def with_servos(modules: Modules, urdf: str) -> Modules:
    """Returns `modules` with a default servo on each gimbal and each limited joint that has none.

    Shafts of rotors get none.

    A URDF does not say what drives a joint; one with limits is no bearing. A servo whose friction
    is not given has that of its joint's <dynamics>.
    """
    served = {s.joint for s in modules.servos}
    friction = {
        str(e.get("name")): float(d.get("friction", 0.0))
        for e in ET.fromstring(urdf).iterfind("joint")
        if (d := e.find("dynamics")) is not None
    }
    gimbals = {n for a in modules.apparatuses for n in (a.roll, a.pitch)}
    shafts = rotor_shafts(urdf, modules)
    driven = [
        str(e.get("name"))
        for e in ET.fromstring(urdf).iterfind("joint")
        if e.find("mimic") is None
        and e.get("name") not in shafts
        and (e.get("type") in ("revolute", "prismatic") or e.get("name") in gimbals)
    ]
    missing = [name for name in driven if name not in served]
    added = tuple(Servo(n, armature=_ARMATURE) for n in missing)
    servos = (
        replace(s, friction=s.friction or friction.get(s.joint, 0.0))
        for s in (*modules.servos, *added)
    )
    return replace(modules, servos=tuple(servos))
