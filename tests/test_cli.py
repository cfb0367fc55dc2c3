"""The command line as people and programs meet it: exit codes, streams, JSON alone, examples."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from snakegen import __version__
from snakegen.analysis import catalogue
from snakegen.base.atomic_io import INTERRUPTED, folder_whole, on_interrupt
from snakegen.cli import HELP, cli
from snakegen.robot.robot import load
from snakegen.spec.loading import load_spec, presets

HEAVY = ("numpy", "scipy", "pinocchio", "mujoco", "numba", "pydantic", "rerun", "matplotlib")


def commands() -> list[list[str]]:
    """Returns the words of every command and group that there is."""
    found: list[list[str]] = []

    def walk(command: click.Command, words: list[str]) -> None:
        found.append(words)
        if isinstance(command, click.Group):
            context = click.Context(command)
            for name in command.list_commands(context):
                inner = command.get_command(context, name)
                assert inner is not None, name
                walk(inner, [*words, name])

    walk(cli, [])
    return found


@pytest.mark.parametrize("words", commands(), ids=lambda w: " ".join(w) or "snakegen")
def test_every_help_has_an_example(words: list[str]) -> None:
    """`--help` of every command: a sentence, and an example that calls that very command."""
    result = CliRunner().invoke(cli, [*words, "--help"], prog_name="snakegen")
    assert result.exit_code == 0
    assert "Example:" in result.output
    example = result.output.split("Example:")[1]
    assert f"snakegen {' '.join(words)}".strip() in example
    assert "-h, --help" in result.output


def test_a_command_called_on_its_own_has_the_same_help() -> None:
    """As tests and programs call it; click keeps the help option of the first call for good."""
    from snakegen.cli.presets import schema

    assert "-h, --help" in CliRunner().invoke(schema, ["-h"]).output
    for words in commands():
        command: click.Command = cli
        for word in words:
            found = command.get_command(click.Context(command), word)  # type: ignore[attr-defined]
            assert found is not None
            command = found
        assert command.context_settings["help_option_names"] == HELP["help_option_names"], words


def test_help_is_light() -> None:
    """`snakegen --help` and `analyze --help` import nothing heavy: they answer at once."""
    for arguments in (["--help"], ["analyze", "--help"], ["build", "--help"]):
        code = (
            "import sys\nfrom snakegen.cli import main\n"
            f"try:\n    main({arguments!r})\nexcept SystemExit: pass\n"
            f"print('HEAVY', [m for m in {HEAVY!r} if m in sys.modules])"
        )
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert ran.stdout.strip().endswith("HEAVY []"), ran.stdout + ran.stderr


def test_every_analysis_has_a_command_and_a_line() -> None:
    """What stands in analysis/ is listed by `analyze --help` with its one line."""
    text = CliRunner().invoke(cli, ["analyze", "--help"]).output
    flat = " ".join(text.split())
    for entry in catalogue().values():
        assert entry.command in text
        assert " ".join(entry.help.split())[:40] in flat


def test_version_and_presets(run) -> None:
    """Version, and one line a preset with its own words; as JSON too."""
    assert __version__ in run("--version").out
    shown = run("presets")
    assert shown.code == 0 and shown.err == ""
    assert [line.split()[0] for line in shown.out.splitlines()] == sorted(presets())
    assert set(json.loads(run("presets", "--json").out)) == set(presets())
    assert json.loads(run("schema").out)["type"] == "object"


def test_build_and_save_spec(run, tmp_path: Path) -> None:
    """Files on stdout, the gate's figure last; the saved spec builds the same robot."""
    made = run("build", "dragon4", "--links", "3", "--no-picture", "--save-spec", "mine/three.yaml")
    assert made.code == 0 and made.err == ""
    lines = made.out.splitlines()
    assert lines[0] == "generated/dragon4-links3/dragon4.urdf"
    assert all((tmp_path / line).is_file() for line in lines[:-1])
    assert re.match(r"URDF and MJCF agree: worst error \d\.\de-\d\d", lines[-1])
    assert run("build", "mine/three.yaml", "--no-picture", "-o", "again").code == 0
    first, again = (tmp_path / d / "dragon4.urdf" for d in ("generated/dragon4-links3", "again"))
    assert first.read_bytes() == again.read_bytes()


