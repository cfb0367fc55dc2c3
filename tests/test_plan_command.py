"""`snakegen plan` as people meet it: plan, exit codes, refusals that say what would do."""

import json
from pathlib import Path

import pytest

from snakegen.base import yaml_file
from snakegen.planning.plan_file import read_plan

WALL = """
obstacles:
  - name: wall
    centre: [0, 0, 1.2]
    size: [0.06, 3.6, 2.4]
    openings: [{{centre: [0, -0.1], size: [{size}, {size}]}}]
start: {start}
goal: {goal}
"""


def scene(folder: Path, size: float = 0.9, start: str = "{below: wall}", goal: str = "") -> str:
    path = folder / "wall.yaml"
    text = WALL.format(size=size, start=start, goal=goal or "{above: wall}")
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_plan_is_certified_and_written(run, tmp_path: Path) -> None:
    out = tmp_path / "plan.yaml"
    result = run("plan", "dragon4", scene(tmp_path), "-o", str(out), "--json", "--minutes", "10")
    assert result.code == 0, result.err
    found = json.loads(result.out)
    assert found["certified"] and found["unmet"] == []
    assert found["certificate"]["clearance_m"]["lower_bound"] >= 0.03
    file = read_plan(yaml_file.read(out), "plan.yaml")
    assert file.robot == "dragon4" and len(file.path.times) == found["waypoints"]


@pytest.mark.parametrize(
    ("robot", "options", "message"),
    [
        ("arm6", {}, "arm6 does not fly"),
        ("dragon4", {"start": "{cog: [-2, 0, 0.05]}"}, "start: vectoring apparatus"),
        ("dragon4", {"start": "{cog: [-2, 0, 1.2], joints: {joint1_yaw: 0}}"}, "margins|margin"),
        ("dragon4", {"start": "{below: wall, joints: {joint1_yaw: 0}}"}, "start: dragon4 cannot"),
        ("dragon4", {"goal": "{cog: [2, 0, 1.2], joints: {joint9: 0}}"}, "no driven joint"),
        ("dragon4", {"size": 0.03}, "no way from start to goal, even for a single rod: wall"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(
    run, tmp_path: Path, robot: str, options: dict[str, object], message: str
) -> None:
    out = tmp_path / "plan.yaml"
    place = scene(tmp_path, **options)  # type: ignore[arg-type]
    result = run("plan", robot, place, "-o", str(out), "--minutes", "0.02")
    assert result.code == 1
    lines = [x for x in result.err.splitlines() if x.startswith("Error:")]
    assert len(lines) == 1 and any(m in lines[0] for m in message.split("|")), result.err
    assert not out.exists()


def test_the_example_is_a_scene_and_replaces_nothing(run, tmp_path: Path) -> None:
    path = tmp_path / "my.yaml"
    assert run("plan", "dragon4", str(path), "--example").code == 0
    assert "demands:" in path.read_text(encoding="utf-8")
    again = run("plan", "dragon4", str(path), "--example")
    assert again.code == 1 and "is there already" in again.err


def test_the_example_is_printed_where_no_file_is_named(run) -> None:
    printed = run("plan", "--example")
    assert printed.code == 0 and "obstacles:" in printed.out
    missing = run("plan", "dragon4")
    assert missing.code == 1 and "--example" in missing.err
