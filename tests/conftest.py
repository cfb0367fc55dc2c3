"""What tests share: a run of `snakegen …` in this process, and the order of the files.

Files that fly, drive or move whole missions are marked `flight`; they come first, so that the quick
ones fill what is left of the time of each worker (`--no-loadscope-reorder`).
"""

from pathlib import Path

import pytest

from snakegen.cli import main

# The longest first; a new file of flights belongs here.
FLIGHTS = [
    "readme", "drive_missions", "drive_terrain", "every_option", "force_sets", "push",
    "missions", "motion_runs", "traction", "vibration", "drive_trials", "monte_carlo", "gust",
    "trim", "flight_bounds", "elastic", "arm_trials", "arm_plant", "verify_plant",
    "verify_loop", "run", "outcome", "before_flight", "strain", "rate_filter", "jointless",
    "tunnel", "battery", "worst_place", "margins_along", "streamed_flight",
    "control_without_gimbals", "falling", "flight_torques", "hover_limits", "measured",
    "foreign", "api", "adopt", "journal", "reference_limits", "flight_memory", "sweep_storage",
    "interrupts",
]  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks the files of `FLIGHTS` and puts them first."""
    place = {f"test_{name}.py": i for i, name in enumerate(FLIGHTS)}
    for item in items:
        if item.path.name in place:
            item.add_marker("flight")
    items.sort(key=lambda item: place.get(item.path.name, len(place)))


class Ran:
    """What a run left: exit code, stdout and stderr."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Runs `snakegen …` in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Ran:
        with pytest.raises(SystemExit) as caught:
            main(arguments)
        captured = capsys.readouterr()
        return Ran(int(caught.value.code or 0), captured.out, captured.err)

    return call
