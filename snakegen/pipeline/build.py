"""`build`: from a spec to a folder with URDF, MJCF, scene, meshes, picture and the proof.

The folder changes whole or not at all: everything is made next to it and renamed.
"""

import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from snakegen.base import yaml_file
from snakegen.base.atomic_io import folder_whole
from snakegen.errors import DescriptionError, SnakegenError, SpecError
from snakegen.spec.loading import load_spec
from snakegen.spec.robot_spec import RobotSpec

MOST_JOINTS = 3000  # moving ones of a robot that is built, so that it takes some two minutes
DEEPEST = 1023  # links in a row; MuJoCo compiles no body deeper in its tree
_MOVING = re.compile(r'<joint [^>]*type="(?:revolute|continuous|prismatic)"')


class GateError(SnakegenError):
    """URDF and MJCF disagree: the equivalence check failed."""

    exit_code = 3


@dataclass(frozen=True, repr=False)
class Build:
    """What a build wrote.

    Attributes:
        urdf: the URDF, the single source of truth.
        mjcf: the MJCF derived from it.
        scene: the MJCF on a floor.
        spec: the resolved spec.
        picture: a rendered PNG, None if not asked for.
        picture_note: why the picture is a drawing and not a rendering, empty if it is one.
        equivalence: figures of the check of MuJoCo against Pinocchio.
        warnings: of the spec and the lint.
    """

    urdf: Path
    mjcf: Path
    scene: Path
    spec: Path
    picture: Path | None
    picture_note: str
    equivalence: Any
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        """Returns where the files are."""
        return f"Build({self.urdf.parent}: {self.urdf.name}, {self.mjcf.name}, {self.scene.name})"


def build(
    source: str | Path | RobotSpec,
    out_dir: str | Path | None = None,
    *,
    picture: bool = True,
    mesh_uri: str = "relative",
) -> Build:
    """Builds a robot into `out_dir` (default ``generated/<name>``, or ``<name>-links6`` and
    the like of a changed spec, under the current folder).

    Args:
        source: preset name, spec file, or RobotSpec.
        out_dir: the folder to fill; files that a build does not make stay in it.
        picture: also render ``<name>.png``.
        mesh_uri: ``relative``, or ``package`` for ``package://<name>/meshes/…`` in the URDF.

    Raises:
        GateError: MuJoCo and Pinocchio disagree by more than 1e-9.
        SnakegenError: a mistake in the spec, or a folder that cannot be written.
    """
    from snakegen.description.meshes import parts
    from snakegen.description.meshes.screw_units import drum_meshes
    from snakegen.linter import lint
    from snakegen.spec.warnings import warnings

    spec = load_spec(source)
    if spec.name.lower() == "scene":
        raise SpecError(f"name: '{spec.name}' is the name of the scene's file; choose another.")
    target = Path(out_dir) if out_dir is not None else Path("generated") / spec.variant
    with folder_whole(target) as folder:
        spec_path = folder / f"{spec.name}.spec.yaml"
        resolved = spec.resolved()
        spec_path.write_text(yaml_file.dump(resolved), encoding="utf-8")
        urdf_path, text = _write_urdf(spec_path, spec.name, mesh_uri)
        refuse_many_joints(text, spec.name)
        refuse_deep_chains(text, spec.name)
        made = parts.write_meshes(folder / "meshes", _needed(parts.unit_meshes(), text))
        made |= parts.write_meshes(folder / "meshes", drum_meshes(resolved))
        made |= _payload_mesh(spec, folder)
        found = lint.lint(text, folder=folder, quick=True)
        lint.refuse(found, urdf_path.name)
        equivalence, touching = _write_mjcf(folder, spec.name, text, made)
        png, note = (None, "")
        if picture:
            png = folder / f"{spec.name}.png"
            note = _write_picture(folder, spec.name, text, png)
    return Build(
        target / urdf_path.name,
        target / f"{spec.name}.xml",
        target / "scene.xml",
        target / spec_path.name,
        target / png.name if png else None,
        note,
        equivalence,
        (*warnings(spec), *(str(f) for f in found if f.severity == "warning"), *touching),
    )


def refuse_many_joints(text: str, name: str) -> None:
    """Refuses a URDF of more moving joints than a build has time for.

    Raises:
        SpecError: with their number and what would do.
    """
    count = len(_MOVING.findall(text))
    if count > MOST_JOINTS:
        raise SpecError(
            f"{name}: {count:,} moving joints; up to {MOST_JOINTS:,} are built, since MuJoCo takes "
            "minutes for more (the time grows with their cube). Fewer links, gimbals or wheels "
            "would do."
        )


