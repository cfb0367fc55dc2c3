"""Every analysis with every option: a page, or a refusal of one line.

No traceback, no NaN or infinity printed as a figure, and JSON that a strict parser reads. Options
are dealt out to two presets to which their analysis applies; with SNAKEGEN_FULL_MATRIX=1 each
preset gets all of them (a minute).
"""

import ast
import json
import os
import re
from functools import cache, partial
from inspect import signature
from pathlib import Path

import pytest

from snakegen.analysis import catalogue, read_options
from snakegen.report.page import plain
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot, load
from snakegen.statics.worst import worst_posture

GENERATED = Path(__file__).parent.parent / "generated"
FULL = bool(os.environ.get("SNAKEGEN_FULL_MATRIX"))
PRESETS = ("arm6", "dragon3", "dragon4", "screw4", "grasper3", "hybrid4")  # the quickest first
# one value for each option, other than its default; a list: several
VALUES: dict[str, dict[str, list[str]]] = {
    "singularity": {"threshold": ["0.5"]},
    "wake": {"reach": ["1.5"], "spread": ["0.2"]},
    "margin": {
        "tolerance": ["0.01"],
        "failures": [""],
        "link": ["LAST"],
        "allocator": ["constrained"],
        "mass_error": ["0.05"],
        "thrust_error": ["0.05"],
        "sensitivity": [""],
        "picture": ["sensitivity.png"],
    },
    "attitude": {"margin": ["dual_force_margin", "wrench_margin"], "samples": ["4"]},
    "drive": {"path": ["circle", "line"], "speed": ["0.05"], "screw_rate": ["3"]},
    "statics": {
        "terms": ["static", "quasi_static"],
        "wrenches": ["LAST=0,1,-2,0,0.1,0"],
        "gravity": ["0,0,0", "1,0,-9"],
        "hold": ["base", "hover"],
        "thrust": ["THRUST"],
        "v": ["VELOCITY"],
        "a": ["VELOCITY"],
        "tip": ["LAST"],
        "tip_point": ["0.1,0,0"],
        "direction": ["1,0,0"],
        "worst": [""],
    },
    "relief": {"wrenches": ["LAST=0,1,-2,0,0.1,0"], "gravity": ["0,0,0"]},
    "traction": {"friction": ["0.3"], "slope": ["0.1"], "link": ["LAST"]},
    "along": {"table": ["ALONG"], "step": ["0.05"], "margin": ["torque_margin"]},
    "motion": {
        "motion": ["table3"],
        "duration": ["1"],
        "rate": ["100"],
        "terms": ["static"],
        "gravity": ["0,0,-9.81"],
        "wrenches": ["LAST=0,1,-2,0,0.1,0"],
        "friction": ["0.1,0.06"],
        "ends": ["free"],
        "table": ["torques.csv"],
    },
    "reach": {
        "path": ["POINTS"],
        "radius": ["0.02"],
        "depth": ["0.1"],
        "duration": ["4"],
        "dt": ["0.05"],
        "gain": ["5"],
        "corrections": ["2"],
        "give_up": ["0.01"],
        "margin": ["0.01"],
        "port": ["0.9,0,0.1"],
        "obstacles": ["OBSTACLES"],
        "tries": ["2"],
        "tip": ["LAST"],
        "tip_point": ["0.1,0,0"],
    },
    "tunnel": {
        "path": ["POINTS"],
        "mouth": ["1.25,0.08,0.08"],
        "inwards": ["1,0,0.1"],
        "depth": ["0.05"],
        "room": ["0.02"],
        "feed": ["0.1"],
        "step": ["0.02"],
        "opening": ["box"],  # which that scene does not have
        "obstacles": ["OBSTACLES"],
        "give_up": ["0.002"],
        "margin": ["0.01"],
        "tip": ["LAST"],
        "tip_point": ["0.1,0,0"],
    },
    "cables": {
        "count": ["4"],
        "radius": ["0.02"],
        "phase": ["0.3"],
        "standoff": ["0.01"],
        "sheathed": [""],
        "minimum": ["5"],
        "maximum": ["100"],
        "stiffness": ["1e5"],
        "elasticity": ["1e6"],
        "friction": ["0.05"],
        "wrenches": ["LAST=0,1,-2,0,0.1,0"],
        "tip_force": ["0,0,-1"],
        "gravity": ["0,0,0"],
        "motion": ["table3"],
        "mjcf": ["cables.xml"],
    },
    "control": {"delay": ["0.02"], "lag": ["0.01"]},
}
ALWAYS = {"tunnel": ["--mouth=1.25,0.08,0.08", "--depth=0.04", "--step=0.02"]}  # else it refuses
QUICK = {
    "attitude": ["--samples=4", "--margin=force_margin"],
    "reach": ["--duration=2", "--dt=0.05"],
    "motion": ["--rate=50"],
    "traction": ["--friction=0.5"],
}
SMALL = {
    "attitude": {"samples": 4},
    "reach": {"duration": 2.0, "dt": 0.05},
    "traction": {"friction": "0.5"},
}
NO_NUMBER = re.compile(r"(?<![\w-])(?:nan|inf|NaN|Infinity)(?![\w-])")


