"""What a flight tells: promise and outcome in words, pages and legends of its log, exit codes."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import snakegen
from snakegen.cli import cli
from snakegen.cli import flight as command
from snakegen.control.power import battery_joules
from snakegen.errors import MissionError
from snakegen.log import layout, plots, read
from snakegen.log.events import merged
from snakegen.log.scene import scene
from snakegen.robot.robot import load
from snakegen.simulation import monte_carlo
from snakegen.simulation.flight.run import prepare, run
from snakegen.simulation.recording.recording import Event, Recording
from snakegen.simulation.recording.summary import outcome
from snakegen.spec.loading import load_spec

PATH = """
waypoints:
  - {time: 0, position: [0, 0, 1.5], joints: {joint1_yaw: 1, joint2_yaw: 1, joint3_yaw: 1}}
  - {time: 1, position: [0.1, 0, 1.5]}
"""


def call(*words: str) -> tuple[int, str]:
    """Returns the exit code of `analyze flight` with `words`, and what it printed."""
    found = CliRunner().invoke(cli, ["analyze", "flight", *words], standalone_mode=False)
    assert found.exception is None, found.exception
    return found.return_value, found.stdout


@pytest.fixture(scope="module")
def failed() -> Recording:
    """An apparatus is lost that hover needs; the flight ends before the body has left its hover."""
    options = {"lost": "apparatus2", "at": 0.2, "duration": 0.35}
    return run(snakegen.load("dragon4"), "fail", options=options)


def test_a_mission_files_log_is_named_by_its_stem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It goes where logs go, not beside the mission file, wherever that is."""
    monkeypatch.chdir(tmp_path)
    mission = tmp_path / "missions" / "mine.yaml"
    mission.parent.mkdir()
    mission.write_text(PATH, encoding="utf-8")
    code, said = call("dragon4", "--mission", str(mission), "--duration", "0.5")
    assert code == 0 and "log: generated/dragon4/mine.rrd" in said
    assert (tmp_path / "generated/dragon4/mine.rrd").is_file()
    assert [p.name for p in mission.parent.iterdir()] == ["mine.yaml"]


def test_the_form_of_a_mission_file_is_in_its_help() -> None:
    code, said = call("dragon4", "--mission", "path", "--option", "help")
    assert code == 0
    assert all(f"{word}:" in said for word in ("time", "position", "rpy", "joints"))
    assert "``" not in said


def test_a_loss_says_what_the_analysis_says(failed: Recording) -> None:
    """Level hover needs more than there is, yet a tilted body may bear it: so "fall" is not said.

    That level hover is out of reach is worked out here from the thrust points alone.
    """
    lines = outcome(failed.meta, failed.metrics)
    left = failed.meta["facts"]["predicted_wrench_margin"]
    assert left < 0 and lines == [
        f"lost: apparatus 2 on link2; scaled wrench margin without it {left:.3f}: it cannot hover "
        "level, says the analysis of the posture"
    ]
    assert f"- {lines[0]}" in failed.report and "fall" not in failed.report
    assert _least_thrust(0.0) > 32.0 > _least_thrust(0.667)  # rad, at which the flight ends up


