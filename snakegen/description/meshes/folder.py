"""The folder from which a robot's mesh paths start; meshes that no build made are made."""

from pathlib import Path
from typing import Any

from snakegen.description.meshes.parts import unit_meshes, write_meshes
from snakegen.description.meshes.screw_units import drum_meshes


def write_robot_meshes(folder: Path, spec: Any = None) -> Path:
    """Writes ``meshes/`` of a robot that was made in memory, and returns `folder`.

    Args:
        folder: to write into.
        spec: a RobotSpec, for the drums: unlike other parts they depend on it.
    """
    drums = {} if spec is None else drum_meshes(spec.resolved())
    write_meshes(folder / "meshes", unit_meshes() | drums)
    return folder