def refuse_deep_chains(text: str, name: str) -> None:
    """Refuses a URDF with more links in a row than MuJoCo compiles.

    Raises:
        SpecError: with their number and what would do.
    """
    parent = {
        joint.find("child").get("link"): joint.find("parent").get("link")  # type: ignore[union-attr]
        for joint in ET.fromstring(text).iterfind("joint")
    }
    depth: dict[str | None, int] = {}
    for link in parent:
        row: list[str | None] = []
        at: str | None = link
        while at in parent and at not in depth:
            row.append(at)
            at = parent[at]
        below = depth.get(at, 1)
        for k, one in enumerate(reversed(row), start=1):
            depth[one] = below + k
    deepest = max(depth.values(), default=1)
    if deepest > DEEPEST:
        raise SpecError(
            f"{name}: {deepest:,} links in a row (crosses of two-axis joints count); MuJoCo takes "
            f"up to {DEEPEST:,}. Fewer links, or joints of one axis, would do."
        )


def _write_urdf(spec_path: Path, name: str, mesh_uri: str) -> tuple[Path, str]:
    """Writes the URDF; returns its path and the text with relative mesh paths."""
    from snakegen.spec.urdf import expand

    path = spec_path.with_name(f"{name}.urdf")
    text = expand(spec_path)
    if mesh_uri == "package":
        path.write_text(expand(spec_path, f"package://{name}/meshes/"), encoding="utf-8")
    elif mesh_uri == "relative":
        path.write_text(text, encoding="utf-8")
    else:
        raise DescriptionError(f"mesh_uri '{mesh_uri}' is not known; 'relative' or 'package'.")
    return path, text


def _payload_mesh(spec: RobotSpec, folder: Path) -> dict[str, Path]:
    """Copies the mesh that the payload names into the build; returns it by name."""
    from snakegen.spec.payload import locate, target

    if spec.payload is None or spec.payload.mesh is None:
        return {}
    copy = folder / target(spec.payload.mesh)
    copy.parent.mkdir(exist_ok=True)
    copy.write_bytes(locate(spec.payload.mesh, spec.folder).read_bytes())
    return {copy.stem: copy}


def _needed(all_meshes: dict[str, Any], text: str) -> dict[str, Any]:
    return {name: mesh for name, mesh in all_meshes.items() if f"/{name}.stl" in text}


def _write_mjcf(
    folder: Path, name: str, text: str, made: dict[str, Path]
) -> tuple[Any, tuple[str, ...]]:
    """Writes MJCF and scene, and proves that MuJoCo and Pinocchio agree.

    Returns the figures of that, and a line for each pair of bodies that starts in contact.
    """
    import mujoco

    from snakegen.description.mjcf.base_mount import floor_height, supports
    from snakegen.description.mjcf.decorate import decorate, scene
    from snakegen.description.mjcf.files import load_model, write
    from snakegen.pipeline.equivalence import compare
    from snakegen.pipeline.start_contacts import contact_warnings
    from snakegen.robot.arrays import base_link
    from snakegen.robot.robot import from_urdf_text

    robot = from_urdf_text(text, None, checked=True)
    assets = {f"meshes/{p.name}": p.read_bytes() for p in made.values()}
    path, scenery = folder / f"{name}.xml", folder / "scene.xml"
    full = decorate(text, robot.modules, assets, rollers=_bodily(robot.modules))
    write(full, path)
    try:
        model = load_model(path)
        held = supports(model, robot.modules, base_link(robot))
        floor = floor_height(model, robot.modules)
        scenery.write_text(scene(path.name, name, floor, held), encoding="utf-8")
        touching = contact_warnings(load_model(scenery))
    except (ValueError, mujoco.FatalError) as error:
        raise DescriptionError(f"{path.name}: MuJoCo cannot load it ({error}).") from None
    result = compare(robot, model, rollers=_bodily(robot.modules))
    refuse_differences(name, result)
    if _bodily(robot.modules) is not None:  # bodies are compared on the wheels; balls are kept
        write(decorate(text, robot.modules, assets), path)
        refuse_differences(name, compare(robot, load_model(path)))
    return result, touching


def refuse_differences(name: str, result: Any) -> None:
    """Raises where the equivalence check found URDF and MJCF to differ.

    Raises:
        GateError: names what differs and by how much.
    """
    from snakegen.pipeline.equivalence import BOUND

    if not result.passed:
        raise GateError(
            f"{name}: URDF and MJCF disagree by {result.worst:.2e}, more than {BOUND:g}: {result}."
        )


def _bodily(modules: Any) -> str | None:
    """Returns the rollers of the full-body variant where a robot's own are in its MJCF alone."""
    surrogate = any(screw.rollers == "ball" for screw in modules.screws)
    return "ring_sphere" if surrogate else None


def _write_picture(folder: Path, name: str, text: str, png: Path) -> str:
    """Renders the robot, or draws it where no GL is to be had; returns the note for the latter."""
    from snakegen.picture.robot_picture import robot_picture
    from snakegen.robot.robot import from_urdf_text

    return robot_picture(from_urdf_text(text, None, checked=True), folder / "scene.xml", png)
