"""`snakegen analyze sweep`: margins of many postures to Parquet, with a map."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from snakegen.cli import HELP
from snakegen.cli.options import (
    Source,
    Stance,
    at_least,
    check_ending,
    json_option,
    note,
    print_json,
    print_rows,
    robot_options,
    start_options,
)
from snakegen.cli.outcome import progress_bar
from snakegen.errors import SnakegenError

ANNOUNCED = 100_000  # postures from which on a sweep says beforehand what it will take


@click.command(context_settings=HELP)
@click.option("--samples", type=int, default=10_000, show_default=True, help="How many postures.")
@click.option(
    "--seed", type=int, default=0, show_default=True, callback=at_least(0), help="Of the samples."
)
@click.option(
    "--sampling", "kind", type=click.Choice(["sobol", "lhs", "random", "walk", "grid"]),
    default="sobol", show_default=True, help="How postures are chosen within the joint limits.",
)  # fmt: skip
@click.option(
    "--from",
    "table",
    metavar="FILE",
    type=click.Path(),
    help="Postures to take: a table (CSV, Parquet or YAML) whose header names joints.",
)
@click.option(
    "--joints",
    "varied",
    metavar="A,B,…",
    help="Joints to vary; all that shape the body by default.",
)
@click.option(
    "--tolerance", type=float, default=1e-3, show_default=True, help="Of certified margins."
)
@click.option("-o", "--out", metavar="FILE.parquet", type=click.Path(), help="The table to write.")
@click.option("--resume", is_flag=True, help="Go on with an interrupted sweep.")
@click.option("--workers", type=int, callback=at_least(1), help="Processes; all cores by default.")
@click.option("--cluster", metavar="ADDRESS", help="Dask scheduler, as in tcp://10.0.0.5:8786.")
@click.option("--worst", is_flag=True, help="Refine the worst posture by local search.")
@click.option(
    "--margin", "column", default="force_margin", show_default=True, help="For --worst, --map."
)
@click.option("--map", "axes", metavar="JOINT,JOINT", help="Picture of the margin over two joints.")
@json_option
@start_options
@robot_options
def sweep(
    source: Source,
    stance: Stance,
    samples: int,
    seed: int,
    kind: str,
    table: str | None,
    varied: str | None,
    tolerance: float,
    out: str | None,
    resume: bool,
    workers: int | None,
    cluster: str | None,
    worst: bool,
    column: str,
    axes: str | None,
    as_json: bool,
) -> None:
    """Certified margins of many postures of ROBOT, as Parquet; gimbals point up in each.

    --joint and --posture hold joints, which the sweep then does not vary; --base-rpy is the
    attitude of all postures.

    \b
    Example:
      snakegen analyze sweep dragon4 --samples 20000 --worst --map joint1_yaw,joint2_yaw
      snakegen analyze sweep dragon4 --from postures.csv -o margins.parquet
    """
    from snakegen.base.atomic_io import check_writable
    from snakegen.robot.posture import posture_line
    from snakegen.sweep.run import body_at
    from snakegen.sweep.run import sweep as run
    from snakegen.sweep.samples import Table, chosen_joints, read_postures, sampling
    from snakegen.sweep.store import read_columns

    _check_margin(column, worst)
    check_ending("-o", out, ".parquet")
    machine, held = stance.asked(source.machine())
    names = chosen_joints(machine, varied, held)
    posture = machine.configuration(held)
    drawn_over = _map_axes(axes, names)
    low, high, _ = machine.limits(names)
    drawn = (
        Table(read_postures(Path(table), names, low, high))
        if table
        else sampling(kind, samples, seed, low, high)
    )
    path = Path(out) if out else Path("generated") / source.folder(machine) / "sweep.parquet"
    identity = {
        "seed": seed,
        "sampling": "table" if table else kind,
        "spec": _spec_text(source),
    }
    how: dict[str, Any] = {"posture": posture, "tolerance": tolerance}
    how |= {"identity": identity, "resume": resume, "workers": cluster or workers}
    check_writable(path)
    if drawn.count >= ANNOUNCED and not resume:
        note(_estimate(machine, names, drawn, how))
    with progress_bar(f"{machine.name} sweep") as step, _kept(path):
        run(machine, names, drawn, path, progress=step, **how)
    summary = _summary(read_columns(path, (column, "closed", "self_collision")), column)
    picture = None
    if drawn_over:
        from snakegen.report.sweep_maps import sweep_map

        picture = path.with_suffix(".png")
        sweep_map(picture, machine, read_columns(path, (*names, column)), column, drawn_over, held)
    if worst:
        body = body_at(machine, names, posture, tolerance)
        summary["worst"] = _refine(body, path, column)
        summary["worst"]["least_sampled"] = summary["least"]
    if held:
        summary["held"] = held
    files = {"table": str(path)} | ({"map": str(picture)} if picture else {})
    if as_json:
        print_json(files | summary)
        return
    for file in files.values():
        note(file)
    title = f"{source.folder(machine)}: sweep of {summary['postures']:,} postures"
    print_rows(f"{title}; {posture_line(machine, posture)}" if held else title, _rows(summary))


class Interrupted(SnakegenError):
    """Ctrl-C in a sweep, whose parts so far are kept."""

    exit_code = 130


@contextmanager
def _kept(path: Path) -> Iterator[None]:
    """Says after Ctrl-C or lost workers what of the sweep is kept, and how to go on with it.

    Raises:
        Interrupted: Ctrl-C, and there are finished parts.
        WorkersLostError: as it was raised, with what is kept.
    """
    from snakegen.sweep.executors import WorkersLostError

    parts = path.with_name(path.name + ".parts")

    def kept() -> str:
        done = len(list(parts.glob("part-*.parquet")))
        if done == 0:
            shutil.rmtree(parts, ignore_errors=True)
            return ""
        return (
            f"parts finished so far ({done}) are kept in {parts}: "
            "the same command with --resume goes on from there."
        )

    try:
        yield
    except KeyboardInterrupt:
        if note := kept():
            raise Interrupted(f"interrupted; {note}") from None
        raise
    except WorkersLostError as error:
        raise WorkersLostError(f"{error} {kept() or 'No part was finished.'}") from None


def _estimate(machine: Any, names: Any, drawn: Any, how: dict[str, Any]) -> str:
    """Returns the line that says what a long sweep will take."""
    from snakegen.sweep.estimate import estimate, part_rows
    from snakegen.sweep.run import PART, body_at

    body = body_at(machine, names, how["posture"], how["tolerance"])
    part, here = part_rows(len(names), PART), not isinstance(how["workers"], str)
    return estimate(body, drawn, part, how["workers"] if here else None, timed=here).text()


def _spec_text(source: Source) -> str:
    from snakegen.base import yaml_file

    return "" if source.is_xml else yaml_file.dump(source.spec().resolved())


def _check_margin(column: str, worst: bool) -> None:
    """Refuses an unknown margin before the sweep, not after it."""
    from snakegen.errors import AnalysisError, near
    from snakegen.sweep.batch import FLAGS, MARGINS

    if column not in MARGINS:
        raise AnalysisError(
            f"--margin '{column}': a sweep has no such margin.{near(column, MARGINS)}"
        )
    if worst and column in FLAGS:
        raise AnalysisError(f"--worst: '{column}' is true or false; it has no least value.")


def _map_axes(axes: str | None, names: Any) -> tuple[str, str] | None:
    """Returns the two joints of --map, refused before the sweep if it does not vary them."""
    from snakegen.errors import AnalysisError, near

    if axes is None:
        return None
    joints = tuple(part.strip() for part in axes.split(","))
    if len(joints) != 2 or joints[0] == joints[1]:
        raise AnalysisError(f"--map '{axes}': write two joints, as in {','.join(list(names)[:2])}.")
    for joint in joints:
        if joint not in names:
            raise AnalysisError(f"--map: the sweep does not vary '{joint}'.{near(joint, names)}")
    return joints[0], joints[1]


def _summary(found: Any, column: str) -> dict[str, Any]:
    import numpy as np

    values = np.asarray(found[column], float)
    finite = values[np.isfinite(values)]
    quantiles = np.quantile(finite, [0.0, 0.01, 0.5, 1.0]) if finite.size else [np.nan] * 4
    names = ("least", "percentile_1", "median", "largest")
    return {
        "postures": len(values),
        "margin": column,
        "infeasible_share": 1.0 - finite.size / max(len(values), 1),
        "closed_share": float(np.mean(np.asarray(found["closed"]))),
        "self_collision_share": float(np.mean(np.asarray(found["self_collision"]))),
    } | {n: float(v) for n, v in zip(names, quantiles, strict=True)}


def _refine(body: Any, path: Path, column: str) -> dict[str, Any]:
    from snakegen.sweep.worst import refine, worst_rows

    w = refine(body, worst_rows(body, path, column), column)
    return {
        "posture": {n: float(a) for n, a in zip(w.joints, w.angles, strict=True)},
        "lower": w.lower,
        "upper": w.upper,
        "closed": w.closed,
        "hover_feasible": w.feasible,
        "wrench_margin": w.wrench,
        "zero": w.zero,
    }


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    if summary["infeasible_share"] == 1.0:
        spread = "undefined: hover is out of reach in every posture"
    else:
        spread = (
            f"least {summary['least']:.4g}, 1 % {summary['percentile_1']:.4g}, "
            f"median {summary['median']:.4g}, largest {summary['largest']:.4g}"
        )
    rows = [
        (summary["margin"], spread),
        ("hover out of reach", f"{100 * summary['infeasible_share']:.2f} %"),
        ("certified bounds closed", f"{100 * summary['closed_share']:.2f} %"),
        ("self-colliding", f"{100 * summary['self_collision_share']:.2f} %"),
    ]  # fmt: skip
    if "worst" in summary:
        w = summary["worst"]
        angles = ", ".join(f"{n} {a:+.4f}" for n, a in w["posture"].items())
        rows.append(("worst posture", f"{_worst_text(w, summary['margin'])} at {angles}"))
    return rows


def _worst_text(worst: dict[str, Any], column: str) -> str:
    """Returns the least margin in words: out of reach, zero, closed or not."""
    if not worst["hover_feasible"]:
        return f"hover out of reach (scaled wrench margin {worst['wrench_margin']:.3g})"
    if worst["zero"]:
        return "0" + (": no resistance in some direction" if "margin" in column else "")
    note = "" if worst["closed"] else " (bounds did not close)"
    return f"{worst['lower']:.6g} … {worst['upper']:.6g}{note}"
