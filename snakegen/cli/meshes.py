"""Where the meshes of a robot are for a log or a page; those that no build made are made."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from snakegen.base.file_name import file_stem
from snakegen.cli.options import Source


def meshes_of(source: Source, robot: Any, beside: Path) -> Path:
    """Returns the folder from which the mesh paths of `robot` start, for a file at `beside`."""
    if robot.path is None and robot.modules.screws:
        return drum_folder(source.spec())
    return mesh_folder(robot, beside)


def mesh_folder(robot: Any, log: Path) -> Path:
    """Returns the folder from which the URDF's mesh paths start; makes the meshes if need be."""
    if robot.path is not None:
        return Path(robot.path).parent
    for folder in (log.parent, Path("generated") / file_stem(robot.name)):
        if (folder / "meshes").is_dir():
            return folder
    return _made()


def drum_folder(spec: Any) -> Path:
    """Makes the meshes of a spec with drums: those of an earlier build may have another helix."""
    return _made(spec)


def _made(spec: Any = None) -> Path:
    """Returns a folder with meshes that lasts as long as the command."""
    from snakegen.description.meshes.folder import write_robot_meshes

    folder = click.get_current_context().with_resource(TemporaryDirectory())
    return write_robot_meshes(Path(folder), spec)
