"""Reading specs: presets, files and overrides, with errors that name the place and the remedy."""

import copy
import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from snakegen.base import yaml_file
from snakegen.base.bounded_text import what_is_there
from snakegen.errors import SpecError, near
from snakegen.spec import link_count
from snakegen.spec.inertia_scaling import scale_inertias
from snakegen.spec.mistakes import explain, sections_of
from snakegen.spec.robot_spec import RobotSpec

_LONGEST = 60  # characters of a variant's name


def templates_folder() -> Path:
    """Returns the folder of the templates: inside the wheel, or at the top of the repository."""
    here = Path(__file__).parents[1]
    inside = here / "_templates"
    return inside if inside.is_dir() else here.parent / "templates"


def presets() -> dict[str, Path]:
    """Returns the preset files by name."""
    return {p.stem: p for p in sorted((templates_folder() / "presets").glob("*.yaml"))}


def load_spec(
    source: str | Path | RobotSpec | Mapping[str, Any],
    *,
    links: int | None = None,
    apparatus: str | None = None,
    overrides: Iterable[str] = (),
) -> RobotSpec:
    """Reads a preset name, a spec file, or plain data; then applies the overrides.

    Args:
        source: preset name, path, plain mapping, or a RobotSpec.
        links: replaces ``chain.links``.
        apparatus: replaces ``vectoring_apparatus.at``, e.g. ``"1,2,4@0.3"``.
        overrides: ``path=value`` items, the value in YAML, e.g. ``"chain.length=0.3"``.

    Raises:
        SpecError: one line that says what, where, and what would have worked.
    """
    overrides = tuple(overrides)
    if isinstance(source, RobotSpec) and links is None and apparatus is None and not overrides:
        return source
    data, label, folder = _raw(source)
    given = copy.deepcopy(data)
    before = data["chain"].get("links") if isinstance(data.get("chain"), dict) else None
    options: dict[str, str] = {}  # names, by the field that they set
    if links is not None:
        options["chain.links"] = "--links"
        _put(data, ["chain", "links"], links, label)
    if apparatus is not None:
        options["vectoring_apparatus.at"] = "--apparatus"
        _put(data, ["vectoring_apparatus", "at"], apparatus, label)
    for item in overrides:
        path, equals, text = item.partition("=")
        if not equals or not path.strip():
            raise SpecError(f"--set '{item}': write path=value, as in chain.length=0.3.")
        value = yaml_file.parse(text, f"--set {path.strip()}")
        options[path.strip()] = f"--set {path.strip()}"
        _put(data, path.strip().split("."), value, label)
    if links is not None and isinstance(before, int) and links != before:
        link_count.refuse_lists(data, before, links, label)
    scaled = scale_inertias(given, data, _defaults(), options)
    try:
        spec = _checked(data, folder)
        spec.__dict__["scaled"] = tuple(scaled)
        if data != given:
            name = source.variant if isinstance(source, RobotSpec) else spec.name
            spec.__dict__["variant"] = variant_name(name, links, apparatus, overrides)
        return spec
    except ValidationError as error:
        options = options if _is_valid(given, folder) else {}
        raise SpecError(explain(error, data, label, options)) from None


def variant_name(
    name: str, links: int | None, apparatus: str | None, overrides: Iterable[str]
) -> str:
    """Returns the folder's name of a spec that was changed, as in ``dragon4-links6``.

    Names beyond 60 characters end in a digest of what they leave out.
    """
    parts = [f"links{links}"] if links is not None else []
    parts += [f"apparatus{apparatus}"] if apparatus is not None else []
    for item in overrides:
        path, _, value = item.partition("=")
        if path.strip() != "name":
            parts.append(f"{path.strip()}{value.strip()}")
    text = re.sub(r"[^A-Za-z0-9_.@-]+", "-", "-".join([name, *parts])).strip("-.")
    if len(text) <= _LONGEST:
        return text
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:8]
    return f"{text[: _LONGEST - 9].rstrip('-.')}-{digest}"


def validate(data: Any, label: str, folder: Path = Path()) -> RobotSpec:
    """Returns the checked spec; raises SpecError with the first mistake, named by its path.

    Args:
        data: plain data.
        label: names the spec in errors.
        folder: where the files that it names are looked for.
    """
    if not isinstance(data, dict):
        raise SpecError(f"{label}: a spec is a mapping with 'name' and 'chain'.")
    try:
        return _checked(data, folder)
    except ValidationError as error:
        raise SpecError(explain(error, data, label, {})) from None


