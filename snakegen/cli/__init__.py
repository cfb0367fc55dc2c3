"""The command line: parse, call, print. Subcommands load when they run, not before."""

from snakegen.cli import early  # isort: skip  (before what takes long to import)

import importlib
import io
import locale
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

import click

from snakegen import __version__
from snakegen.base.atomic_io import INTERRUPTED, on_interrupt, send_again
from snakegen.errors import SnakegenError

_STDOUT = "stdout"
_INTERRUPTED = "interrupted; files are as they were."
_COMMANDS = {
    "demo": ("snakegen.cli.demo", "Build, analyse and fly dragon4: the whole in one go."),
    "presets": ("snakegen.cli.presets", "List the presets, one line each."),
    "missions": (
        "snakegen.cli.missions",
        "List the missions, those of a robot, or options of one.",
    ),
    "build": ("snakegen.cli.build", "Make URDF, MJCF and picture of a robot, proven to agree."),
    "analyze": ("snakegen.cli.analyze", "Tell what a robot can do; fly, drive or move it."),
    "plan": ("snakegen.cli.plan", "Plan a flight through a scene, certified at every instant."),
    "lint": ("snakegen.cli.lint", "List what is wrong or doubtful in a URDF or MJCF file."),
    "convert": ("snakegen.cli.convert", "Convert a URDF into MJCF, proven to be the same robot."),
    "compare": ("snakegen.cli.compare", "Tell whether two files describe the same robot."),
    "adopt": ("snakegen.cli.adopt", "Draft the modules file of a URDF with rotors."),
    "design": ("snakegen.cli.design", "Search the best bodies for a task, and prove how good."),
    "inspect": ("snakegen.cli.inspect", "Read metrics and verdict back from a log."),
    "doctor": ("snakegen.cli.doctor", "Check packages, rendering, viewer, cache and extras."),
    "completion": ("snakegen.cli.completion", "Print the completion script of a shell."),
    "schema": ("snakegen.cli.presets", "Print the JSON Schema of a spec file."),
}
# of every command: click keeps a command's help option as it was first called, on its own or not
HELP = {"help_option_names": ["-h", "--help"]}


class LazyGroup(click.Group):
    """A group whose commands are imported when they run; names and one-line help are static."""

    def __init__(self, *args: Any, lazy: dict[str, tuple[str, str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.lazy = lazy

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Returns the names in the order given."""
        return list(self.lazy)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Imports and returns a command."""
        if cmd_name not in self.lazy:
            return None
        module = importlib.import_module(self.lazy[cmd_name][0])
        command: click.Command = getattr(module, cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Finds the command, or fails with the nearest name."""
        name = args[0]
        if name not in self.lazy and not name.startswith("-"):
            close = get_close_matches(name, self.lazy, n=1, cutoff=0.5)
            hint = f" Did you mean '{close[0]}'?" if close else f" Known: {', '.join(self.lazy)}."
            ctx.fail(f"No such command '{name}'.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Writes the table of commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in self.lazy.items()])


@click.group(
    cls=LazyGroup,
    lazy=_COMMANDS,
    context_settings=HELP | {"max_content_width": 100},
)
@click.version_option(__version__, "-V", "--version", prog_name="snakegen")
def cli() -> None:
    """Describe a snake robot in one short file; build, analyse and fly it.

    ROBOT is a preset (snakegen presets), a spec file (.yaml) or a URDF.

    \b
    Example:
      snakegen build dragon4
      snakegen analyze dragon4 --joint joint1_yaw=0.8
      snakegen analyze flight dragon4 --mission transform
    """


def _load_no_gl() -> None:
    """Keeps `MUJOCO_GL` for the child processes that draw: MuJoCo loads no GL library here.

    A backend that is not installed, or misspelt, then costs a picture, not the command.
    """
    chosen = os.environ.get("MUJOCO_GL", "")
    if chosen and "mujoco" not in sys.modules:
        os.environ.setdefault("SNAKEGEN_GL", chosen)
        os.environ["MUJOCO_GL"] = "disable"


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; a user's mistake is one line on stderr and exit code 1."""
    if arguments is None:
        _prepare_streams()
        _load_no_gl()
    # a kill asks to stop as Ctrl-C does: work folders are cleared on the way out
    INTERRUPTED.clear()
    sys.unraisablehook, sys.excepthook = _unraisable, _uncaught
    for asked in (signal.SIGINT, signal.SIGTERM):
        signal.signal(asked, on_interrupt)
    try:
        code = cli.main(args=arguments, standalone_mode=False, prog_name="snakegen")
        sys.stdout.flush()
        sys.exit(code if isinstance(code, int) else 0)
    except SnakegenError as error:
        _fail(str(error), getattr(error, "exit_code", 1))
    except click.exceptions.Exit as error:
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        _fail(_INTERRUPTED, 130)
    except click.ClickException as error:
        error.show(sys.stderr)
        sys.exit(error.exit_code)
    except MemoryError:
        _fail("out of memory; a shorter chain, a shorter run or fewer samples would fit.", 1)
    except BrokenPipeError:
        _silence_stdout()
        sys.exit(1)
    except OSError as error:  # a full disk, a folder without permission: not a bug
        if error.filename == _STDOUT:
            _silence_stdout()
            _fail(f"stdout cannot be written ({error.strerror or error}).", 1)
        where = "" if error.filename is None else f"{error.filename}: "
        _fail(f"{where}{error.strerror or error}.", 1)
    except Exception:
        if INTERRUPTED.is_set():  # an extension module turned Ctrl-C into an error of its own
            _fail(_INTERRUPTED, 130)
        raise
    finally:
        if arguments is None:  # libraries are cleaning up; the result is out
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _unraisable(what: "sys.UnraisableHookArgs") -> None:
    """Sends a Ctrl-C again that came in a destructor or callback, which would ignore it."""
    if isinstance(what.exc_value, KeyboardInterrupt):
        send_again()
    else:
        sys.__unraisablehook__(what)


def _uncaught(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    """Prints no traceback of a Ctrl-C: compiled code prints one before it ignores it."""
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)


class _Stdout(io.TextIOWrapper):
    """Stdout whose errors name it, so that other errors are not taken for its own."""

    def write(self, text: str) -> int:
        """Writes `text`."""
        with self._named():
            return super().write(text)

    def flush(self) -> None:
        """Writes what is in the buffer."""
        with self._named():
            super().flush()

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            error.filename = _STDOUT
            raise


def _prepare_streams() -> None:
    """Opens what of stdin, stdout and stderr is closed on nothing; text is UTF-8 everywhere.

    Libraries open their files in the locale's encoding: where that is not UTF-8, Python starts
    again in its UTF-8 mode.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number: this one
    buffer = os.fdopen(1, "wb") if sys.stdout is None else sys.stdout.buffer
    line_buffering = sys.stdout is not None and sys.stdout.isatty()
    sys.stdout = _Stdout(buffer, encoding="utf-8", line_buffering=line_buffering)
    if sys.stderr is None:
        sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb"), encoding="utf-8")
    encoding = locale.getpreferredencoding(False).lower().replace("-", "")
    if os.name == "posix" and encoding != "utf8":
        os.execv(sys.executable, [sys.executable, "-X", "utf8", *sys.orig_argv[1:]])


def _silence_stdout() -> None:
    """Sends what is left in stdout's buffer nowhere, so that leaving does not fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str, code: int) -> None:
    print(f"Error: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(code)


early.restore()
