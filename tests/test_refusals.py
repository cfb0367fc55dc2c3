"""What the command line and its Python names refuse: one line that says what would have worked."""

import json
from pathlib import Path

import pytest

from snakegen.robot.robot import load

REFUSED = [
    ("build dragn4", 1, "no preset and no file 'dragn4'. Did you mean 'dragon4'"),
    ("build dragon4 --set chain.lnks=6", 1, "dragon4.yaml has no field 'chain.lnks'. Did you mean"),
    ("build dragon4 --apparatus 9", 1, "Error: --apparatus: link 9 does not exist; the chain has"),
    ("build dragon4 --links 0", 1, "Error: --links: input should be greater than or equal to 1"),
    ("build dragon4 --set chain.length=nan", 1, "Error: --set 'chain.length': input should be a"),
    ("build dragon4 --links 3 --apparatus 4", 1, "Error: --apparatus: link 4 does not exist"),
    (
        "build dragon4 --links 3 --set payload.mass=1",
        1,
        "--links, --set payload.mass: 'payload.at'",
    ),
    ("build wrong.yaml --set chain.mass=1", 1, "Error: wrong.yaml: 'chain.links': input should"),
    ("build clock.yaml", 1, "clock.yaml: 'chain.length': input should be a valid number"),
    ("build dragon4 --set chain.length=1:30", 1, "as a number (got '1:30')"),
    ("build dragon4 --set chain.length=yes", 1, "as a number (got 'yes')"),
    ("build dragon4 --set name=rü", 1, "letters (a to z, A to Z), digits and _ are needed"),
    ("build /dev/null", 1, "/dev/null: is a device, not a file"),
    ("build dragon4 --save-spec x.txt", 1, "--save-spec x.txt: the file's name must end in .yaml"),
    ("build dragon4 --apparatus 1@1.5", 1, "'1@1.5' is off its link"),
    ("build dragon4 --set vectoring_apparatus.thrust_min=99", 1, "is not below thrust_max"),
    ("build body.urdf", 1, "is a URDF; this needs a preset or a spec file"),
    ("build dragon4 -o /proc/x", 1, "/proc/x: cannot be written"),
    ("build dragon4 --no-picture -o r --save-spec /proc/x.yaml", 1, "/proc/x.yaml: cannot be"),
    ("build", 2, "Missing argument 'ROBOT'"),
    ("build dragon4 --links many", 2, "'many' is not a valid integer"),
    ("build dragon4 --lnks 3", 2, "No such option"),
    ("anlyze dragon4", 2, "No such command 'anlyze'. Did you mean 'analyze'?"),
    ("analyze sttics dragon4", 2, "Did you mean 'statics'?"),
    ("analyze nothing.urdf", 1, "nothing.urdf: no such file"),
    ("analyze nothing.yaml", 1, "nothing.yaml: no such file"),
    ("analyze drgon4", 1, "Did you mean 'dragon4'"),
    ("analyze dragon4 --joint joint1_ya=1", 1, "Did you mean 'joint1_yaw'"),
    ("analyze dragon4 --joint joint1_yaw=9", 1, "is outside its limits -1.65 … 1.65"),
    ("analyze dragon4 --joint joint1_yaw", 1, "write name=value, as in joint1_yaw=0.5"),
    ("analyze dragon4 --joint joint1_yaw=x", 1, "write name=value, as in joint1_yaw=0.5"),
    ("analyze dragon4 --base-rpy 1,2", 1, "write three angles"),
    ("analyze dragon4 --base-rpy 1,2,x", 1, "base_rpy"),
    ("analyze arm6 --base-rpy 0,0,x", 1, "base_rpy"),
    ("analyze dragon4 --posture none.yaml", 1, "none.yaml: no such file"),
    ("analyze dragon4 --modules m.yaml", 1, "--modules goes with a URDF"),
    ("analyze drive dragon4", 1, "'drive' does not apply to dragon4; it needs: "),
    ("analyze actuation arm6", 1, "'actuation' does not apply to arm6; it needs: "),
    ("analyze flight dragon4 --mission xyzzy", 1, "there is no mission 'xyzzy'. Known: "),
    ("analyze flight dragon4 --mission hover --option x=1", 1, "has no option 'x'"),
    ("analyze flight dragon4 --mission hover --duration -1", 1, "more than 0 is needed"),
    ("analyze flight dragon4 --duration 1e9", 1, "dragon4: a run of 1e+09 s would take 8e+04 GB"),
    ("analyze flight screw4 --mission lcrank --duration inf", 1, "GB are free: a duration of "),
    ("analyze flight dragon4 --seed -5", 1, "--seed: -5 is not in the range; 0 or more"),
    ("analyze flight dragon4 --trials 2 --seed -5", 1, "--seed: -5 is not in the range; 0 or more"),
    ("analyze flight dragon4 --trials 0", 1, "--trials: 0 is not in the range; 1 or more"),
    ("analyze flight dragon4 --workers 0", 1, "--workers: 0 is not in the range; 1 or more"),
    (
        "analyze flight dragon4 --mission push --option force=yes",
        1,
        "'yes'; true or false is needed",
    ),
    ("analyze flight dragon4 --mission transform --option duration=x", 1, "'x' is not a number"),
    ("analyze flight dragon4 --mission gust --option force=[1]", 1, "force: [1] is not a number"),
    ("analyze flight dragon4 --option height=.nan", 1, "height: nan is not a number"),
    ("analyze flight dragon4 --option height=true", 1, "height: True is not a number"),
    ("analyze flight dragon4 --mission push --option link=3", 1, "dragon4 has no link '3'"),
    ("analyze flight dragon4 --mission gust --option direction=3", 1, "direction '3': x, y or z"),
    ("analyze flight dragon4 --set chain.mass=5", 1, "too heavy to fly: 239.0 N of weight"),
    ("analyze flight arm6 --mission hover", 1, "does not suit arm6; it needs"),
    ("build folder", 1, "folder: is a folder; a robot is a preset, a .yaml or a .urdf file"),
    ("build model.xml", 1, "is XML; this needs a preset or a spec file"),
    ("analyze folder.urdf", 1, "folder.urdf: is a folder"),
    (
        "analyze margin dragon4 --mass-error 2",
        1,
        "mass_error is 2; it must be a fraction in [0, 1)",
    ),
    (
        "analyze sweep dragon4 --map joint1_yaw",
        1,
        "write two joints, as in joint1_pitch,joint1_yaw",
    ),
    ("analyze sweep dragon4 --map joint1_yaw,jont", 1, "the sweep does not vary 'jont'."),
    ("analyze sweep dragon4 --seed -5", 1, "--seed: -5 is not in the range; 0 or more"),
    ("analyze sweep dragon4 --samples 0", 1, "--samples 0: between 1 and 50000000 postures"),
    (
        "analyze sweep dragon4 --joints a",
        1,
        "no joint 'a' to vary. Known: joint1_pitch, joint1_yaw,",
    ),
    ("analyze sweep dragon4 --margin foo", 1, "has no such margin. Known: wrench_margin, force_m"),
    ("analyze sweep dragon4 -o a.txt", 1, "-o a.txt: the file's name must end in .parquet"),
    ("analyze flight dragon4 -o a.txt", 1, "-o a.txt: the file's name must end in .rrd"),
    ("inspect none.rrd", 1, "none.rrd"),
    ("inspect spec.yaml", 1, "is not a rerun log"),
    ("inspect a.rrd --time 1", 1, "--time is the instant of a picture; it goes with --png"),
    ("inspect a.rrd b.rrd --png a.png", 1, "show one log"),
]