@cache
def robot_of(preset: str) -> Robot:
    """Returns a preset as it is committed."""
    return load(GENERATED / preset / f"{preset}.urdf")


def filled(value: str, robot: Robot, folder: Path) -> str:
    """Returns a value with what depends on the robot filled in; files are written."""
    last = list(robot.modules.lengths)[-1] if robot.modules.lengths else robot.root_link
    if value == "ALONG":
        names = robot.chain_joints
        rows = [",".join(["time", *names]), ",".join(["0"] * (len(names) + 1))]
        rows.append(",".join(["1", *["0.1"] * len(names)]))
        (folder / "along.csv").write_text("\n".join(rows) + "\n")
        return str(folder / "along.csv")
    if value == "OBSTACLES":
        (folder / "obstacles.yaml").write_text(
            "obstacles: [{centre: [3, 0, 0], half: [0.1, 0.1, 0.1]}]\n"
        )
        return str(folder / "obstacles.yaml")
    if value == "POINTS":
        (folder / "points.csv").write_text("1.25,0.08,0.08\n1.3,0.08,0.08\n1.32,0.08,0.08\n")
        return str(folder / "points.csv")
    if value == "THRUST":
        return ",".join(["5"] * max(len(robot.rotors.body), 1))
    if value == "VELOCITY":
        return ",".join(["0.1"] * robot.model.nv)
    return value.replace("LAST", last)


def cases() -> list[tuple[str, str, str | None, str]]:
    """Returns (preset, analysis, option, value), the option None for none."""
    out: list[tuple[str, str, str | None, str]] = []
    for command, entry in catalogue().items():
        module = entry.load()
        fits = [p for p in PRESETS if module.applies(robot_of(p))]
        options = VALUES.get(command, {})
        given = [(k, v) for k in entry.options for v in options.get(k, [])]
        for i, (option, value) in enumerate(given):
            chosen = PRESETS if FULL else fits[i % 2 : i % 2 + 1] or fits[:1]
            out += [(preset, command, option, value) for preset in chosen]
    return out


def arguments(command: str, option: str | None, value: str) -> list[str]:
    """Returns the options of a run; what is always needed first, unless the option names it."""
    more = [*ALWAYS.get(command, []), *QUICK.get(command, [])]
    if option is None:
        return more
    flag = f"--{option.replace('_', '-')}"
    kept = [a for a in more if a.partition("=")[0] != flag]
    if option == "path" and command == "tunnel":
        kept = [a for a in kept if not a.startswith("--mouth")]
    return [*kept, flag if value == "" else f"{flag}={value}"]


