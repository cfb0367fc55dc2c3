"""`snakegen analyze flight`: a verification run in MuJoCo, logged to rerun."""

import os
from pathlib import Path
from typing import Any

import click

from snakegen.cli import HELP
from snakegen.cli.meshes import meshes_of
from snakegen.cli.missions import given_options, list_missions, list_options
from snakegen.cli.options import (
    Source,
    Stance,
    at_least,
    check_ending,
    json_option,
    note,
    print_json,
    robot_options,
    rollers_option,
    start_options,
    typed_command,
)
from snakegen.cli.outcome import progress_bar, result_json, result_lines
from snakegen.errors import SnakegenError


@click.command(context_settings=HELP)
@click.option(
    "--mission",
    default="hover",
    show_default=True,
    help="What to fly, or a file of waypoints; `snakegen missions` lists.",
)
@click.option("-o", "--out", metavar="FILE.rrd", type=click.Path(), help="The log to write.")
@click.option(
    "--seed", type=int, default=0, show_default=True, callback=at_least(0),
    help="Of noise and mismatch.",
)  # fmt: skip
@click.option("--duration", type=float, help="Seconds; the mission's own by default.")
@click.option(
    "--option", "options", metavar="NAME=VALUE", multiple=True,
    help="An option of the mission; `snakegen missions ROBOT MISSION` lists them.",
)  # fmt: skip
@click.option("--gains", help="Gain set of the spec, as in paper or tuned.")
@click.option(
    "--allocator", type=click.Choice(["paper", "constrained"]), default="paper", show_default=True,
    help="Pseudo-inverse as printed, or least norm within limits.",
)  # fmt: skip
@click.option("--ideal", is_flag=True, help="Perfect sensors and rotors.")
@click.option(
    "--plant", type=click.Choice(["contact", "kinematic"]),
    help="Drives: in contact (default), or with wheels that cannot slip.",
)  # fmt: skip
@rollers_option
@json_option
@click.option("--open", "show", is_flag=True, help="Open the log in the viewer (127.0.0.1).")
@click.option(
    "--report", "page", metavar="FILE.html", type=click.Path(),
    help="Also write one file that plays the flight, with verdict and curves.",
)  # fmt: skip
@click.option(
    "--trials", type=int, metavar="N", callback=at_least(1),
    help="Fly N times over uncertain mass, inertia, thrust, lag, delay, noise; log the worst.",
)  # fmt: skip
@click.option("--workers", type=int, callback=at_least(1), help="Threads for the trials.")
@start_options
@robot_options
def flight(
    source: Source,
    stance: Stance,
    mission: str,
    out: str | None,
    seed: int,
    duration: float | None,
    options: tuple[str, ...],
    gains: str | None,
    allocator: str,
    ideal: bool,
    plant: str | None,
    rollers: str | None,
    as_json: bool,
    show: bool,
    page: str | None,
    trials: int | None,
    workers: int | None,
) -> int:
    """Fly ROBOT through a mission in MuJoCo, log it to rerun, and judge it.

    Exit code 3 when a check of the verdict fails. `snakegen missions ROBOT` lists the missions that
    suit it, `snakegen missions ROBOT transform` the options of one. --joint, --posture and
    --base-rpy set the posture of missions that hold one.

    \b
    Example:
      snakegen analyze flight dragon4 --mission transform
      snakegen analyze flight screw4 --mission lcrank --plant kinematic
      snakegen analyze flight dragon4 --joint joint1_yaw=0.8 --joint joint2_yaw=0.8
      snakegen analyze flight dragon4 --mission hover --duration 5 --seed 3 --json
      snakegen analyze flight dragon4 --mission hover --trials 100
    """
    from snakegen.base.atomic_io import check_writable
    from snakegen.base.file_lock import exclusive
    from snakegen.cli.trials import fly_trials
    from snakegen.log import Journal, view, write
    from snakegen.simulation.flight.memory_check import refuse_too_long
    from snakegen.simulation.flight.run import run
    from snakegen.simulation.recording.compile_ahead import compile_ahead

    check_ending("-o", out, ".rrd")
    check_ending("--report", page, ".html", ".htm")
    if page is not None and trials is not None:
        raise SnakegenError(
            "--report shows one flight; with --trials: snakegen inspect LOG --html."
        )
    source = source.rolling_on(rollers)
    machine = source.machine()
    if mission == "help":
        return list_missions(machine)
    if "help" in options:
        return list_options(mission, machine)
    own = {"plant": plant, "duration": duration}
    machine, chosen = given_options(mission, machine, options, own, stance)
    _refuse_idle(mission, machine, gains, allocator)
    at_once = min(trials or 1, workers or os.cpu_count() or 1)
    refuse_too_long(machine, chosen.get("duration") or 0.0, at_once)
    # a mission file's own folder and ending are no part of the log's name
    path = (
        Path(out)
        if out
        else Path("generated") / source.folder(machine) / f"{Path(mission).stem}.rrd"
    )
    meshes = meshes_of(source, machine, path)
    bar = progress_bar(f"{machine.name} {mission}")
    how: dict[str, Any] = {"gains": gains, "allocator": allocator, "ideal": ideal}
    how |= {"options": chosen, "seed": seed}
    check_writable(path)
    compile_ahead(machine)
    if trials is not None:
        many: dict[str, Any] = {"progress": bar, "meshes": meshes}
        with exclusive(path):
            code = fly_trials(machine, mission, path, trials, workers, as_json, **many, **how)
        if show:
            view(path)
        return code
    with exclusive(path):
        journal = Journal(path)
        try:
            with bar as step:
                recording = run(
                    machine, mission, progress=step, keep=journal.keep, folder=path.parent, **how
                )
            write(recording, path, mesh_folder=meshes.path())
        finally:
            journal.remove()
    if page is not None:
        from snakegen.web.page import write_flight_page

        write_flight_page(recording, Path(page), machine, meshes.path(), typed_command())
        note(f"report: {page}")
    judged = recording.verdict
    passed = judged is not None and judged.passed
    if as_json:
        print_json(result_json(recording, path))
    else:
        for line in result_lines(recording, path):
            click.echo(line)
    if show:
        view(path)
    if str(recording.meta.get("stopped", "")).startswith("interrupted"):
        return 130  # by Ctrl-C; the log has what was flown
    return 0 if passed else 3


def _refuse_idle(name: str, robot: Any, gains: str | None, allocator: str) -> None:
    """Refuses choices that a mission with a loop of its own would pass over in silence."""
    from snakegen.errors import MissionError
    from snakegen.simulation.missions import mission as find

    if (gains is not None or allocator != "paper") and hasattr(find(name, robot), "fly"):
        raise MissionError(
            f"--gains and --allocator are for flights; mission '{name}' has a loop of its own and "
            "takes neither."
        )
