"""A folder as MuJoCo Menagerie has them: model, scene, assets/, README, LICENSE, picture."""

from __future__ import annotations

import shutil
import warnings
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import mujoco

from snakegen import __version__
from snakegen.description.mjcf.files import load_model
from snakegen.errors import DescriptionError
from snakegen.pipeline.formats.filled import fill
from snakegen.robot.robot import Robot
from snakegen.spec.loading import templates_folder


def write_folder(built: Path, robot: Robot, folder: Path, about: str) -> Any:
    """Writes the folder of a build; returns the equivalence check of the model in it.

    Raises:
        DescriptionError: MuJoCo cannot load what was written, or warns of it.
    """
    from snakegen.pipeline.build import refuse_differences
    from snakegen.pipeline.equivalence import compare

    name = robot.name
    for file in built.glob("*.xml"):  # a deep chain goes on in files of its own
        if file.name != "scene.xml":
            root = ET.fromstring(file.read_text(encoding="utf-8"))
            _rearrange(root)
            ET.indent(root)
            text = ET.tostring(root, encoding="unicode") + "\n"
            (folder / file.name).write_text(text, encoding="utf-8")
    if (built / "meshes").is_dir():
        shutil.copytree(built / "meshes", folder / "assets")
    shutil.copyfile(built / "scene.xml", folder / "scene.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            load_model(folder / "scene.xml")
            model = load_model(folder / f"{name}.xml")
        except (ValueError, mujoco.FatalError, RuntimeWarning) as error:
            raise DescriptionError(f"menagerie folder of {name}: {error}") from None
    result = compare(robot, model)
    refuse_differences(name, result)
    picture = built / f"{name}.png"
    if picture.is_file():
        shutil.copyfile(picture, folder / picture.name)
    title = name.replace("_", " ")
    values = {"name": name, "title": title, "about": about, "version": __version__}
    fill("menagerie/README.md", folder / "README.md", **values, worst=f"{result.worst:.1e}")
    fill("menagerie/CHANGELOG.md", folder / "CHANGELOG.md", title=title)
    shutil.copyfile(templates_folder() / "formats" / "LICENSE", folder / "LICENSE")
    return result


def _rearrange(root: ET.Element) -> None:
    """Looks for meshes in assets/, and names every geom: its body, what it is for, a number."""
    compiler = root.find("compiler")
    if compiler is None:
        compiler = ET.SubElement(root, "compiler")
    compiler.set("meshdir", "assets")
    for mesh in root.iter("mesh"):
        if mesh.get("file"):
            mesh.set("file", Path(mesh.get("file", "")).name)
    for body in root.iter("body"):
        counts: dict[str, int] = {}
        for geom in body.findall("geom"):
            if geom.get("name") is None:
                kind = geom.get("class", "geom")
                counts[kind] = counts.get(kind, 0) + 1
                geom.set("name", f"{body.get('name')}_{kind}{counts[kind]}")
