"""`snakegen convert`: a URDF of any origin to MJCF, proven to be the same robot."""

import click

from snakegen.cli import HELP
from snakegen.cli.options import json_option, note, print_json


@click.command(context_settings=HELP)
@click.argument("file", metavar="FILE.urdf", type=click.Path())
@click.option(
    "-o", "--out", metavar="DIR", type=click.Path(), help="Folder; <robot>_mjcf by default."
)
@click.option(
    "--modules", metavar="FILE", type=click.Path(), help="YAML file: rotors, gimbals, free base."
)
@json_option
def convert(file: str, out: str | None, modules: str | None, as_json: bool) -> None:
    """Convert a URDF into MJCF and a scene, and prove that the two are one robot.

    Exit code 3 where MuJoCo and Pinocchio disagree.

    \b
    Example:
      snakegen convert robot.urdf -o robot_mjcf
      snakegen convert drone.urdf --modules modules.yaml
    """
    from snakegen.pipeline.convert import convert as run

    made = run(file, out, modules=modules)
    for warning in made.warnings:
        note(f"warning: {warning}")
    files = {"urdf": str(made.urdf), "mjcf": str(made.mjcf), "scene": str(made.scene)}
    if as_json:
        extra = {"equivalence": made.equivalence.to_json(), "warnings": list(made.warnings)}
        print_json(files | extra)
        return
    for path in files.values():
        click.echo(path)
    e = made.equivalence
    click.echo(
        f"URDF and MJCF agree: worst error {e.worst:.1e} over {e.states} random states "
        f"(MuJoCo against {e.oracle})"
    )
