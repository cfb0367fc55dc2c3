"""`snakegen inspect`: metrics and verdict, read back from a log alone."""

from pathlib import Path

import click

from snakegen.cli.flight import result_json, result_lines
from snakegen.cli.options import json_option, print_json


@click.command()
@click.argument("file", metavar="FILE.rrd", type=click.Path())
@click.argument("other", metavar="[OTHER.rrd]", type=click.Path(), required=False)
@json_option
@click.option("--png", metavar="FILE.png", type=click.Path(), help="Also save the log's picture.")
@click.option("--time", type=float, help="Instant of the picture, s; the middle by default.")
@click.option("--open", "show", is_flag=True, help="Open the log in the viewer (127.0.0.1).")
def inspect(
    file: str, other: str | None, as_json: bool, png: str | None, time: float | None, show: bool
) -> int:
    """Read metrics and verdict back from FILE.rrd, worked out again from its samples.

    With OTHER.rrd the two are compared. Exit code 3 when the verdict fails.

    \b
    Example:
      snakegen inspect flight.rrd
      snakegen inspect flight.rrd --png flight.png
      snakegen inspect before.rrd after.rrd
    """
    from snakegen import log

    if other is not None:
        rows = log.compare(file, other)
        if as_json:
            print_json({r.metric: {"a": r.a, "b": r.b, "difference": r.difference} for r in rows})
        else:
            for r in rows:
                click.echo(f"{r.metric:<34}{_short(r.a):>28}{_short(r.b):>28}")
        return 0
    found = log.inspect(file)
    recording = found.recording
    if found.verdict is not None:
        recording = recording.judged(found.metrics, found.verdict)
    if png is not None:
        click.echo(str(log.snapshot(file, png, time=time)), err=True)
    if as_json:
        print_json(result_json(recording, Path(file)) | {"differing": list(found.differing)})
    else:
        for name, value in found.metrics.items():
            click.echo(f"  {name:<34}{_short(value)}")
        for name in found.differing:
            click.echo(f"  the log states another {name} than its samples show", err=True)
        for line in result_lines(recording, Path(file)):
            click.echo(line)
    if show:
        log.view(file)
    passed = found.verdict is None or (found.verdict.passed and not found.differing)
    return 0 if passed else 3


def _short(value: object) -> str:
    if isinstance(value, list):
        return " ".join(_short(v) for v in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
