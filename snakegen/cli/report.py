"""`snakegen analyze report`: every analysis that applies, on one page."""

from pathlib import Path

import click

from snakegen.cli import HELP
from snakegen.cli.meshes import meshes_of
from snakegen.cli.options import (
    Source,
    Stance,
    check_ending,
    explain_option,
    json_option,
    note,
    page_width,
    posture_options,
    print_json,
    robot_options,
    typed_command,
)


@click.command(context_settings=HELP)
@posture_options
@json_option
@explain_option
@click.option(
    "--report",
    "file",
    metavar="FILE.html|.md",
    type=click.Path(),
    help="Also write a page: .html is one file with the robot in 3-D; .md has plots next to it.",
)
@robot_options
def report(source: Source, stance: Stance, as_json: bool, explain: bool, file: str | None) -> None:
    """Everything that applies to ROBOT in a posture, on one page.

    \b
    Example:
      snakegen analyze dragon4 --joint joint1_yaw=0.8 --report page.html
      snakegen analyze report body.urdf --modules modules.yaml --json
    """
    from snakegen.report.collection import collect
    from snakegen.report.page import HTML, MARKDOWN, text_page, to_json, write_markdown

    check_ending("--report", file, *HTML, *MARKDOWN)
    machine = source.machine()
    page = collect(*stance.of(machine))
    if file and file.endswith(HTML):
        from snakegen.web.page import write_robot_page

        meshes = meshes_of(source, machine, Path(file)).path()
        write_robot_page(page, Path(file), meshes, typed_command())
    elif file:
        write_markdown(page, Path(file))
    if file:
        note(f"report: {file}")
    if as_json:
        print_json(to_json(page))
    else:
        for line in text_page(page, width=page_width(), explain=explain).splitlines():
            click.echo(line if line.startswith(" ") else click.style(line, bold=True))
