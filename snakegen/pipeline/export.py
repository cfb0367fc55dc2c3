"""`build --format`: a build as a ROS 2 package, a Menagerie folder or a USD stage."""

from __future__ import annotations

import tempfile
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from snakegen.base.atomic_io import folder_whole
from snakegen.errors import DescriptionError, near
from snakegen.pipeline.build import build
from snakegen.spec.loading import load_spec

FORMATS = ("ros2", "menagerie", "usd")


@dataclass(frozen=True)
class Export:
    """What was written.

    Attributes:
        folder: the package, or the folder.
        files: what is in it, relative.
        equivalence: figures of the check of MuJoCo against Pinocchio.
        lost: what the robot has that the format cannot carry.
        warnings: of the build.
    """

    folder: Path
    files: tuple[Path, ...]
    equivalence: Any
    lost: tuple[str, ...]
    warnings: tuple[str, ...]


def export(
    source: Any,
    kind: str,
    out_dir: str | Path | None = None,
    *,
    package: str | None = None,
    parts: Collection[str] = (),
    picture: bool = True,
) -> Export:
    """Builds a robot in a format that others take.

    Args:
        source: preset name, spec file, or RobotSpec.
        kind: one of `FORMATS`.
        out_dir: the folder to fill; ``generated/<package>`` (ros2) or ``generated/<name>_<kind>``.
        package: name of the ROS package; ``<name>_description`` by default.
        parts: of ros2: ``ros2_control``, ``gazebo``.
        picture: with a preview (menagerie).

    Raises:
        DescriptionError: an unknown format or part, a name that ROS does not take.
        GateError: the result is not the same robot.
    """
    from snakegen.pipeline.formats import ros2
    from snakegen.robot.robot import load

    if kind not in FORMATS:
        raise DescriptionError(f"format '{kind}' is not known.{near(kind, FORMATS)}")
    if kind != "ros2" and (package is not None or parts):
        raise DescriptionError("a package name and ros2_control or gazebo go with format ros2.")
    for part in parts:
        if part not in ros2.PARTS:
            raise DescriptionError(f"'{part}' is no part of a package.{near(part, ros2.PARTS)}")
    spec = load_spec(source)
    name = ros2.package_name(package, spec.name) if kind == "ros2" else f"{spec.name}_{kind}"
    target = Path(out_dir) if out_dir is not None else Path("generated") / name
    about = spec.about or f"{spec.name}, a snake-like robot."
    with tempfile.TemporaryDirectory() as scratch:
        built = build(spec, Path(scratch) / "built", picture=picture and kind == "menagerie")
        robot = load(built.urdf)
        equivalence, lost = built.equivalence, tuple[str, ...]()
        with folder_whole(target) as folder:
            if kind == "ros2":
                lost = ros2.write_package(built.urdf.parent, robot, folder, name, about, parts)
            elif kind == "menagerie":
                from snakegen.pipeline.formats.menagerie import write_folder

                equivalence = write_folder(built.urdf.parent, robot, folder, about)
            else:
                from snakegen.pipeline.formats.usd import write_stage

                lost = write_stage(robot, folder / f"{spec.name}.usda")
            files = tuple(sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file()))
    return Export(target, files, equivalence, lost, built.warnings)
