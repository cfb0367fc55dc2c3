"""`snakegen design`: the best bodies for a task, certified, and how good any could get."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from snakegen.cli import HELP
from snakegen.cli.options import at_least, json_option, note, print_json
from snakegen.cli.outcome import progress_bar
from snakegen.errors import SnakegenError

FLIGHTS = ("transform", "push", "fail")
LEFT = "predicted_wrench_margin"
OWN_LIMITS = {  # checks of a flight that a force and torque margin says nothing of
    "gimbal_torque_limit_share", "joint_torque_use", "min_self_distance_m", "trim_sigmas",
}  # fmt: skip


@click.command(context_settings=HELP)
@click.argument("study", metavar="[STUDY.yaml]", required=False, type=click.Path())
@click.option("-o", "--out", metavar="DIR", type=click.Path(), help="Folder of the results.")
@click.option("--minutes", type=float, help="End the search with what it has by then.")
@click.option(
    "--seed", type=int, default=0, show_default=True, callback=at_least(0), help="Of the search."
)
@click.option("--resume", is_flag=True, help="Go on with an interrupted search.")
@click.option("--workers", type=int, callback=at_least(1), help="Processes; all cores by default.")
@click.option("--cluster", metavar="ADDRESS", help="Dask scheduler, as in tcp://10.0.0.5:8786.")
@click.option(
    "--fly", is_flag=True, help="Build the chosen design and fly it: transform, push, fail."
)
@click.option("--example", is_flag=True, help="Print a study with comments.")
@json_option
def design(
    study: str | None,
    out: str | None,
    minutes: float | None,
    seed: int,
    resume: bool,
    workers: int | None,
    cluster: str | None,
    fly: bool,
    example: bool,
    as_json: bool,
) -> int:
    """Search the designs of STUDY.yaml for those that no other dominates, and certify them.

    Writes front.json, front.png and a spec a design; each shown design is rebuilt through the
    templates, must give the same figures and pass the equivalence check. Exit code 3 where a
    claim fails on fresh postures or a flight disagrees with its margin.

    \b
    Example:
      snakegen design --example > study.yaml
      snakegen design study.yaml -o out/study --minutes 5
      snakegen design study.yaml -o out/study --resume --fly
    """
    from snakegen.design_search.run import run_study, write_front
    from snakegen.spec.loading import templates_folder

    if example:
        text = (templates_folder() / "studies" / "placement.yaml").read_text(encoding="utf-8")
        click.echo(text, nl=False)
        return 0
    if study is None:
        raise SnakegenError("a study is needed; `snakegen design --example` prints one.")
    if minutes is not None and not minutes > 0:
        raise SnakegenError(f"--minutes {minutes:g}: more than 0 is needed.")
    folder = Path(out) if out else Path("out") / Path(study).stem
    if folder.exists() and not folder.is_dir():
        raise SnakegenError(f"-o {folder}: is no folder.")
    bar = progress_bar(f"design {Path(study).stem}")
    with bar as step, _told_to_resume(folder):
        result = run_study(
            Path(study), folder, seed=seed, minutes=minutes, resume=resume, processes=workers,
            cluster=cluster, tell=note if sys.stderr.isatty() else lambda _: None,
            step=step or (lambda _done, _total: None),
        )  # fmt: skip
    data = result.to_json()
    failed = not all(fine for d in result.front for _, fine in d.tries.values())
    if fly:
        data["flights"] = _fly(result, folder, seed)
        write_front(folder, data)
        failed = failed or not all(f["agrees"] for f in data["flights"])
    if as_json:
        print_json(data)
    else:
        _print(result, data, folder)
    return 3 if failed else 0


@contextmanager
def _told_to_resume(folder: Path) -> Iterator[None]:
    """Says on Ctrl-C how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        note(f"what was scored is kept: --resume goes on from {folder}")
        raise


def _print(result: Any, data: dict[str, Any], folder: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    from snakegen.design_search.report import table

    head, *rows = table(result)
    shown = Table(box=None, pad_edge=False)
    for name in head:
        short = name.replace("vectoring_apparatus.", "").replace("_", " ")
        shown.add_column(short, overflow="fold")
    for row in rows:
        shown.add_row(*row)
    Console(width=None if sys.stdout.isatty() else 160).print(shown)
    for line in data["trades"]:
        click.echo(line)
    for line in result.step_lines():
        click.echo(line)
    for flight in data.get("flights", []):
        agrees = "" if flight["agrees"] else "; DISAGREES with its margin"
        line = f"{flight['design']}, {flight['mission']}: {flight['verdict']}{agrees}"
        click.echo("; ".join([line, *_measured(flight)]))
    state = "" if result.complete else " (ended by --minutes)"
    click.echo(
        f"{result.scored} designs scored in {result.seconds:.0f} s{state}; {folder}/front.png, "
        f"{folder}/{result.chosen.label}.spec.yaml (chosen)"
    )
    click.echo(result.sentence())


def _measured(flight: dict[str, Any]) -> list[str]:
    """Returns the figures of a flight that say most, in words."""
    metrics, out = flight.get("metrics", {}), []
    if flight["mission"] == "transform" and "position_rmse_m" in metrics:
        axes = " ".join(f"{1e3 * v:.1f}" for v in metrics["position_rmse_m"])
        out.append(f"position RMSE {axes} mm")
    if "ratio" in metrics and metrics.get("predicted_wrench"):
        force = sum(v * v for v in metrics["predicted_wrench"][:3]) ** 0.5
        out.append(f"measured limit {metrics['ratio']:.3f} of the predicted {force:.3g} N")
    if LEFT in flight:
        left = flight[LEFT]
        out.append(f"predicted 6-D margin after the loss {left:.3f}")
    return out


def _fly(result: Any, folder: Path, seed: int) -> list[dict[str, Any]]:
    """Builds the chosen design and flies it, and the robot as given, through the missions."""
    from snakegen.log import write
    from snakegen.pipeline.build import build
    from snakegen.robot.robot import load
    from snakegen.simulation.flight.run import run
    from snakegen.spec.loading import load_spec

    out = []
    for design in [result.chosen, *([result.given] if result.given else [])]:
        home = folder / f"{design.label}_built"
        made = build(load_spec(design.spec), home)
        robot = load(made.urdf)
        for mission in FLIGHTS:
            note(f"flying design {design.label}: {mission}")
            row: dict[str, Any] = {"design": design.label, "mission": mission}
            try:
                recording = run(robot, mission, seed=seed)
            except SnakegenError as error:  # a margin is missing: reported before take-off
                out.append(row | {"passed": False, "agrees": True, "verdict": f"refused: {error}"})
                continue
            write(recording, home / f"{mission}.rrd", mesh_folder=home)
            judged = recording.verdict
            passed = bool(judged and judged.passed)
            failed = {c.metric for c in judged.failed} if judged else {"verdict"}
            out.append(
                row
                | {
                    "passed": passed,
                    "agrees": failed <= OWN_LIMITS,
                    "verdict": judged.summary() if judged else "none",
                    "metrics": recording.metrics,
                    **{k: v for k, v in recording.meta.get("facts", {}).items() if k == LEFT},
                }
            )
    return out