def test_json_is_json_alone(run) -> None:
    """With --json, stdout parses; no NaN; remarks go to stderr."""
    built = json.loads(run("build", "dragon4", "--no-picture", "--json").out)
    assert built["equivalence"]["passed"] is True and Path(built["urdf"]).is_file()
    page = run("analyze", "dragon4", "--joint", "joint1_yaw=0.8", "--json", "--report", "r/r.md")
    data = json.loads(page.out, parse_constant=lambda word: pytest.fail(f"{word} in JSON"))
    assert data["robot"] == "dragon4" and data["posture_rad"]["joint1_yaw"] == 0.8
    assert data["mass"]["mass_kg"] == pytest.approx(8.0) and "r/r.md" in page.err
    assert Path("r/r.md").read_text().startswith("# dragon4")
    one = json.loads(run("analyze", "actuation", "dragon4", "--json").out)
    assert one["analysis"] == "actuation"


@pytest.mark.parametrize(
    ("arguments", "suffix"),
    [
        (("grasper3", "--report", "rep.pdf"), ".md"),
        (("grasper3", "--report", "rep"), ".md"),
        (("grasper3", "--report", "rep.html.txt"), ".md"),
        (("motion", "grasper3", "--motion", "m.yaml", "--table", "t.xlsx"), ".csv"),
        (("cables", "arm6", "--mjcf", "c.urdf"), ".xml"),
    ],
)
def test_a_suffix_of_another_format_is_refused(run, arguments, suffix) -> None:
    """One line, no file: Markdown in a .pdf is neither."""
    ran = run("analyze", *arguments)
    assert ran.code == 1 and ran.err.startswith("Error: ") and len(ran.err.splitlines()) == 1
    assert suffix in ran.err and not list(Path().iterdir())


def test_report_is_the_default(run) -> None:
    """`analyze ROBOT` is `analyze report ROBOT`; a URDF and a spec are read as a preset is."""
    short = run("analyze", "grasper3")
    assert short.code == 0 and short.out == run("analyze", "report", "grasper3").out
    run("build", "grasper3", "--no-picture")
    assert run("analyze", "generated/grasper3/grasper3.urdf").out == short.out
    assert run("analyze", "generated/grasper3/grasper3.spec.yaml").out == short.out


def test_a_word_before_a_robot_is_an_analysis(run) -> None:
    refused = run("analyze", "losses", "screw4")
    assert refused.code == 2 and "No such command 'losses'" in refused.err


def test_missions_and_their_options_are_listed(run) -> None:
    """`--mission help` sorts by what suits the robot; `--option help` shows names and defaults."""
    suits, _, others = run("analyze", "flight", "arm6", "--mission", "help").out.partition(
        "not for"
    )
    assert "tip_path" in suits and "hover" not in suits
    assert "hover" in others and "a floating base and rotors\n" in others
    options = run("analyze", "flight", "dragon4", "--mission", "push", "--option", "help")
    assert options.code == 0 and "kind=force" in options.out and "until=1.2" in options.out


def test_examples_of_analyses_work(run, tmp_path: Path) -> None:
    """What stands after a command in its help names a robot that suits, and options it has."""
    for entry in catalogue().values():
        robot, *rest = entry.example.split()
        sets = [rest[k + 1] for k, word in enumerate(rest) if word == "--set"]
        assert entry.load().applies(load(load_spec(robot, overrides=sets))), entry.example
        flags = [word for word in rest if word.startswith("--")]
        text = run("analyze", entry.command, "--help").out
        assert all(f"{flag} " in text for flag in flags), entry.example


def test_too_heavy_is_said_with_a_number(run) -> None:
    """Analysis of a robot that cannot hover goes on, and says by how much."""
    found = run("analyze", "hover", "dragon4", "--set", "chain.mass=5")
    assert found.code == 0
    assert "238.96" in found.out and "0.54" in found.out


def test_a_failed_check_exits_3(run, monkeypatch: pytest.MonkeyPatch) -> None:
    """A build whose gate fails exits 3, as any check that ran and failed."""
    from snakegen.pipeline import equivalence

    monkeypatch.setattr(equivalence, "BOUND", 0.0)
    found = run("build", "dragon4", "--no-picture")
    assert found.code == 3 and found.out == ""
    assert found.err.startswith("Error: dragon4: URDF and MJCF disagree by")


