"""URDF from a resolved spec: runs the xacro templates, and replaces xacro's banner.

The text after the four banner lines is what stock xacro gives for the same spec file.
"""

import importlib
import re
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

from snakegen.base import yaml_file
from snakegen.errors import DescriptionError
from snakegen.linter.xml_text import conforming, read_xml
from snakegen.linter.xml_tree import short_of_comments
from snakegen.spec.loading import load_spec, templates_folder
from snakegen.spec.xacro_speed import one_step_replacement

MAX_BYTES = 100_000_000  # some 15,000 links
KEPT = 32  # expansions
_BANNER = re.compile(r"(?:<!-- (?:=+|\|.*?\|) -->\n){4}")
_OURS = "<!-- Made by snakegen from {spec}; stock xacro gives the same from templates/. -->\n"


def expand(spec_path: Path, mesh_prefix: str = "meshes/") -> str:
    """Returns the URDF text of the resolved spec at `spec_path`.

    Args:
        spec_path: a file that `RobotSpec.resolved` made: nothing in it is left to evaluate.
        mesh_prefix: what stands before every mesh's file name.

    Raises:
        DescriptionError: the templates do not expand, with xacro's own sentence.
    """
    return _expanded(spec_path.read_text(encoding="utf-8"), spec_path.name, mesh_prefix, _stamps())


def urdf_text(source: Any) -> str:
    """Returns the URDF text of a preset name, spec file or RobotSpec, without writing files."""
    spec = load_spec(source)
    text = yaml_file.dump(spec.resolved())
    return _expanded(text, f"{spec.name}.spec.yaml", "meshes/", _stamps())


def _stamps() -> tuple[tuple[str, int], ...]:
    """Returns path and time of every template: expansions of an edited one are made anew."""
    files = sorted(templates_folder().rglob("*.xacro"))
    return tuple((str(file), file.stat().st_mtime_ns) for file in files)


@lru_cache(maxsize=KEPT)
def _expanded(text: str, name: str, mesh_prefix: str, stamps: tuple[tuple[str, int], ...]) -> str:
    """Expands a resolved spec's text, which is called `name`; 0.1 s, so the latest are kept."""
    import xacro

    yaml_file.refuse_executable(text, name)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(text, encoding="utf-8")
        mappings = {"spec": str(path.resolve()), "mesh_prefix": mesh_prefix}
        try:
            with one_step_replacement():
                template = templates_folder() / "snake.urdf.xacro"
                document = xacro.process_file(str(template), mappings=mappings)
        except Exception as error:
            reason = str(error)
            importlib.reload(xacro)  # a failure leaves xacro's module state half-way
            raise DescriptionError(f"{name}: the templates do not expand: {reason}") from None
    return _BANNER.sub(_OURS.format(spec=name), document.toprettyxml(indent="  "), count=1)


def is_description(source: str | Path) -> bool:
    """Tells whether a robot is named by a URDF: by the file's ending, else by its first letter."""
    path = Path(source)
    if path.suffix.lower() in (".urdf", ".xml", ".xacro"):
        return True
    if path.suffix.lower() in (".yaml", ".yml") or not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return file.read(200).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
    except OSError:
        return False


def read_urdf(path: Path) -> str:
    """Returns the text of a URDF file.

    Raises:
        DescriptionError: no such file, no text, or larger than `MAX_BYTES`.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise DescriptionError(
                f"{path}: {size / 1e6:.4g} MB; up to {MAX_BYTES / 1e6:g} MB are read."
            )
        text = short_of_comments(read_xml(path, MAX_BYTES)[0].removeprefix("\ufeff"))
        body = text.lstrip()  # a blank before the declaration is common, and no XML
        return conforming(body if body.startswith("<?xml") else text)
    except FileNotFoundError:
        raise DescriptionError(f"{path}: no such file.") from None
    except IsADirectoryError:
        raise DescriptionError(f"{path}: is a folder.") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DescriptionError(f"{path}: cannot be read ({reason}).") from None
