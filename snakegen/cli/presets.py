"""`snakegen presets` and `snakegen schema`: what there is, and what a spec may say."""

import click

from snakegen.cli import HELP
from snakegen.cli.options import json_option, print_json


@click.command(context_settings=HELP)
@json_option
def presets(as_json: bool) -> None:
    """List the presets, one line each.

    \b
    Example:
      snakegen presets
    """
    from snakegen.spec.loading import load_spec
    from snakegen.spec.loading import presets as known

    about = {name: load_spec(name).about for name in known()}
    if as_json:
        print_json(about)
        return
    width = max(map(len, about))
    for name, text in about.items():
        click.echo(f"{name:<{width}}  {text}")


@click.command(context_settings=HELP)
@click.option("--modules", is_flag=True, help="Of a modules file instead (docs/modules.md).")
def schema(modules: bool) -> None:
    """Print the JSON Schema of a spec file, for editors.

    \b
    Example:
      snakegen schema > snakegen.schema.json
      snakegen schema --modules > modules.schema.json
    """
    if modules:
        from snakegen.robot.modules_schema import schema_text

        click.echo(schema_text())
        return
    from snakegen.spec.loading import schema as text

    click.echo(text())
