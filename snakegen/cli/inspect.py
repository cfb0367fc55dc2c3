"""`snakegen inspect`: metrics and verdict, read back from a log alone."""

from pathlib import Path
from typing import Any

import click

from snakegen.cli import HELP
from snakegen.cli.options import json_option, note, print_json, typed_command
from snakegen.cli.outcome import result_json, result_lines
from snakegen.errors import LogError


@click.command(context_settings=HELP)
@click.argument("file", metavar="FILE.rrd", type=click.Path())
@click.argument("other", metavar="[OTHER.rrd]", type=click.Path(), required=False)
@json_option
@click.option("--png", metavar="FILE.png", type=click.Path(), help="Also save the log's picture.")
@click.option("--time", type=float, help="Instant of the picture, s; the middle by default.")
@click.option(
    "--html", metavar="FILE.html", type=click.Path(),
    help="Also write one file that plays the log, with verdict and curves.",
)  # fmt: skip
@click.option(
    "--against", "measured", metavar="FILE", type=click.Path(),
    help="Compare with measurements: a table with time and any of x y z roll pitch yaw (CoG frame; "
    "base_x … the root link's) and joints by name; or .mcap with poses and joint states.",
)  # fmt: skip
@click.option("--topic", "topics", multiple=True, help="Of the .mcap; all by default. May repeat.")
@click.option("--shift", type=float, default=0.0, help="Seconds added to the measurements' times.")
@click.option("--open", "show", is_flag=True, help="Open the log in the viewer (127.0.0.1).")
def inspect(
    file: str,
    other: str | None,
    as_json: bool,
    png: str | None,
    time: float | None,
    html: str | None,
    measured: str | None,
    topics: tuple[str, ...],
    shift: float,
    show: bool,
) -> int:
    """Read metrics and verdict back from FILE.rrd, computed again from its samples.

    With OTHER.rrd the two are compared. Exit code 3 when the verdict fails.

    \b
    Example:
      snakegen inspect flight.rrd
      snakegen inspect flight.rrd --png flight.png
      snakegen inspect flight.rrd --html flight.html
      snakegen inspect flight.rrd --against measured.csv
      snakegen inspect flight.rrd --against bag.mcap --topic /mocap/pose --topic /joint_states
      snakegen inspect before.rrd after.rrd
    """
    from snakegen import log
    from snakegen.cli.options import check_ending

    check_ending("--html", html, ".html", ".htm")
    if time is not None and png is None:
        raise LogError("--time is the instant of a picture; it goes with --png FILE.png.")
    if other is not None:
        if png is not None or html is not None or show:
            raise LogError("--png, --html and --open show one log; leave the other out.")
        return _compare(file, other, as_json)
    if log.journal_of(file).is_file():
        note(_of_journal(Path(file), log.journal_of(file)))
    found = log.inspect(file)
    recording = found.recording
    if found.verdict is not None:
        recording = recording.judged(found.metrics, found.verdict)
    if png is not None:
        drawn_by = log.snapshot(file, png, time=time)
        note(f"{png} (drawn by {'rerun' if drawn_by == 'viewer' else drawn_by})")
    if html is not None:
        _write_page(recording, Path(html))
    if measured is not None:
        return _beside(recording, measured, shift, topics, as_json)
    if shift or topics:
        raise LogError("--shift and --topic are for measurements; they go with --against.")
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


def _write_page(recording: Any, path: Path) -> None:
    """Writes the page of a log; its meshes are those of a build, or none."""
    from snakegen.cli.meshes import mesh_folder
    from snakegen.robot.robot import from_urdf_text
    from snakegen.web.page import write_flight_page

    urdf = recording.meta.get("urdf")
    if not urdf:
        raise LogError("the log holds no URDF, which --html would draw.")
    robot = from_urdf_text(urdf, None, checked=True)
    write_flight_page(recording, path, robot, mesh_folder(robot, path).path(), typed_command())
    note(f"page: {path}")


def _beside(
    recording: Any, measured: str, shift: float, topics: tuple[str, ...], as_json: bool
) -> int:
    """Prints how far measurements are from the log, a row a column."""
    from snakegen.log.measured import against

    found = against(recording, measured, shift=shift, topics=topics)
    if as_json:
        rows = {
            d.name: {f"rmse_{d.unit}": d.rmse, f"bias_{d.unit}": d.bias,
                     f"largest_{d.unit}": d.largest, "at_s": d.time}
            for d in found
        }  # fmt: skip
        print_json({"measured": measured, "differences": rows})
        return 0
    wide = max(len(d.name) for d in found)
    click.echo(f"{'measured − logged':<{wide}}   RMSE       mean       largest")
    for d in found:
        click.echo(
            f"  {d.name:<{wide}}  {d.rmse:<9.4g}  {d.bias:<+9.4g}  {d.largest:+.4g} {d.unit} "
            f"at {d.time:.2f} s"
        )
    return 0


def _of_journal(file: Path, journal: Path) -> str:
    """Returns the note on a flight that was killed, or still flies, before its log was written."""
    if file.is_file():
        return f"note: a later flight into {file} has no end; its journal is {journal}"
    return f"note: {file} was not written; read from the flight's journal {journal}"


def _compare(file: str, other: str, as_json: bool) -> int:
    """Prints the metrics of two logs side by side, under what tells the two runs apart."""
    from snakegen.log.compare import comparison

    found = comparison(file, other)
    heads = {"a": vars(found.a), "b": vars(found.b)}
    for name in found.differing:
        a, b = (_unknown(head[name]) for head in heads.values())
        note(f"note: the {name}s differ ({a}, {b}): their metrics measure different things")
    if as_json:
        rows = {r.metric: {"a": r.a, "b": r.b, "difference": r.difference} for r in found.rows}
        print_json({"runs": heads, "runs_differ_in": list(found.differing)} | rows)
        return 0
    known = [name for name in heads["a"] if any(h[name] is not None for h in heads.values())]
    table = [(name, *(_unknown(head[name]) for head in heads.values())) for name in known]
    table += [(r.metric, _short(r.a), _short(r.b)) for r in found.rows]
    wide, left, right = (max(map(len, column)) for column in zip(*table, strict=True))
    for name, a, b in table:
        click.echo(f"{name:<{wide}}  {a:>{left}}  {b:>{right}}")
    return 0


def _unknown(value: object) -> str:
    return "unknown" if value is None else str(value)


def _short(value: object) -> str:
    if isinstance(value, list):
        return " ".join(_short(v) for v in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
