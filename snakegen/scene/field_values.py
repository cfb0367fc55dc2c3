"""Values of a scene file's fields, checked: vectors, numbers, files, names."""

from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.bounded_text import what_is_there
from snakegen.base.geometry import Floats
from snakegen.errors import SceneError, near


def check_names(item: dict[str, Any], names: tuple[str, ...], where: str) -> None:
    """Raises SceneError where a mapping has a field that is not among `names`."""
    for key in item:
        if key not in names:
            raise SceneError(f"{where} has no field '{key}'.{near(str(key), names)}")


def existing_file(item: dict[str, Any], where: str, folder: Path) -> Path:
    """Returns the path in `file`, from the scene's folder."""
    if not isinstance(item.get("file"), str):
        raise SceneError(f"{where}: file: the name of a file is needed.")
    path = folder / item["file"]
    if not path.is_file():
        raise SceneError(f"{where}: file: {item['file']}: {what_is_there(path)}.")
    return path


def vector(
    item: dict[str, Any], key: str, where: str, count: int = 3, default: Any = None
) -> Floats:
    """Returns a field of `count` numbers, or its default."""
    if key not in item and default is not None:
        return np.array(default, float)
    return numbers(item.get(key), f"{where}: {key}", count)


def numbers(value: Any, where: str, count: int = 3) -> Floats:
    """Returns a list of `count` finite numbers as an array."""
    good = isinstance(value, list) and len(value) == count
    good = good and all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
    if not good or not np.all(np.isfinite(np.array(value, float))):
        raise SceneError(f"{where}: {count} finite numbers are needed, not {value!r}.")
    return np.array(value, float)


def positive(
    item: dict[str, Any], key: str, where: str, default: float | None = None, zero: bool = False
) -> float:
    """Returns a field above 0 (or 0, where `zero`), or its default."""
    if key not in item and default is not None:
        return default
    number = float(numbers([item.get(key)], f"{where}: {key}", 1)[0])
    if number < 0.0 or (number == 0.0 and not zero):
        raise SceneError(f"{where}: {key}: {number:g} must be above 0.")
    return number
