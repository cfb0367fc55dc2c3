"""Options that several commands share, and reading a robot and a posture from them."""

import json
import shlex
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import wraps
from pathlib import Path
from typing import Any, Literal

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


@dataclass(frozen=True)
class Source:
    """ROBOT and the options that change it on the way."""

    robot: str  # a preset, a spec file or a URDF; None where a command does not need one
    links: int | None
    apparatus: str | None
    overrides: tuple[str, ...]
    modules: str | None = None

    @property
    def is_xml(self) -> bool:
        """Whether ROBOT is a description already, not a spec."""
        from snakegen.spec.urdf import is_description

        return is_description(self.robot)

    def spec(self) -> Any:
        """Returns the RobotSpec of a preset or spec file with its overrides."""
        from snakegen.spec.loading import load_spec

        if self.is_xml:
            kind = "XML" if self.robot.endswith(".xml") else "a URDF"
            raise SpecError(f"{self.robot}: is {kind}; this needs a preset or a spec file (.yaml).")
        return load_spec(
            self.robot, links=self.links, apparatus=self.apparatus, overrides=self.overrides
        )

    def machine(self) -> Any:
        """Returns the Robot; shows from then on which kernels are compiled."""
        from snakegen.kernels.core.compile_progress import show_compilation
        from snakegen.robot.modules import from_urdf
        from snakegen.robot.robot import load

        show_compilation()
        if self.is_xml:
            if self.links is not None or self.apparatus is not None or self.overrides:
                raise SpecError("--links, --apparatus and --set change a spec, not a URDF.")
            robot = load(self.robot, modules=self.modules)
            if self.modules is None and from_urdf(robot.urdf) is None:
                note(
                    f"{self.robot} has no <snakegen> element: read as an arm on a fixed base; "
                    "rotors, gimbals and a floating root need --modules FILE"
                )
            return robot
        return load(self.spec(), modules=self.modules)

    def folder(self, robot: Any) -> str:
        """Returns the name of what is made of `robot`, as in dragon4, or dragon4-links6."""
        changed = self.links is not None or self.apparatus is not None or self.overrides
        return str(self.spec().variant) if changed and not self.is_xml else str(robot.name)

    def rolling_on(self, rollers: str | None) -> "Source":
        """Returns the source with the choice of --rollers among its overrides."""
        if rollers is None:
            return self
        if self.is_xml:
            raise SpecError(
                "--rollers changes a spec; the wheels of a URDF stand where they stand."
            )
        if self.spec().screw_drive is None:
            raise SpecError(
                f"{self.robot} has no 'screw_drive'; --rollers says how drums touch the ground."
            )
        return replace(self, overrides=(*self.overrides, f"screw_drive.rollers={rollers}"))


@dataclass(frozen=True)
class Stance:
    """The posture that the options ask for."""

    posture: str | None
    joints: tuple[str, ...]
    base_rpy: str | None
    gimbals: Literal["hover", "given"] = "hover"

    def asked(self, robot: Any) -> tuple[Any, dict[str, Any]]:
        """Returns the robot and the posture asked for, as `Robot.configuration` takes it.

        The base of an arm is mounted as the posture says.
        """
        from snakegen.errors import PostureError
        from snakegen.robot.base_mount import mounted
        from snakegen.robot.posture import parse_joints, read_posture

        given = read_posture(Path(self.posture)) if self.posture else {}
        given |= parse_joints(self.joints)
        if self.base_rpy is not None:
            parts = self.base_rpy.split(",")
            if len(parts) != 3:
                raise PostureError(
                    f"--base-rpy '{self.base_rpy}': write three angles, as in 0,0.2,0."
                )
            given["base_rpy"] = parts
        if "base_rpy" in given and not robot.floating:
            robot = mounted(robot, given.pop("base_rpy"))
        return robot, given

    def of(self, robot: Any) -> tuple[Any, Any]:
        """Returns the robot and its configuration."""
        robot, given = self.asked(robot)
        return robot, robot.configuration(given, gimbals=self.gimbals)


def _gathered(name: str, kind: Any, *decorators: Decorator) -> Decorator:
    """Returns a decorator whose options reach the command as one argument `name` of type `kind`."""
    fields_ = [f.name for f in fields(kind)]

    def apply(function: Any) -> Any:
        @wraps(function)
        def run(**given: Any) -> Any:
            values = {key: given.pop(key) for key in fields_ if key in given}
            return function(**{name: kind(**values)}, **given)

        return chain(*decorators)(run)

    return apply