def fault(ran) -> str:
    """Returns what is wrong with one run: "" for exit 0 with figures, or 1 with one line."""
    if ran.code == 0:
        bad = NO_NUMBER.search(ran.out)
        return f"prints {bad[0]}: {ran.out}" if bad else ""
    lines = [line for line in ran.err.splitlines() if line.startswith("Error: ")]
    if ran.code != 1 or len(lines) != 1 or "Traceback" in ran.err:
        return f"exit {ran.code}: {ran.err}"
    return f"refuses with {lines[0]}" if NO_NUMBER.search(lines[0]) else ""


def test_every_option_has_a_value() -> None:
    """A new option or analysis belongs into `VALUES`."""
    named = {c: set(e.options) for c, e in catalogue().items() if e.options}
    assert {c: set(v) for c, v in VALUES.items()} == named


@pytest.mark.parametrize("preset", PRESETS)
def test_every_option_of_every_analysis(preset, run, tmp_path, monkeypatch) -> None:
    """The robot is read once a preset; whatever an option does, its page has figures or none."""
    robot = robot_of(preset)
    monkeypatch.setattr("snakegen.robot.robot.load", lambda *_, **__: robot)
    quick = partial(worst_posture, samples=8, starts=1, tolerance=0.05)
    monkeypatch.setattr("snakegen.analysis.statics.worst_posture", quick)
    faults: list[str] = []
    for name, command, option, value in cases():
        if name != preset:
            continue
        given = arguments(command, option, filled(value, robot, tmp_path))
        try:
            wrong = fault(run("analyze", command, f"{preset}.urdf", *given))
        except Exception as error:
            wrong = repr(error)
        faults += [f"{command} {given}: {wrong}"] if wrong else []
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("preset", PRESETS)
def test_pages_and_json_of_every_analysis(preset) -> None:
    """Rows without NaN or infinity, JSON that a strict parser reads; each analysis runs once."""
    robot = robot_of(preset)
    q = hover_gimbals(robot, robot.configuration())
    for command, entry in catalogue().items():
        module = entry.load()
        if command in ("tunnel", "along") or not module.applies(robot):
            continue
        result = module.analyze(robot, q, **SMALL.get(command, {}))
        for label, text in result.rows():
            assert not NO_NUMBER.search(f"{label} {text}"), (command, label, text)
        json.dumps(plain(result.to_json()), allow_nan=False)


@pytest.mark.parametrize("preset", PRESETS)
def test_an_analysis_that_does_not_apply_says_so(preset, run, monkeypatch) -> None:
    robot = robot_of(preset)
    monkeypatch.setattr("snakegen.robot.robot.load", lambda *_, **__: robot)
    for command, entry in catalogue().items():
        if not entry.load().applies(robot):
            ran = run("analyze", command, f"{preset}.urdf")
            assert ran.code == 1 and "does not apply" in ran.err and not fault(ran), command


def test_options_are_read_from_signature_and_docstring() -> None:
    """Name, type, default and meaning come from `analyze` alone; a name it lacks is an error."""
    margin = catalogue()["margin"].options
    assert margin["tolerance"] == (1e-3, float, "relative gap of the certified vectored margins")
    assert margin["failures"].kind is bool and margin["failures"].default is False
    statics = catalogue()["statics"].options
    assert statics["gravity"].default == "0,0,-9.81" and statics["gravity"].kind is str
    assert catalogue()["cables"].options["count"][:2] == (None, int)
    assert catalogue()["reach"].options["obstacles"].default is None
    for entry in catalogue().values():
        given = set(signature(entry.load().analyze).parameters)
        assert given >= set(entry.options) and all(o.meaning for o in entry.options.values())
    wrong = ast.parse(
        'def analyze(robot, q, a=1):\n    """X.\n\n    Options:\n        b: c\n    """'
    )
    with pytest.raises(ValueError, match="no argument 'b'"):
        read_options(wrong, "x.py")
