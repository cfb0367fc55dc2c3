"""A drive's pipe from the scene file that planners read."""

from pathlib import Path

import pytest

from snakegen.errors import MissionError
from snakegen.simulation.missions.drive.pipe import Options, of_scene


def scene(folder: Path, obstacle: str) -> Path:
    path = folder / "s.yaml"
    path.write_text(f"obstacles: [{obstacle}]", encoding="utf-8")
    return path


def test_entry_length_and_room_are_the_scenes(tmp_path: Path) -> None:
    way = "{name: p, kind: pipe, points: [[0.3, 0, 0.08], [1.1, 0, 0.08]], radius: 0.08}"
    found = of_scene(Options(speed=0.05), scene(tmp_path, way), drum=0.075)
    assert (found.entry, found.speed) == (0.3, 0.05)
    assert found.length == pytest.approx(0.8) and found.room == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("obstacle", "message"),
    [
        ("{centre: [1, 0, 1], size: [0.1, 1, 1]}", "no obstacle of kind pipe"),
        ("{kind: pipe, points: [[0.3, 0, 0.2], [1, 0, 0.2]], radius: 0.08}", r"\[x0, 0, 0\.08\]"),
        ("{kind: pipe, points: [[1, 0, 0.1], [0.3, 0, 0.1]], radius: 0.1}", "0 ≤ x0 < x1"),
    ],
)
def test_pipes_that_no_drive_enters_are_refused(
    tmp_path: Path, obstacle: str, message: str
) -> None:
    with pytest.raises(MissionError, match=message):
        of_scene(Options(), scene(tmp_path, obstacle), drum=0.075)