@pytest.mark.parametrize(("line", "code", "expected"), REFUSED, ids=[r[0] for r in REFUSED])
def test_refusals(line: str, code: int, expected: str, run, tmp_path: Path) -> None:
    """A mistake is one line `Error: …` on stderr, exit 1 (2 for usage), and nothing on stdout."""
    (tmp_path / "spec.yaml").write_text("name: x\n")
    (tmp_path / "wrong.yaml").write_text("name: x\nchain: {links: 0, length: 1, mass: 2}\n")
    (tmp_path / "clock.yaml").write_text("name: x\nchain: {links: 2, length: 1:30, mass: 2}\n")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder.urdf").mkdir()
    found = run(*line.split())
    assert found.code == code
    assert found.out == "" or "--save-spec" in line
    last = found.err.splitlines()[-1]
    assert last.startswith("Error: ") and expected in last
    assert "Traceback" not in found.err
    if code == 1:
        assert len(found.err.splitlines()) == 1
    assert not (tmp_path / "generated").exists()


def test_a_name_said_twice_helps_nobody(run) -> None:
    """Lists of what is known stand once and hold only what would be accepted."""
    margins = run("analyze", "sweep", "dragon4", "--margin", "foo").err
    assert margins.count("self_distance") == 1
    assert "gimbal" not in run("analyze", "sweep", "dragon4", "--joints", "a").err
    empty = run("build", "")
    assert (empty.code, empty.out) == (1, "")
    assert (
        empty.err == "Error: a robot's name is empty; a preset's name or a file's path would do.\n"
    )