def _least_thrust(pitch: float) -> float:
    """Returns the least max |f| [N] of three vectored thrusts that hover dragon4, pitched."""
    from scipy.optimize import minimize

    from snakegen.analysis.allocation import allocation
    from snakegen.simulation.flight.postures import place, resting_joints

    robot = snakegen.load("dragon4")
    q = place(robot, resting_joints(robot, None), np.array([0.0, 0.0, 1.5]))
    points = np.delete(allocation(robot, q).thrust_points, 1, axis=0)
    up = robot.mass * 9.81 * np.array([-np.sin(pitch), 0.0, np.cos(pitch)])
    a = np.zeros((6, 9))
    for i, (x, y, z) in enumerate(points):
        a[:3, 3 * i : 3 * i + 3] = np.eye(3)
        a[3:, 3 * i : 3 * i + 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    wanted = np.concatenate([up, np.zeros(3)])
    one = np.linalg.lstsq(a, wanted, rcond=None)[0]
    assert np.allclose(a @ one, wanted)
    free = np.linalg.svd(a)[2][np.linalg.matrix_rank(a) :].T

    def largest(y: np.ndarray) -> float:
        return float(np.linalg.norm((one + free @ y).reshape(3, 3), axis=1).max())

    starts = np.random.default_rng(0).normal(scale=5.0, size=(3, free.shape[1]))
    return min(minimize(largest, y, method="Nelder-Mead").fun for y in starts)


def test_a_failed_flight_tells_its_events_once(failed: Recording, tmp_path: Path) -> None:
    from snakegen.cli.outcome import result_json, result_lines

    told = "\n".join(result_lines(failed, tmp_path))
    assert not failed.verdict.passed  # type: ignore[union-attr]
    assert "0.20 s  apparatus 2 on link2 lost" in told
    assert result_json(failed, tmp_path)["facts"]["lost"] == "apparatus2"
    many = tuple(Event(0.1 * i, "WARN", "again") for i in range(30))
    assert "0.00 s  again (30 times until 2.90 s)" in "\n".join(result_lines(failed.__class__(
        failed.time, failed.channels, many, failed.meta
    ), tmp_path))  # fmt: skip


def test_events_that_repeat_without_a_pause_are_one() -> None:
    """Another text between them parts nothing; a pause of more than a second does."""
    times = (0.0, 0.4, 1.4, 3.0, 3.5)
    events = [Event(t, "WARN", "low") for t in times] + [Event(0.2, "INFO", "now")]
    assert [tuple(e) for e in merged(reversed(events))] == [
        (0.0, "WARN", "low (3 times until 1.40 s)"),
        (0.2, "INFO", "now"),
        (3.0, "WARN", "low (2 times until 3.50 s)"),
    ]


def test_words_of_the_other_missions() -> None:
    forecast = {"link": "link2", "stopped": ["joint1_yaw"]}
    push = {"predicted_wrench": [-3.0, 4.0, 0.0, 0.0, 0.0, 0.0], "ratio": 1.02}
    push |= {"lost_wrench": [-3.06, 4.08, 0.0, 0.0, 0.0, 0.0], "lost_s": 30.0}
    first, second = outcome({"facts": {"forecast": forecast}}, push)
    assert first == (
        "predicted limit: 5 N along -0.60 +0.80 +0.00 on link2; there at its limit: joint1_yaw"
    )
    assert second == (
        "measured limit: 5.1 N along -0.60 +0.80 +0.00 at 30.00 s, 1.020 of the prediction"
    )
    push["lost_wrench"] = None
    assert "held to the end of the ramp" in outcome({"facts": {"forecast": forecast}}, push)[1]
    steps = [{"axis": "z", "size": 0.5}, {"axis": "roll", "size": 0.2}]
    found = {"rise_z_s": 1.0, "overshoot_z": 0.3, "settling_z_s": None}
    lines = outcome({"facts": {"steps": steps}}, found)
    assert lines == ["step of 0.5 m in z: rise 1.00 s, overshoot 30.0 %, not settled"]
    assert outcome({"facts": {}}, {"carried_off_m": 0.1, "recovery_s": None}) == [
        "carried off 0.100 m, did not come back"
    ]
    blown = {"carried_off_m": 0.1, "recovery_s": 1.0}
    assert outcome({"options": {"turbulence": 1.5}}, blown) == [
        "carried off 0.100 m by gust and turbulence"
    ]
    assert outcome({}, {"opening_m": 0.5, "span_over_opening": 2.0})
    assert not outcome({"facts": None}, {"battery_used": 0.99})


def test_an_empty_battery_is_named() -> None:
    """A robot that falls for want of charge is told so, not by its errors alone."""
    fallen = run(
        snakegen.load(load_spec("dragon4", overrides=("plant.battery_energy=1.18",))),
        "hover",
        options={"duration": 1.6},
    )
    assert fallen.verdict is not None and not fallen.verdict.passed
    assert "- the battery ran empty on the way: then the rotors stop" in fallen.report
    told = [e for e in fallen.events if e.text == "battery empty: the rotors stop"]
    assert len(told) == 1 and told[0].level == "WARN" and 0.8 < told[0].time < 1.2
    assert fallen.metrics["battery_empty_s"] == pytest.approx(told[0].time, abs=0.06)


@pytest.mark.parametrize("mission", ["hover", "gust"])
def test_battery_and_energy_are_those_of_the_mission(mission: str) -> None:
    """A hover for trim drains nothing that the mission then lacks."""
    robot = snakegen.load("dragon4")
    flown = run(robot, mission, options={"duration": 3.5, "trim": 6.0})
    used, time = flown.channel("battery_used").values[:, 0], flown.times("battery_used")
    assert time[0] < -5.0 and time[-1] > 3.3
    over = flown.metrics["duration_s"] / time[-1]  # the battery is sampled more seldom
    share = flown.metrics["energy_j"] / battery_joules(213.0)
    assert flown.metrics["battery_used"] * over == pytest.approx(share, rel=5e-3)
    assert flown.metrics["battery_used"] == pytest.approx(time[-1] / 180.0, rel=0.1)
    assert used[time < 0].max() == 0.0 < used[-1]


def test_pages_name_what_a_flight_logs(failed: Recording) -> None:
    """No curve of a flight is left over for the last page; the φ servos' load is an actuator's."""
    pages = dict(layout.PAGES)
    shown = set(plots.groups(plots.series(failed)))
    assert shown <= {group for groups in pages.values() for group in groups}
    assert {"roll moment", "battery"} <= shown & set(pages["Actuators"])
    assert "wind" in pages["Safety"]
    assert scene(failed).rotors


def test_no_two_curves_of_a_plot_have_one_name(failed: Recording) -> None:
    shown = plots.series(failed)
    for group in plots.groups(shown):
        names = [n for s in shown if s.group == group for n in plots.legend(s, shown)]
        assert len(set(names)) == len(names), group


def test_interrupted_trials_have_not_passed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was flown is told and the worst logged, with its draw; the exit code is 130."""

    class Stopping(command.progress_bar):
        def __enter__(self):
            def step(done: int, _total: int) -> None:
                if done >= 2:
                    raise KeyboardInterrupt

            return step

    monkeypatch.setattr(command, "progress_bar", Stopping)
    log = tmp_path / "worst.rrd"
    asked = ("dragon4", "--duration", "0.3", "--trials", "40", "--workers", "1", "-o", str(log))
    code, said = call(*asked, "--json")
    out = json.loads(said)
    assert code == 130 and out["trials"] < 40 and out["survival"] == 1.0 and not out["passed"]
    worst = read(log)
    assert f"Trial {out['worst']['number']}, drawn: mass" in worst.report
    code, said = call(*asked)
    assert code == 130 and "were asked for; kept: the " in said


def test_trials_interrupted_before_the_first_is_finished_end_as_ctrl_c_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing is kept, and no error of the mission is blamed."""

    def wait(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(monte_carlo, "wait", wait)
    ready = prepare(load("dragon4"), "hover", options={"duration": 0.2})
    with pytest.raises(KeyboardInterrupt):
        monte_carlo.monte_carlo(ready, 3, workers=1)


def test_the_arrows_are_inside_the_view(failed: Recording) -> None:
    """The view's middle is that of all heights from the lowest joint to the longest arrow's tip."""
    view = scene(failed)
    body = view.skeleton.body_line(view.base, view.angles)  # type: ignore[union-attr]
    thrust = failed.held("thrust", view.time).max(axis=1)
    tips = body.max(axis=1)[:, 2] + view.newton * thrust
    lowest = min(body[..., 2].min(), view.ghost[..., 2].min())
    assert view.center[2] >= 0.5 * (lowest + tips.max()) - 1e-9
    assert tips.max() <= view.center[2] + view.radius


def test_a_picture_is_of_what_is_judged(failed: Recording) -> None:
    """Not of the hover before it, in which a robot only trims itself."""
    from dataclasses import replace

    from snakegen.log.picture import _instant

    late = replace(failed, meta=failed.meta | {"metrics_window_s": [0.1, 0.3]})
    assert _instant(late, None, Path("a.rrd")) == pytest.approx(0.2)
    assert _instant(late, 0.1, Path("a.rrd")) == 0.1
    whole = replace(failed, meta={})
    ends = float(failed.time[0] + failed.time[-1])
    assert _instant(whole, None, Path("a.rrd")) == pytest.approx(0.5 * ends)


def test_a_choice_that_a_mission_does_not_take_is_refused() -> None:
    for words in (["--gains", "paper"], ["--allocator", "constrained"]):
        words = ["analyze", "flight", "screw4", "--mission", "square", *words]
        found = CliRunner().invoke(cli, words, standalone_mode=False)
        assert isinstance(found.exception, MissionError)
        assert "'square' has a loop of its own" in str(found.exception)


def test_the_worst_trial_is_opened_when_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Path] = []
    monkeypatch.setattr("snakegen.log.view", lambda path: opened.append(Path(path)))
    log = tmp_path / "worst.rrd"
    asked = ("dragon4", "--duration", "0.2", "--trials", "1", "-o", str(log), "--open")
    assert call(*asked)[0] == 0 and opened == [log]