def _defaults() -> dict[str, dict[str, Any]]:
    """Returns the default values of the fields of each section."""
    out = {}
    for name, field in RobotSpec.model_fields.items():
        section = next(sections_of(field.annotation), None)
        if section is not None:
            fields = section.model_fields.items()
            out[name] = {k: None if f.is_required() else f.default for k, f in fields}
    return out


def _checked(data: dict[str, Any], folder: Path) -> RobotSpec:
    return RobotSpec.model_validate(data, context={"folder": folder})


def _is_valid(data: dict[str, Any], folder: Path) -> bool:
    try:
        _checked(data, folder)
    except ValidationError:
        return False
    return True


def schema() -> str:
    """Returns the JSON Schema of a spec file, for editors."""
    out = RobotSpec.model_json_schema()
    out |= {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "snakegen robot"}
    return json.dumps(out, indent=2, ensure_ascii=False)


def save(spec: RobotSpec, path: Path) -> None:
    """Writes `spec` as it was given (defaults left out) to a YAML file that loads back equal.

    The mesh that it names goes along, unless a file of that name is there already.
    """
    from snakegen.base.atomic_io import write_atomically

    data = spec.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    write_atomically(path, yaml_file.dump(data))
    if spec.payload is not None and spec.payload.mesh is not None:
        copy = path.parent / spec.payload.mesh
        if not copy.exists():
            write_atomically(copy, (spec.folder / spec.payload.mesh).read_bytes())


def _raw(source: Any) -> tuple[dict[str, Any], str, Path]:
    """Returns a spec's data, its name in errors, and the folder it stands in."""
    if isinstance(source, RobotSpec):
        data = source.model_dump(mode="json", exclude_unset=True, exclude_none=True)
        return data, source.name, source.folder
    if isinstance(source, Mapping):
        label = str(source.get("name", "spec"))
        try:
            return json.loads(json.dumps(dict(source))), label, Path()
        except (TypeError, ValueError) as error:
            raise SpecError(f"{label}: a spec is plain data ({error}).") from None
    if not isinstance(source, str | Path):
        raise SpecError(
            "a robot is a preset's name, a path, a RobotSpec or a mapping, "
            f"not of type {type(source).__name__}."
        )
    if not str(source).strip():
        raise SpecError("a robot's name is empty; a preset's name or a file's path would do.")
    known = presets()
    if str(source) in known:
        path = known[str(source)]
    else:
        path = Path(source)
        if path.is_dir():
            raise SpecError(f"{path}: is a folder; a robot is a preset, a .yaml or a .urdf file.")
        if not path.is_file():
            if path.exists():
                raise SpecError(f"{path}: {what_is_there(path)}; a robot is a .yaml or .urdf file.")
            if path.suffix in (".yaml", ".yml") or path.parent != Path("."):
                raise SpecError(f"{path}: no such file.")
            raise SpecError(f"no preset and no file '{source}'.{near(str(source), known)}")
    data = yaml_file.read(path)
    if not isinstance(data, dict):
        raise SpecError(f"{path.name}: a spec is a mapping with 'name' and 'chain'.")
    return data, path.name, path.parent


def _put(data: dict[str, Any], path: list[str], value: Any, label: str) -> None:
    """Sets data[path…] = value; numbers index lists (from 1)."""
    at: Any = data
    if path[0] == "base" and len(path) > 1 and isinstance(data.get("base"), str):
        data["base"] = {"kind": data["base"]}
    for depth, key in enumerate(path[:-1]):
        if isinstance(at, list):
            at = at[_index(at, path, depth, label)]
        else:
            at[key] = {} if at.get(key) is None else at[key]
            at = at[key]
        if not isinstance(at, dict | list):
            here = ".".join(path[: depth + 1])
            raise SpecError(f"{label}: '{here}' is the one value {at!r}; set '{here}' as a whole.")
    if isinstance(at, list):
        at[_index(at, path, len(path) - 1, label)] = value
    else:
        at[path[-1]] = value


def _index(at: list[Any], path: list[str], depth: int, label: str) -> int:
    here = ".".join(path[:depth])
    if not path[depth].isdigit() or not 1 <= int(path[depth]) <= len(at):
        raise SpecError(f"{label}: '{here}' is a list; write {here}.1 … {here}.{len(at)}.")
    return int(path[depth]) - 1
