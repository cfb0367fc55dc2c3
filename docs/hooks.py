"""MkDocs hooks: pages of the reference that are made from the program itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mkdocs.structure.files import Files

PICTURES = ("dragon3", "dragon4", "hybrid4", "screw4", "arm6", "grasper3")


def on_files(files: Files, config: Any) -> Files:
    """Adds the generated pages and the presets' pictures."""
    from mkdocs.structure.files import File

    for name, text in pages().items():
        files.append(File.generated(config, name, content=text))
    for robot in PICTURES:
        picture = Path("generated") / robot / f"{robot}.png"
        if picture.is_file():
            files.append(File.generated(config, f"pictures/{robot}.png", abs_src_path=str(picture)))
    return files


def pages() -> dict[str, str]:
    """Returns the generated pages: path below docs/ and Markdown."""
    return {
        "reference/spec.md": spec_page(),
        "reference/commands.md": commands_page(),
        "reference/missions.md": missions_page(),
        "reference/keys.md": keys_page(),
    }


def spec_page() -> str:
    """Returns every field of a spec file: unit, meaning, default, from the JSON Schema."""
    from snakegen.spec.loading import schema

    found = json.loads(schema())
    lines = [
        "# Spec file",
        "",
        "A robot in YAML. `name` and `chain` are needed, all else has a default; a quantity that "
        "may be a list takes one value for all, or one for each link, joint or apparatus. "
        "`snakegen schema` prints this as JSON Schema for editors; `snakegen build --save-spec` "
        "writes a spec with its overrides.",
        "",
    ]
    lines += _fields("(top level)", found, found["$defs"])
    for name, part in found["$defs"].items():
        lines += _fields(name, part, found["$defs"])
    return "\n".join(lines)


def _fields(title: str, part: dict[str, Any], known: dict[str, Any]) -> list[str]:
    needed = part.get("required", [])
    lines = [f"## {title}", "", " ".join(part.get("description", "").split()), ""]
    lines += ["| field | what | type | default |", "|---|---|---|---|"]
    for field, value in part.get("properties", {}).items():
        default = "**needed**" if field in needed else _default(value, known)
        about = " ".join(value.get("description", "").split())
        lines.append(f"| `{field}` | {_cell(about)} | {_cell(_kind(value))} | {_cell(default)} |")
    return [*lines, ""]


def _default(value: dict[str, Any], known: dict[str, Any]) -> str:
    if "default" not in value:
        return ""
    if isinstance(value["default"], dict):
        kinds = [_kind(value)]
        return f"as {kinds[0]}"
    return f"`{json.dumps(value['default'], ensure_ascii=False)}`"