def test_what_memory_holds_is_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The duration that a refusal names is one that passes; trials side by side share the room."""
    from snakegen.base import memory
    from snakegen.errors import AnalysisError
    from snakegen.simulation.flight.memory_check import refuse_too_long

    monkeypatch.setattr(memory, "available", lambda: 4_000_000_000)
    flying = load("dragon4")  # its times and what is made of a column: 80 kB a second, of half
    # an arm is held whole, 6 + 12 joints at 1 kHz: 7.2 MB a second
    for body, limit, fit in ((flying, 25000.0, (22500, 11250)), (load("arm6"), 277.8, (250, 125))):
        refuse_too_long(body, limit - 1.0)
        for at_once, most in zip((1, 2), fit, strict=True):
            with pytest.raises(AnalysisError, match=f"duration of {most} s would fit"):
                refuse_too_long(body, (limit + 1.0) / at_once, at_once)
            refuse_too_long(body, most, at_once)


def test_a_foreign_urdf_is_said_to_be_an_arm(run) -> None:
    """Without a <snakegen> element and --modules: one note on stderr; with either, none."""
    made = Path(run("build", "grasper3", "--no-picture").out.splitlines()[0])
    text = made.read_text()
    start, end = text.index("<snakegen"), text.index("</snakegen>") + len("</snakegen>")
    Path("foreign.urdf").write_text(text[:start] + text[end:])
    Path("none.yaml").write_text("apparatuses: []\n")
    told = run("analyze", "statics", "foreign.urdf", "--json")
    assert told.err.startswith("foreign.urdf has no <snakegen> element: read as an arm")
    assert "need --modules FILE" in told.err and json.loads(told.out)["robot"] == "grasper3"
    assert run("analyze", "statics", "foreign.urdf", "--modules", "none.yaml").err == ""
    assert run("analyze", "statics", str(made)).err == ""


def test_ctrl_c_of_a_sweep_says_how_to_go_on(run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts that are finished are kept and named; without any, the folder is as it was."""
    from snakegen.sweep import executors
    from snakegen.sweep import run as sweeping

    work, left = executors.work, [2]

    def interrupted(*given: object) -> object:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        return work(*given)

    monkeypatch.setattr(executors, "work", interrupted)
    monkeypatch.setattr(sweeping, "PART", 4)
    line = ["analyze", "sweep", "dragon4", "--samples", "12", "--workers", "1", "-o", "s.parquet"]
    found = run(*line)
    assert (found.code, found.out) == (130, "")
    assert found.err == (
        "Error: interrupted; parts finished so far (2) are kept in s.parquet.parts: "
        "the same command with --resume goes on from there.\n"
    )
    left[0] = 1  # all that is left to do
    resumed = run(*line, "--resume")
    assert resumed.code == 0 and Path("s.parquet").is_file()
    assert not Path("s.parquet.parts").exists()
    left[0] = 0
    assert run(*line).err.strip() == "Error: interrupted; files are as they were."
    assert not Path("s.parquet.parts").exists()


def test_mistakes_in_python_are_the_same_lines() -> None:
    """What is no robot and no posture is refused by name of its type, not with a TypeError."""
    import snakegen

    with pytest.raises(
        snakegen.SnakegenError, match=r"a robot is a preset's name.* not of type int"
    ):
        snakegen.load(3)
    with pytest.raises(snakegen.SnakegenError, match="a spec is plain data"):
        snakegen.load({"name": "x", "chain": {1, 2}})
    robot = load("grasper3")
    for posture in ([1, 2], [], 3):
        with pytest.raises(snakegen.SnakegenError, match="a posture is a mapping"):
            robot.configuration(posture)
    with pytest.raises(snakegen.SnakegenError, match="no joint '1'"):
        robot.configuration({1: 2.0})


def test_words_of_yaml_are_what_they_look_like() -> None:
    """Numbers and words by YAML 1.2's core schema; what is dumped reads back the same."""
    from snakegen.base import yaml_file

    text = ["1:30", "yes", "No", "on", "0x1F", "1_000", "2001-01-01", "<<", "1.2.3", "1e"]
    for word in text:
        assert yaml_file.parse(word, "test") == word
    read = {"010": 10, "-2": -2, "1e3": 1000.0, ".5": 0.5, "true": True, "~": None, "": None}
    for word, value in read.items():
        found = yaml_file.parse(word, "test")
        assert found == value and type(found) is type(value), word
    kept = [*text, *read, 1e16, 5e-324, -0.0, 3, True, None, float("inf")]
    assert list(map(repr, yaml_file.parse(yaml_file.dump(kept), "test"))) == list(map(repr, kept))
