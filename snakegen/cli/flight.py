"""`snakegen analyze flight`: a verification run in MuJoCo, logged to rerun."""

import os
from pathlib import Path
from typing import Any, get_args, get_type_hints

import click

from snakegen.cli import HELP
from snakegen.cli.meshes import meshes_of
from snakegen.cli.options import (
    Source,
    at_least,
    check_ending,
    json_option,
    note,
    print_json,
    print_rows,
    robot_options,
    rollers_option,
    typed_command,
)
from snakegen.cli.outcome import progress_bar, result_json, result_lines
from snakegen.errors import SnakegenError


@click.command(context_settings=HELP)
@click.option(
    "--mission",
    default="hover",
    show_default=True,
    help="What to fly, or a file of way points; `help` lists.",
)
@click.option("-o", "--out", metavar="FILE.rrd", type=click.Path(), help="The log to write.")
@click.option(
    "--seed", type=int, default=0, show_default=True, callback=at_least(0),
    help="Of noise and mismatch.",
)  # fmt: skip
@click.option("--duration", type=float, help="Seconds; the mission's own by default.")
@click.option(
    "--option", "options", metavar="NAME=VALUE", multiple=True,
    help="An option of the mission; `help` lists them.",
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
@robot_options
def flight(
    source: Source,
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

    Exit code 3 when a check of the verdict fails. `--mission help` lists the missions that suit
    ROBOT, `--mission transform --option help` the options of one.

    \b
    Example:
      snakegen analyze flight dragon4 --mission transform
      snakegen analyze flight screw4 --mission lcrank --plant kinematic
      snakegen analyze flight dragon4 --mission hover --duration 5 --seed 3 --json
      snakegen analyze flight dragon4 --mission hover --trials 100
    """
    from snakegen.base.atomic_io import check_writable
    from snakegen.base.file_lock import exclusive
    from snakegen.cli.trials import fly_trials
    from snakegen.log import Journal, view, write
    from snakegen.simulation.flight.memory_check import refuse_too_long
    from snakegen.simulation.flight.run import run

    check_ending("-o", out, ".rrd")
    check_ending("--report", page, ".html", ".htm")
    if page is not None and trials is not None:
        raise SnakegenError(
            "--report shows one flight; with --trials: snakegen inspect LOG --html."
        )
    source = source.rolling_on(rollers)
    machine = source.machine()
    if mission == "help":
        return _list_missions(machine)
    if "help" in options:
        return _list_options(mission, machine)
    if plant is not None:
        options = (*options, f"plant={plant}")
    chosen = mission_options(mission, machine, options, duration)
    _refuse_idle(mission, machine, gains, allocator)
    at_once = min(trials or 1, workers or os.cpu_count() or 1)
    refuse_too_long(machine, chosen.get("duration") or 0.0, at_once)
    # a mission file's own folder and ending are no part of the log's name
    path = Path(out) if out else Path("generated") / machine.name / f"{Path(mission).stem}.rrd"
    meshes = meshes_of(source, machine, path)
    bar = progress_bar(f"{machine.name} {mission}")
    how: dict[str, Any] = {"gains": gains, "allocator": allocator, "ideal": ideal}
    how |= {"options": chosen, "seed": seed}
    check_writable(path)
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
                recording = run(machine, mission, progress=step, keep=journal.keep, **how)
            write(recording, path, mesh_folder=meshes)
        finally:
            journal.remove()
    if page is not None:
        from snakegen.web.page import write_flight_page

        write_flight_page(recording, Path(page), machine, meshes, typed_command())
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


def _list_missions(robot: Any) -> int:
    """Prints the missions that suit `robot`, then what the others need."""
    from snakegen.errors import MissionError
    from snakegen.simulation.missions import mission as find
    from snakegen.simulation.missions import missions

    suits, others = [], []
    for name, text in missions().items():
        try:
            find(name, robot)
            suits.append((name, text))
        except MissionError as error:
            others.append((name, str(error).partition("it needs ")[2].rstrip(".")))
    print_rows(f"missions for {robot.name} (--option help lists the options of one)", suits)
    if others:
        print_rows(f"not for {robot.name}; they need", others)
    return 0


def _list_options(name: str, robot: Any) -> int:
    """Prints the options of a mission with their defaults, then what its docstring adds."""
    from snakegen.simulation.missions import mission as find

    module = find(name, robot)
    options = getattr(module, "OPTIONS", {})
    rows = [(f"{k}={'' if v is None else v}", about) for k, (v, about) in options.items()]
    print_rows(f"options of mission {name}", rows or [("", "none")])
    more = (module.__doc__ or "").partition("\n")[2].strip().replace("``", "")
    if more:
        click.echo(f"\n{more}")
    return 0


def mission_options(
    name: str, robot: Any, items: tuple[str, ...], duration: float | None
) -> dict[str, Any]:
    """Returns the options of a mission from ``name=value`` items, checked against its OPTIONS."""
    from snakegen.base import yaml_file
    from snakegen.errors import MissionError, near
    from snakegen.robot.posture import read_posture
    from snakegen.simulation.missions import mission as find

    module = find(name, robot)
    known = getattr(module, "OPTIONS", {})
    hints = get_type_hints(module.plan) if hasattr(module, "plan") else {}
    given: dict[str, Any] = {}
    for item in items:
        key, equals, value = item.partition("=")
        key = key.strip().replace("-", "_")
        if not equals:
            raise MissionError(f"--option '{item}': write name=value.")
        given[key] = yaml_file.parse(value, f"--option {key}")
    if duration is not None:
        given["duration"] = duration
    for key in given:
        if key not in known:
            raise MissionError(f"mission '{name}' has no option '{key}'.{near(key, known)}")
        default, kinds = known[key][0], get_args(hints.get(key))  # kinds of what is None by default
        value = given[key]
        if isinstance(default, float) or float in kinds:
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or value != value:
                raise MissionError(f"--option {key}: {value!r} is not a number.")
        if isinstance(default, bool) and not isinstance(value, bool):
            raise MissionError(f"--option {key}: {value!r} is neither true nor false.")
        if isinstance(default, str) or str in kinds:  # a name may look like a number
            given[key] = str(value)
    if "posture" in given:
        given["posture"] = read_posture(Path(str(given["posture"])))
    return given
