"""`snakegen build`: URDF, MJCF and picture of a robot, proven to agree."""

from pathlib import Path
from typing import Any

import click

from snakegen.cli import HELP
from snakegen.cli.options import (
    Source,
    check_ending,
    json_option,
    note,
    print_json,
    rollers_option,
    spec_options,
)
from snakegen.errors import DescriptionError


@click.command(context_settings=HELP)
@click.option(
    "-o",
    "--out",
    metavar="DIR",
    type=click.Path(),
    help="Folder; generated/<robot> by default, <robot>-links6 and the like of a changed one.",
)
@rollers_option
@click.option(
    "--save-spec", metavar="FILE", type=click.Path(), help="Also save the spec as overridden."
)
@click.option("--picture/--no-picture", default=True, help="Render a PNG (default), or not.")
@click.option(
    "--mesh-uri", type=click.Choice(["relative", "package"]), default="relative",
    show_default=True, help="How the URDF names its meshes; package:// is for ROS.",
)  # fmt: skip
@click.option(
    "--format", "kind", type=click.Choice(["ros2", "menagerie", "usd"]),
    help="Make a ROS 2 package, a Menagerie folder or a USD stage instead.",
)  # fmt: skip
@click.option("--package", metavar="NAME", help="ros2: name; <robot>_description by default.")
@click.option(
    "--with", "parts", multiple=True, type=click.Choice(["ros2_control", "gazebo"]),
    help="ros2: also write these elements; may be repeated.",
)  # fmt: skip
@json_option
@spec_options
def build(
    source: Source,
    out: str | None,
    rollers: str | None,
    save_spec: str | None,
    picture: bool,
    mesh_uri: str,
    kind: str | None,
    package: str | None,
    parts: tuple[str, ...],
    as_json: bool,
) -> None:
    """Make URDF, MJCF, scene and picture of ROBOT, and prove that URDF and MJCF agree.

    \b
    Example:
      snakegen build dragon4
      snakegen build dragon4 --links 6 --apparatus 1,3,5@0.3 -o out/six --save-spec six.yaml
      snakegen build screw4 --links 6 --rollers ring_sphere
      snakegen build dragon4 --set vectoring_apparatus.thrust_max=20
      snakegen build dragon4 --format ros2 --with ros2_control
    """
    from snakegen.pipeline.build import build as run
    from snakegen.spec.loading import save

    check_ending("--save-spec", save_spec, ".yaml", ".yml")
    spec = source.rolling_on(rollers).spec()
    if save_spec and kind:
        save(spec, Path(save_spec))
    if kind:
        how = {"package": package, "parts": parts, "picture": picture}
        _export(spec, kind, out, as_json, **how)
        return
    if package is not None or parts:
        raise DescriptionError("--package and --with go with --format ros2.")
    made = run(spec, out, picture=picture, mesh_uri=mesh_uri)
    if save_spec:
        save(spec, Path(save_spec))
    for warning in made.warnings:
        note(f"warning: {warning}")
    if made.picture_note:
        note(made.picture_note)
    if as_json:
        files = {"urdf": made.urdf, "mjcf": made.mjcf, "scene": made.scene, "spec": made.spec}
        out_files = {k: str(v) for k, v in files.items()}
        out_files |= {"picture": str(made.picture)} if made.picture else {}
        print_json(out_files | {"equivalence": made.equivalence.to_json()})
        return
    for path in (made.urdf, made.mjcf, made.scene, made.spec, made.picture):
        if path is not None:
            click.echo(str(path))
    click.echo(_agreement(made.equivalence))


def _agreement(e: Any) -> str:
    return (
        f"URDF and MJCF agree: worst error {e.worst:.1e} over {e.states} random states "
        f"(MuJoCo against {e.oracle})"
    )


def _export(spec: Any, kind: str, out: str | None, as_json: bool, **how: Any) -> None:
    """Writes another format and prints what came of it."""
    from snakegen.pipeline.export import export

    made = export(spec, kind, out, **how)
    for warning in made.warnings:
        note(f"warning: {warning}")
    if as_json:
        files = [str(made.folder / file) for file in made.files]
        made_files = {"format": kind, "folder": str(made.folder), "files": files}
        print_json(made_files | {"lost": made.lost, "equivalence": made.equivalence.to_json()})
        return
    for file in made.files:
        click.echo(str(made.folder / file))
    for what in made.lost:
        click.echo(f"not carried: {what}")
    click.echo(_agreement(made.equivalence))