def _complete_robot(_: click.Context, __: click.Parameter, begun: str) -> list[Any]:
    """Completes presets by name, and files."""
    from click.shell_completion import CompletionItem

    from snakegen.spec.loading import presets

    named = [CompletionItem(name) for name in presets() if name.startswith(begun)]
    return [*named, CompletionItem(begun, type="file")]


_robot = click.argument("robot", metavar="ROBOT", shell_complete=_complete_robot)

_overrides = chain(
    click.option("--links", type=int, help="Replace the number of links."),
    click.option("--apparatus", metavar="PLACES", help="Replace the places, as in 1,2,4@0.3."),
    click.option(
        "--set", "overrides", metavar="PATH=VALUE", multiple=True,
        help="Set a field of the spec, as in chain.length=0.3; given inertias scale with masses "
        "and sizes. May be repeated.",
    ),
)  # fmt: skip

_modules = click.option(
    "--modules", metavar="FILE", type=click.Path(),
    help="Modules file (rotors, gimbals) for a URDF that snakegen did not write.",
)  # fmt: skip

spec_options = _gathered("source", Source, _robot, _overrides)
optional_robot_options = _gathered(
    "source",
    Source,
    click.argument("robot", metavar="[ROBOT]", required=False),
    _overrides,
    _modules,
)
robot_options = _gathered("source", Source, _robot, _overrides, _modules)

rollers_option = click.option(
    "--rollers", type=click.Choice(["helix_capsule", "ring_sphere", "ellipsoid", "ball"]),
    help="How screw drums touch the ground; ball (one a drum) is for the MJCF alone.",
)  # fmt: skip

_posture = chain(
    click.option("--posture", metavar="FILE", type=click.Path(), help="Posture file (YAML)."),
    click.option(
        "--joint", "joints", metavar="NAME=VALUE", multiple=True,
        help="Joint angle in rad, as in joint1_yaw=0.5; may be repeated.",
    ),
    click.option(
        "--base-rpy", metavar="R,P,Y",
        help="Attitude of the root link, or of an arm's base, in rad, as in 0,0.2,0.",
    ),
)  # fmt: skip
start_options = _gathered("stance", Stance, _posture)
posture_options = _gathered(
    "stance", Stance, _posture,
    click.option(
        "--gimbals", type=click.Choice(["hover", "given"]), default="hover", show_default=True,
        help="Point every thrust up first, or take the posture's gimbal angles.",
    ),
)  # fmt: skip

explain_option = click.option(
    "--explain", is_flag=True, help="Add a sentence to each figure, and where to read more."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON alone on stdout.")


def check_ending(option: str, path: str | None, *endings: str) -> None:
    """Refuses a file to write whose ending other programs would not know."""
    if path is not None and not path.endswith(endings):
        raise SnakegenError(f"{option} {path}: the file's name must end in {' or '.join(endings)}.")


def at_least(least: int) -> Callable[[click.Context, click.Parameter, int | None], int | None]:
    """Returns a callback that refuses a whole number below `least`, in one line with exit 1."""

    def check(_: click.Context, option: click.Parameter, value: int | None) -> int | None:
        if value is not None and value < least:
            name = option.opts[0]
            raise SnakegenError(f"{name}: {value} is not in the range; {least} or more is needed.")
        return value

    return check


def print_json(value: Any) -> None:
    """Writes plain data to stdout as JSON; NaN and infinity become null."""
    from snakegen.report.page import plain

    json.dump(plain(value), sys.stdout, indent=2, ensure_ascii=False, allow_nan=False)
    sys.stdout.write("\n")


def print_rows(title: str, rows: list[tuple[str, str]]) -> None:
    """Writes (label, text) rows under a title, aligned."""
    from snakegen.report.page import text_table

    click.echo(text_table(title, rows, width=page_width()))


def page_width() -> int:
    """Returns how wide a page may be: the terminal's width, or 100 where there is none."""
    if not sys.stdout.isatty():
        return 100
    return min(max(shutil.get_terminal_size((100, 40)).columns, 80), 140)


def typed_command() -> str:
    """Returns the command line as it was typed, as a shell reads it."""
    return shlex.join(["snakegen", *sys.argv[1:]])


def note(message: str) -> None:
    """Writes progress or a remark to stderr."""
    click.echo(message, err=True)
