"""`snakegen build`: URDF, MJCF and picture of a robot, proven to agree."""

from pathlib import Path

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


@click.command(context_settings=HELP)
@click.option(
    "-o", "--out", metavar="DIR", type=click.Path(), help="Folder; generated/<robot> by default."
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
@json_option
@spec_options
def build(
    source: Source,
    out: str | None,
    rollers: str | None,
    save_spec: str | None,
    picture: bool,
    mesh_uri: str,
    as_json: bool,
) -> None:
    """Make URDF, MJCF, scene and picture of ROBOT, and prove that URDF and MJCF agree.

    \b
    Example:
      snakegen build dragon4
      snakegen build dragon4 --links 6 --apparatus 1,3,5@0.3 -o out/six --save-spec six.yaml
      snakegen build screw4 --links 6 --rollers ring_sphere
      snakegen build dragon4 --set vectoring_apparatus.thrust_max=20
    """
    from snakegen.pipeline.build import build as run
    from snakegen.spec.loading import save

    check_ending("--save-spec", save_spec, ".yaml", ".yml")
    spec = source.rolling_on(rollers).spec()
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
    e = made.equivalence
    click.echo(
        f"URDF and MJCF agree: worst error {e.worst:.1e} over {e.states} random states "
        f"(MuJoCo against {e.oracle})"
    )
