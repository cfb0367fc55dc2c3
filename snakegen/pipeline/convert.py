"""From a URDF of any origin to a folder with URDF, meshes, MJCF and scene that provably agree."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from snakegen.base.atomic_io import folder_whole
from snakegen.base.file_name import file_stem
from snakegen.errors import DescriptionError
from snakegen.robot.robot import Robot, load


@dataclass(frozen=True, repr=False)
class Conversion:
    """What a conversion wrote.

    Attributes:
        urdf: the URDF with mesh paths relative to it.
        mjcf: the MJCF derived from it.
        scene: the MJCF on a floor.
        equivalence: figures of the check of MuJoCo against Pinocchio.
        warnings: shapes left out, findings of the linter, bodies that start in contact.
    """

    urdf: Path
    mjcf: Path
    scene: Path
    equivalence: Any
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        """Returns where the files are."""
        names = (self.urdf.name, self.mjcf.name, self.scene.name)
        return f"Conversion({self.urdf.parent}: {', '.join(names)})"


def convert(
    urdf: str | Path, out_dir: str | Path | None = None, *, modules: str | Path | None = None
) -> Conversion:
    """Converts a URDF into MJCF, with the equivalence check of a build.

    Names, inertias, frames, limits, damping and friction are kept; mimic joints become equality
    constraints; joints with an effort limit get a motor, those of a modules file their servos.

    Args:
        urdf: a URDF file.
        out_dir: the folder to fill; ``<name>_mjcf`` beside the current folder by default.
        modules: a modules file: rotors, gimbals, a floating base.

    Raises:
        GateError: MuJoCo and Pinocchio disagree by more than 1e-9.
        DescriptionError: no URDF, or one with errors; a mesh too large to read; a folder in which
            the URDF, a mesh or the modules file would be overwritten.
    """
    from snakegen.linter.lint import lint

    path = Path(urdf)
    robot = load(path, modules=modules)
    if robot.path is None:
        raise DescriptionError(f"{urdf}: convert reads a URDF file; build makes one of a spec.")
    found = [str(f) for f in lint(robot.urdf, folder=robot.folder) if f.severity == "warning"]
    name = _stem(robot)
    target = Path(out_dir) if out_dir is not None else Path(f"{name}_mjcf")
    with folder_whole(target) as folder:
        result, noted, meshes = _write(robot, folder)
        given = (path, *meshes)
        if isinstance(modules, str | Path):
            given = (*given, Path(modules))
        _refuse_overwriting(given, folder, target)
    return Conversion(
        target / f"{name}.urdf",
        target / f"{name}.xml",
        target / "scene.xml",
        result,
        (*found, *noted),
    )


def _stem(robot: Robot) -> str:
    """Returns the name of the files, which is not that of the scene."""
    name = file_stem(robot.name)
    return f"{name}_robot" if name.lower() == "scene" else name


def _refuse_overwriting(given: Iterable[Path], made: Path, target: Path) -> None:
    """Refuses to put a file of the folder `made` over one that was read, in `target`.

    Raises:
        DescriptionError: names the file.
    """
    written = {(target / p.relative_to(made)).resolve() for p in made.rglob("*") if p.is_file()}
    for path in given:
        if path.resolve() in written:
            raise DescriptionError(
                f"{target}: {path} would be overwritten, which is read; choose another folder."
            )


def _write(robot: Robot, folder: Path) -> tuple[Any, tuple[str, ...], tuple[Path, ...]]:
    """Writes the files; returns figures of the check, what a user should know, meshes read."""
    import mujoco

    from snakegen.description.mjcf.base_mount import floor_height, supports
    from snakegen.description.mjcf.decorate import decorate, scene
    from snakegen.description.mjcf.files import load_model, write
    from snakegen.description.mjcf.urdf_import import importable
    from snakegen.pipeline.build import refuse_differences
    from snakegen.pipeline.equivalence import compare
    from snakegen.pipeline.start_contacts import contact_warnings
    from snakegen.robot.arrays import base_link
    from snakegen.robot.floating_root import without_floating_root
    from snakegen.spec.urdf import read_urdf

    name, modules = _stem(robot), robot.modules
    ready = importable(robot.urdf, robot.folder)
    for file, content in ready.assets.items():
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).write_bytes(content)
    text = ready.text
    if robot.path is not None and without_floating_root(given := read_urdf(robot.path))[1]:
        text = importable(given, robot.folder).text  # the joint that holds the root stays
    (folder / f"{name}.urdf").write_text(text, encoding="utf-8")
    spec = decorate(ready.text, modules, ready.assets, folder=folder)
    motors = motor_joints(robot)
    add_motors(spec, robot, motors)
    path, scenery = folder / f"{name}.xml", folder / "scene.xml"
    write(spec, path)
    try:
        model = load_model(path)
        held = supports(model, modules, base_link(robot))
        floor = floor_height(model, modules)
        scenery.write_text(scene(path.name, name, floor, held), encoding="utf-8")
        touching = contact_warnings(load_model(scenery))
    except (ValueError, mujoco.FatalError) as error:
        raise DescriptionError(f"{path.name}: MuJoCo cannot load it ({error}).") from None
    result = compare(robot, model, motors=motors)
    refuse_differences(name, result)
    noted = (*(f"left out: {text}" for text in ready.dropped), *touching)
    return result, noted, ready.sources


def motor_joints(robot: Robot) -> tuple[str, ...]:
    """Returns the joints that get a motor: undriven, with an effort limit, no followers."""
    followers = {
        str(joint.get("name"))
        for joint in ET.fromstring(robot.urdf).iterfind("joint")
        if joint.find("mimic") is not None
    }
    shafts = {robot.joint_names[b - 1] for b in robot.spinners}
    driven = {s.joint for s in robot.modules.servos} | {s.joint for s in robot.modules.screws}
    names = [n for n in robot.joint_names if n not in followers | shafts | driven]
    effort = robot.limits(names)[2]
    return tuple(n for n, most in zip(names, effort, strict=True) if 0.0 < most < 1e30)


def add_motors(spec: Any, robot: Robot, names: tuple[str, ...]) -> None:
    """Adds a motor to each of the joints `names`, its command limited by the joint's effort."""
    import mujoco

    effort = robot.limits(names)[2]
    for name, most in zip(names, effort, strict=True):
        spec.add_actuator(
            name=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=name,
            ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            ctrlrange=[-float(most), float(most)],
        )