def _kind(value: dict[str, Any]) -> str:
    """Returns a field's type in words."""
    if "$ref" in value:
        name = value["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#{name.lower()})"
    if "anyOf" in value:
        kinds = [_kind(v) for v in value["anyOf"] if v.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "enum" in value:
        return ", ".join(f"`{v}`" for v in value["enum"])
    if "const" in value:
        return f"`{value['const']}`"
    if value.get("type") == "array":
        inner = value.get("items")
        return f"list of {_kind(inner)}" if isinstance(inner, dict) else "list"
    kind = {"number": "number", "integer": "whole number", "boolean": "true or false"}
    return kind.get(value.get("type", ""), str(value.get("type", "any"))) + _range(value)


def _range(value: dict[str, Any]) -> str:
    low = [f"≥ {value['minimum']:g}"] if "minimum" in value else []
    low += [f"> {value['exclusiveMinimum']:g}"] if "exclusiveMinimum" in value else []
    high = [f"≤ {value['maximum']:g}"] if "maximum" in value else []
    high += [f"< {value['exclusiveMaximum']:g}"] if "exclusiveMaximum" in value else []
    return f" ({', '.join(low + high)})" if low + high else ""


def commands_page() -> str:
    """Returns the help of every command."""
    import click

    from snakegen.cli import cli

    lines = ["# Commands", "", "What `--help` prints, for every command.", ""]
    root = click.Context(cli, info_name="snakegen")
    lines += ["## snakegen", "", *_help(cli, root)]
    for name in cli.list_commands(root):
        command = cli.get_command(root, name)
        context = click.Context(command, info_name=name, parent=root)
        lines += [f"## snakegen {name}", "", *_help(command, context)]
        if isinstance(command, click.Group):
            for child in command.list_commands(context):
                inner = command.get_command(context, child)
                below = click.Context(inner, info_name=child, parent=context)
                lines += [f"### snakegen {name} {child}", "", *_help(inner, below)]
    return "\n".join(lines)


def _help(command: Any, context: Any) -> list[str]:
    context.max_content_width = 110
    context.terminal_width = 110
    return ["```text", command.get_help(context), "```", ""]


def missions_page() -> str:
    """Returns every mission with its options, then what a log holds and what a verdict checks."""
    import ast
    import inspect

    import snakegen.simulation.missions as package
    from snakegen.simulation.missions import missions
    from snakegen.simulation.recording.recording import STANDARD

    folder = Path(inspect.getfile(package)).parent
    lines = [
        "# Missions and checks",
        "",
        "`snakegen missions ROBOT` lists those that suit a robot.",
        "",
    ]
    for name, about in missions().items():
        path = next(folder.glob(f"*/{name}.py"))
        tree = ast.parse(path.read_text(encoding="utf-8"))
        more = (ast.get_docstring(tree) or "").partition("\n")[2].strip()
        lines += [f"## {name}", "", about, "", more, ""]
        lines += _options(path)
    lines += [
        "## What a log holds", "",
        "Channels by name, as `snakegen.simulate(…)[name]` gives them.", "",
        "| channel | unit | what |", "|---|---|---|",
        *(f"| `{name}` | {s.unit} | {_cell(s.meaning)} |" for name, s in STANDARD.items()), "",
    ]  # fmt: skip
    return "\n".join(lines)


def _options(path: Path) -> list[str]:
    """Returns the table of a mission's options, read from its ``Options``."""
    from importlib import import_module

    from snakegen.simulation.missions.options import options_of

    module = import_module(f"snakegen.simulation.missions.{path.parent.name}.{path.stem}")
    known = options_of(module.Options)
    if not known:
        return []
    lines = ["| option | default | what |", "|---|---|---|"]
    for name, one in known.items():
        default = "" if one.default is None else f"`{one.default}`"
        about = f"set by {one.set_by}" if one.set_by else one.meaning
        lines.append(f"| `{name}` | {_cell(default)} | {_cell(about)} |")
    return [*lines, ""]


def keys_page() -> str:
    """Returns the keys of the analyses' JSON, from the reports of the presets."""
    from snakegen.analysis import catalogue

    found: dict[str, dict[str, Any]] = {}
    for robot in PICTURES:
        report = Path("generated") / robot / "report.json"
        for command, result in json.loads(report.read_text(encoding="utf-8")).items():
            if isinstance(result, dict):
                known = found.setdefault(command, {})
                for key, value in _leaves(result):
                    known.setdefault(key, value)
    lines = [
        "# Keys of JSON and Parquet",
        "",
        "With `--json` stdout holds JSON alone. A key ends in its unit; NaN and infinity become "
        "`null`; `…` stands for a name or a number of the robot's own. Margins are lower bounds, "
        "`bounds` holds both.",
        "",
    ]
    about = catalogue()
    for command, keys in found.items():
        said = about[command].help if command in about else ""
        lines += [f"## {command}", "", said, "", "| key | example |", "|---|---|"]
        lines += [f"| `{key}` | {_cell(_example(value))} |" for key, value in keys.items()]
        lines.append("")
    lines += [
        "## Columns of a sweep", "",
        "A column for each joint [rad], then:", "", "| column | unit | what |", "|---|---|---|",
        *(f"| `{name}` | {unit} | {text} |" for name, unit, text in COLUMNS), "",
        "Spec, seed, version and command stand in the metadata of the Parquet schema.", "",
    ]  # fmt: skip
    return "\n".join(lines)


COLUMNS = (
    ("wrench_margin", "1", "6-D margin, gimbals free, scaled; negative: hover is out of reach"),
    ("force_margin", "N", "force margin, gimbals free; the lower bound"),
    ("force_margin_upper", "N", "its upper bound"),
    ("torque_margin", "N·m", "torque margin, gimbals free; the lower bound"),
    ("torque_margin_upper", "N·m", "its upper bound"),
    ("closed", "–", "whether the bounds agree to the tolerance"),
    ("dual_attitude_altitude_margin", "1", "gimbals held: the ball of `[f_z; τ]`"),
    ("dual_wrench_margin", "1", "gimbals held: 6-D margin"),
    ("dual_force_margin", "N", "gimbals held: force margin"),
    ("dual_torque_margin", "N·m", "gimbals held: torque margin"),
    ("self_distance", "m", "least distance between rods and rotors that are no neighbours"),
    ("wrench_margin_upper", "1", "upper bound of the 6-D margin"),
)


def _leaves(value: Any, prefix: str = "") -> list[tuple[str, Any]]:
    """Returns (dotted key, value) of what is no mapping; numbered keys and names become `…`."""
    if not isinstance(value, dict):
        return [(prefix, value)]
    out = []
    for key, inner in value.items():
        name = "…" if any(c.isdigit() for c in str(key)) else str(key)
        out += _leaves(inner, f"{prefix}.{name}" if prefix else name)
    return out


def _example(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return f"`{text if len(text) <= 60 else text[:57] + '…'}`"


def _cell(text: str) -> str:
    return str(text).replace("|", "\\|").replace("\n", " ")
