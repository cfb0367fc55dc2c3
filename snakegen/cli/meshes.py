"""Where the meshes of a robot are for a log or a page; those that no build made are made.

A process of its own makes them, beside the flight: what draws meshes takes 70 MB and half a second
to import.
"""

import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from snakegen.base.file_name import file_stem
from snakegen.cli.options import Source
from snakegen.errors import SnakegenError

_MAKE = (
    "import pickle, sys; from pathlib import Path; "
    "from snakegen.description.meshes.folder import write_robot_meshes; "
    "write_robot_meshes(Path(sys.argv[1]), pickle.load(sys.stdin.buffer))"
)


class MeshFolder:
    """The folder from which mesh paths start, perhaps still being filled."""

    def __init__(self, folder: Path, maker: "subprocess.Popen[bytes] | None" = None) -> None:
        self._folder, self._maker = folder, maker

    def path(self) -> Path:
        """Returns the folder once it is filled.

        Raises:
            SnakegenError: its meshes could not be made.
        """
        if self._maker is not None:
            _, said = self._maker.communicate()
            code, self._maker = self._maker.returncode, None
            if code:
                last = (said.decode(errors="replace").strip().splitlines() or ["no reason"])[-1]
                raise SnakegenError(f"the meshes of the robot could not be made ({last}).")
        return self._folder

    def stop(self) -> None:
        """Ends the process that fills it, if it still runs."""
        if self._maker is not None:
            self._maker.kill()
            self._maker.communicate()
            self._maker = None


def meshes_of(source: Source, robot: Any, beside: Path) -> MeshFolder:
    """Returns the folder from which the mesh paths of `robot` start, for a file at `beside`."""
    if robot.path is None and robot.modules.screws:
        return _made(source.spec())  # those of an earlier build may have drums of another helix
    return mesh_folder(robot, beside)


def mesh_folder(robot: Any, log: Path) -> MeshFolder:
    """Returns the folder from which the URDF's mesh paths start; makes the meshes if need be."""
    if robot.path is not None:
        return MeshFolder(Path(robot.path).parent)
    for folder in (log.parent, Path("generated") / file_stem(robot.name)):
        if (folder / "meshes").is_dir():
            return MeshFolder(folder)
    return _made()


def _made(spec: Any = None) -> MeshFolder:
    """Returns a folder with meshes that lasts as long as the command."""
    context = click.get_current_context()
    folder = Path(context.with_resource(TemporaryDirectory()))
    maker = subprocess.Popen(
        [sys.executable, "-P", "-c", _MAKE, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,  # a Ctrl-C ends the flight, whose log still needs the meshes
    )
    with suppress(OSError), maker.stdin as pipe:  # type: ignore[union-attr]
        pickle.dump(spec, pipe)
    maker.stdin = None
    found = MeshFolder(folder, maker)
    context.call_on_close(found.stop)
    return found
