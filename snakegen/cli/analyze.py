"""`snakegen analyze`: a command per analysis, found by folder; `report` is the default."""

from difflib import get_close_matches
from pathlib import Path
from typing import Any

import click

from snakegen.analysis import Entry, catalogue
from snakegen.cli import HELP, LazyGroup
from snakegen.cli.options import (
    Source,
    Stance,
    explain_option,
    json_option,
    note,
    posture_options,
    print_json,
    print_rows,
    robot_options,
)

_OTHERS = {
    "report": ("snakegen.cli.report", "Everything that applies, on one page (the default)."),
    "sweep": ("snakegen.cli.sweep", "Many postures to Parquet, with a map of the margins."),
    "flight": ("snakegen.cli.flight", "Fly, drive or move the robot in MuJoCo, logged to rerun."),
}


class AnalyzeGroup(LazyGroup):
    """Commands from the analysis folder; a first word that is no command is a ROBOT for report."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Puts `report` before a ROBOT; a word that nearly is a command, or before one, stays."""
        if args and not args[0].startswith("-") and args[0] not in self.lazy:
            mistyped = get_close_matches(args[0], self.lazy, n=1, cutoff=0.7)
            robot_next = len(args) > 1 and _is_robot(args[1])
            if _is_robot(args[0]) or not (mistyped or robot_next):
                args = ["report", *args]
        return super().parse_args(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Returns a command of its own module, or makes one from an analysis."""
        entries = catalogue()
        if cmd_name in entries:
            return _command(entries[cmd_name])
        return super().get_command(ctx, cmd_name)


def _is_robot(word: str) -> bool:
    from snakegen.spec.loading import presets

    return word in presets() or word.endswith((".yaml", ".yml", ".urdf")) or Path(word).is_file()


def _lazy() -> dict[str, tuple[str, str]]:
    found = {e.command: (e.module, e.help) for e in catalogue().values()}
    from importlib.util import find_spec

    others = {k: v for k, v in _OTHERS.items() if find_spec(v[0]) is not None}
    first = {"report": others.pop("report")}
    return first | found | others


def _command(entry: Entry) -> click.Command:
    """Returns the click command of an analysis, with its own options."""

    def run(source: Source, stance: Stance, as_json: bool, explain: bool, **options: Any) -> None:
        from snakegen.report.explanations import explained
        from snakegen.report.page import posture_json, refuse
        from snakegen.robot.posture import posture_line

        machine = source.machine()
        analysis = entry.load()
        if not analysis.applies(machine):
            refuse(entry.command, machine, analysis)
        machine, q = stance.of(machine)
        result = analysis.analyze(machine, q, **options)
        if as_json:
            head = {"robot": machine.name, "analysis": entry.command}
            head |= {"posture_rad": posture_json(machine, q)}
            print_json(head | result.to_json())
        else:
            title = f"{source.folder(machine)}: {entry.command}; {posture_line(machine, q)}"
            rows = result.rows()
            print_rows(title, explained(entry.command, rows) if explain else rows)

    # the analysis' own options stand first in its help
    decorated: Any = posture_options(robot_options(json_option(explain_option(run))))
    for name, option in reversed(entry.options.items()):
        kind: dict[str, Any] = {"is_flag": True} if option.kind is bool else {"type": option.kind}
        decorated = click.option(
            f"--{name.replace('_', '-')}",
            default=option.default,
            show_default=option.default != "",
            help=option.meaning,
            **kind,
        )(decorated)
    example = f"snakegen analyze {entry.command} {entry.example}"
    help_text = f"{entry.help}\n\n\b\nExample:\n  {example}"
    return click.command(name=entry.command, help=help_text, context_settings=HELP)(decorated)


@click.group(cls=AnalyzeGroup, lazy=_lazy(), context_settings=HELP)
def analyze() -> None:
    """Tell what a robot can do; fly, drive or move it to show it.

    Without a subcommand: `analyze ROBOT` is `analyze report ROBOT`.

    \b
    Example:
      snakegen analyze dragon4 --joint joint1_yaw=0.8
      snakegen analyze actuation dragon3 --json
    """


__all__ = ["analyze", "note"]
