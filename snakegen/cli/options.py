"""Options that several commands share, and reading a robot and a posture from them."""

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from snakegen.errors import SnakegenError, SpecError

Decorator = Callable[[Any], Any]


def chain(*decorators: Decorator) -> Decorator:
    """Returns one decorator that applies `decorators` in reading order."""

    def apply(function: Any) -> Any:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return apply


robot_argument = click.argument("robot", metavar="ROBOT")

override_options = chain(
    click.option("--links", type=int, help="Replace the number of links."),
    click.option("--apparatus", metavar="PLACES", help="Replace the places, as in 1,2,4@0.3."),
    click.option(
        "--set", "overrides", metavar="PATH=VALUE", multiple=True,
        help="Set a field of the spec, as in chain.length=0.3; may be repeated.",
    ),
)  # fmt: skip

modules_option = click.option(
    "--modules", metavar="FILE", type=click.Path(),
    help="Modules file (rotors, gimbals) for a URDF that snakegen did not write.",
)  # fmt: skip

rollers_option = click.option(
    "--rollers", type=click.Choice(["helix_capsule", "ring_sphere", "ellipsoid", "ball"]),
    help="How screw drums touch the ground; ball (one a drum) is for the MJCF alone.",
)  # fmt: skip

posture_options = chain(
    click.option("--posture", metavar="FILE", type=click.Path(), help="Posture file (YAML)."),
    click.option(
        "--joint", "joints", metavar="NAME=VALUE", multiple=True,
        help="Joint angle in rad, as in joint1_yaw=0.5; may be repeated.",
    ),
    click.option(
        "--base-rpy", metavar="R,P,Y", help="Attitude of the root link in rad, as in 0,0.2,0."
    ),
    click.option(
        "--gimbals", type=click.Choice(["hover", "given"]), default="hover", show_default=True,
        help="Point every thrust up first, or take the posture's gimbal angles.",
    ),
)  # fmt: skip

json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON alone on stdout.")


def spec_of(
    robot: str, links: int | None, apparatus: str | None, overrides: tuple[str, ...]
) -> Any:
    """Returns the RobotSpec of a preset or spec file with its overrides."""
    from snakegen.spec_file import load_spec

    if robot.endswith((".urdf", ".xml")):
        kind = "a URDF" if robot.endswith(".urdf") else "XML"
        raise SpecError(f"{robot}: is {kind}; this needs a preset or a spec file (.yaml).")
    return load_spec(robot, links=links, apparatus=apparatus, overrides=overrides)


def with_rollers(robot: str, rollers: str | None, overrides: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the overrides with the choice of --rollers among them."""
    if rollers is None:
        return overrides
    if robot.endswith((".urdf", ".xml")):
        raise SpecError("--rollers changes a spec; the wheels of a URDF stand where they stand.")
    if spec_of(robot, None, None, overrides).screw_drive is None:
        raise SpecError(f"{robot} has no 'screw_drive'; --rollers says how drums touch the ground.")
    return (*overrides, f"screw_drive.rollers={rollers}")


def robot_of(
    robot: str,
    links: int | None,
    apparatus: str | None,
    overrides: tuple[str, ...],
    modules: str | None,
) -> Any:
    """Returns the Robot that ROBOT and its options name; says so if kernels must be compiled."""
    from snakegen.kernels.jit import cold
    from snakegen.robot import load

    if sys.stderr.isatty() and cold():
        note("compiling kernels; the first run takes a minute or two, later ones find them cached")
    if robot.endswith((".urdf", ".xml")):
        if links is not None or apparatus is not None or overrides:
            raise SpecError("--links, --apparatus and --set change a spec, not a URDF.")
        return load(robot, modules=modules)
    return load(spec_of(robot, links, apparatus, overrides), modules=modules)


def check_ending(path: str | None, *endings: str) -> None:
    """Refuses a file to write whose ending other programs would not know."""
    if path is not None and not path.endswith(endings):
        raise SnakegenError(f"-o {path}: the file's name must end in {' or '.join(endings)}.")


def posture_of(
    robot: Any, posture: str | None, joints: tuple[str, ...], base_rpy: str | None, gimbals: str
) -> Any:
    """Returns q from the posture options."""
    from snakegen.errors import PostureError
    from snakegen.posture import hover_gimbals, parse_joints, read_posture

    given = read_posture(Path(posture)) if posture else {}
    given |= parse_joints(joints)
    if base_rpy is not None:
        parts = base_rpy.split(",")
        if len(parts) != 3:
            raise PostureError(f"--base-rpy '{base_rpy}': write three angles, as in 0,0.2,0.")
        given["base_rpy"] = parts
    q = robot.configuration(given)
    return hover_gimbals(robot, q) if gimbals == "hover" else q


def print_json(value: Any) -> None:
    """Writes plain data to stdout as JSON; NaN and infinity become null."""
    from snakegen.report import plain

    json.dump(plain(value), sys.stdout, indent=2, ensure_ascii=False, allow_nan=False)
    sys.stdout.write("\n")


def print_rows(title: str, rows: list[tuple[str, str]]) -> None:
    """Writes (label, text) rows under a title, aligned."""
    from snakegen.report import text_table

    click.echo(text_table(title, rows, width=page_width()))


def page_width() -> int:
    """Returns how wide a page may be: the terminal's width, or 100 where there is none."""
    if not sys.stdout.isatty():
        return 100
    return min(max(shutil.get_terminal_size((100, 40)).columns, 80), 140)


def note(message: str) -> None:
    """Writes progress or a remark to stderr."""
    click.echo(message, err=True)
