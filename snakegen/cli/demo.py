"""`snakegen demo`: the main job in one command, from a preset's name to the verdict of a flight."""

import subprocess
import sys
from pathlib import Path

import click

from snakegen.cli import HELP
from snakegen.cli.options import note

_ROBOT = "dragon4"
_MISSION = "transform"


@click.command(context_settings=HELP)
@click.option(
    "-o", "--out", metavar="DIR", type=click.Path(), default="out/demo", show_default=True,
    help="Folder for all that it makes.",
)  # fmt: skip
def demo(out: str) -> int:
    """Build dragon4, analyse it and fly it; the last line is the verdict.

    The first run compiles kernels. Exit code 3 when a check fails.

    \b
    Example:
      snakegen demo
      snakegen demo -o my-demo
    """
    from snakegen.spec.loading import templates_folder

    folder = Path(out)
    urdf, log, page = (folder / name for name in (f"{_ROBOT}.urdf", f"{_MISSION}.rrd", "page.html"))
    posture = templates_folder() / "presets" / "postures" / f"{_ROBOT}.yaml"
    built = _run("build", _ROBOT, "-o", folder).wait()
    if built:
        return built
    note("analysing and flying it; the first flight compiles its kernels, about a minute")
    # the flight runs beside the analysis: each has kernels of its own to compile
    flight = _run("analyze", "flight", urdf, "--mission", _MISSION, "-o", log, capture=True)
    try:
        analysed = _run("analyze", urdf, "--posture", posture, "--report", page).wait()
        output, _ = flight.communicate()
    except BaseException:
        flight.terminate()
        flight.wait()
        raise
    lines = output.splitlines()
    for line in ["", *lines[:-1]]:
        click.echo(line)
    for what, path in (("report", page), ("picture", folder / f"{_ROBOT}.png"), ("log", log)):
        click.echo(f"{what + ':':<8} {path}")
    click.echo(lines[-1] if lines else "verdict: none")
    return analysed or flight.returncode


def _run(*arguments: str | Path, capture: bool = False) -> "subprocess.Popen[str]":
    """Starts a snakegen command beside this one."""
    command = [sys.executable, "-m", "snakegen", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE if capture else None, text=True)