def test_a_swallowed_ctrl_c_still_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    """Some libraries catch everything while they are imported, Ctrl-C too."""
    (tmp_path / "out").mkdir()
    with pytest.raises(KeyboardInterrupt), folder_whole(tmp_path / "out") as beside:
        (beside / "new.txt").write_text("x")
        with contextlib.suppress(KeyboardInterrupt):
            on_interrupt(signal.SIGINT, None)
    INTERRUPTED.clear()
    assert list((tmp_path / "out").iterdir()) == [] and len(list(tmp_path.iterdir())) == 1


def test_ctrl_c_and_a_closed_pipe(tmp_path: Path) -> None:
    """Ctrl-C: one line, exit 130, the folder as it was; a reader that leaves: no traceback."""
    command = [sys.executable, "-m", "snakegen", "build", "dragon4", "--links", "200"]
    child = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    for _ in range(600):
        if (tmp_path / "generated").is_dir() and any((tmp_path / "generated").iterdir()):
            break
        time.sleep(0.05)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=60)
    assert child.returncode == 130
    assert err.strip().splitlines()[-1] == "Error: interrupted; files are as they were."
    assert list((tmp_path / "generated").iterdir()) == []
    shell = f"{sys.executable} -m snakegen schema | head -n 1"
    ran = subprocess.run(shell, shell=True, capture_output=True, text=True, cwd=tmp_path)
    assert ran.stdout == "{\n" and "Traceback" not in ran.stderr


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full to write to")
def test_stdout_on_a_full_disk(tmp_path: Path) -> None:
    """Results that cannot be written are an error with its reason, not a traceback."""
    with open("/dev/full", "w") as full:
        ran = subprocess.run(
            [sys.executable, "-m", "snakegen", "schema"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
        )
    assert ran.returncode == 1
    assert ran.stderr.strip() == "Error: stdout cannot be written (No space left on device)."


def test_missions_are_listed_with_reasons_and_options(run) -> None:
    """All of them; those of a robot and what the others need; the options of one; as JSON too."""
    everything = run("missions")
    assert everything.code == 0 and "transform" in everything.out and "lcrank" in everything.out
    page = json.loads(run("missions", "dragon3", "--json").out)["missions"]
    assert page["hover"]["applies"] and page["hover"]["needs"] is None
    assert not page["table3"]["applies"] and "fixed base" in page["table3"]["needs"]
    options = json.loads(run("missions", "dragon4", "hover", "--json").out)["options"]
    assert options["duration"] == {"default": 10.0, "meaning": "s"}
    assert (
        "allocator" not in json.loads(run("missions", "dragon4", "push", "--json").out)["options"]
    )
    for words, says in (
        (("missions", "hover"), "snakegen missions ROBOT hover"),
        (("missions", "dragon4", "hovr"), "Did you mean 'hover'"),
        (("missions", "dragon4", "table3"), "needs an arm"),
    ):
        refused = run(*words)
        assert refused.code == 1 and says in refused.err and refused.out == ""


def test_postures_reach_flights_and_are_printed(run, tmp_path: Path) -> None:
    """--joint, --posture and --base-rpy set the start; every page says which posture it is of."""
    (tmp_path / "bent.yaml").write_text("{joint1_yaw: 0.9, joint2_yaw: 0.2}\n")
    flight = ("analyze", "flight", "dragon4", "--duration", "0.2", "--ideal", "--json")
    given = ("--posture", "bent.yaml", "--joint", "joint2_yaw=0.8", "--base-rpy", "0,0.1,0.3")
    start = json.loads(run(*flight, *given).out)["start_posture_rad"]
    assert start["joint1_yaw"] == pytest.approx(0.9) and start["joint2_yaw"] == pytest.approx(0.8)
    assert start["base_rpy"] == pytest.approx([0.0, 0.1, 0.3], abs=1e-9)
    mass = run("analyze", "mass", "dragon4", *given).out.splitlines()[0]
    assert mass.startswith("dragon4: mass; ") and "joint1_yaw +0.900" in mass
    assert mass.endswith("base_rpy +0.000 +0.100 +0.300")
    posture = json.loads(run("analyze", "mass", "dragon4", *given, "--json").out)["posture_rad"]
    assert posture["joint2_yaw"] == 0.8 and posture["joint3_yaw"] == 0.0
    other = run(*flight, "--mission", "transform", "--joint", "joint1_yaw=0.1")
    assert other.code == 1 and "sets its own posture" in other.err and not other.out
