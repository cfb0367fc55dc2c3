"""`snakegen adopt`: the modules file of a thrust-driven URDF, drafted."""

from pathlib import Path

import click

from snakegen.cli import HELP
from snakegen.cli.options import json_option, note, print_json


@click.command(context_settings=HELP)
@click.argument("file", metavar="FILE.urdf", type=click.Path())
@click.option(
    "-o", "--out", metavar="FILE", type=click.Path(), help="Modules file; stdout by default."
)
@json_option
def adopt(file: str, out: str | None, as_json: bool) -> None:
    """Draft the modules file of a URDF with rotors: rotors, axes, spins, gimbals, thrust limits.

    Every value has a comment with its reason; what is guessed is marked. docs/modules.md explains
    the file. `analyze` and `analyze flight` take it by --modules.

    \b
    Example:
      snakegen adopt drone.urdf -o modules.yaml
      snakegen analyze drone.urdf --modules modules.yaml
    """
    from snakegen.base.atomic_io import write_atomically
    from snakegen.robot.adoption.adopt import draft

    made = draft(file)
    if out is not None:
        write_atomically(Path(out), made.text)
    if as_json:
        extra = {} if out is None else {"file": out}
        print_json({"modules": made.data, "guesses": list(made.guesses)} | extra)
        return
    for guess in made.guesses:
        note(f"guess: {guess}")
    click.echo(made.text if out is None else out, nl=out is not None)
