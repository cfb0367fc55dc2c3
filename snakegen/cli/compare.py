"""`snakegen compare`: whether two files describe the same robot."""

from pathlib import Path

import click

from snakegen.cli import HELP
from snakegen.cli.options import json_option, note, print_json
from snakegen.errors import DescriptionError


@click.command(context_settings=HELP)
@click.argument("first", metavar="A", type=click.Path())
@click.argument("second", metavar="B", type=click.Path())
@click.option(
    "--map", "map_file", metavar="FILE", type=click.Path(), help="YAML: names in A: names in B."
)
@click.option("--modules", metavar="FILE", type=click.Path(), help="Modules file of a URDF.")
@click.option(
    "--tolerance",
    type=click.FloatRange(0.0, 1.0),
    default=1e-6,
    show_default=True,
    help="Relative error (rad for directions) above which a difference counts.",
)
@json_option
def compare(
    first: str,
    second: str,
    map_file: str | None,
    modules: str | None,
    tolerance: float,
    as_json: bool,
) -> int:
    """Tell whether two files, URDF or MJCF of any tool, describe the same robot.

    Compares mass, centre of mass, inertia, frames, axes, limits, actuators and names. Exit code 3
    where they differ; differences are listed with the largest first.

    \b
    Example:
      snakegen compare robot.urdf robot.xml
      snakegen compare mine.urdf theirs.xml --map names.yaml
    """
    from snakegen.pipeline.compare import compare as run

    names = None if map_file is None else _names(Path(map_file))
    found = run(first, second, names=names, modules=modules, tolerance=tolerance)
    if as_json:
        print_json({"a": first, "b": second} | found.to_json())
        return 0 if found.same else 3
    for text in found.notes:
        note(f"note: {text}")
    for text in found.differences:
        click.echo(text)
    count = len(found.differences)
    words = "the same robot" if found.same else f"{count} difference{'s' if count > 1 else ''}"
    click.echo(f"{first} and {second}: {words}")
    return 0 if found.same else 3


def _names(path: Path) -> dict[str, str]:
    """Reads a map of names.

    Raises:
        DescriptionError: no mapping of names to names.
    """
    from snakegen.base import yaml_file

    data = yaml_file.read(path)
    if not isinstance(data, dict) or not all(
        isinstance(k, str) and isinstance(v, str) for k, v in data.items()
    ):
        raise DescriptionError(f"{path.name}: a map has a name of A and its name in B, as a: b.")
    return data
