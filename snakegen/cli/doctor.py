"""`snakegen doctor`: what of this machine snakegen can use, and what to install for the rest."""

import click

from snakegen.cli import HELP
from snakegen.cli.options import json_option, print_json


@click.command(context_settings=HELP)
@json_option
def doctor(as_json: bool) -> int:
    """Check this installation: packages, rendering, viewer, kernel cache, extras.

    Exit code 3 when something is missing that a command needs in every case.

    \b
    Example:
      snakegen doctor
    """
    from snakegen.cli.diagnosis import examine

    found = examine()
    if as_json:
        print_json({"checks": [f.to_json() for f in found], "passed": all(f.fine for f in found)})
    else:
        wide = max(len(f.name) for f in found)
        for f in found:
            click.echo(f"{f.status:<8}  {f.name:<{wide}}  {f.detail}")
            if f.remedy:
                click.echo(f"{'':<8}  {'':<{wide}}  → {f.remedy}")
    return 0 if all(f.fine for f in found) else 3
