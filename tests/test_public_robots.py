"""Public robots, where `SNAKEGEN_ROBOTS` names a folder of them (benchmarks/public_robots.py)."""

import os
from pathlib import Path

import pytest

import snakegen
from benchmarks.public_robots import examine, files, picked

FOLDER = os.environ.get("SNAKEGEN_ROBOTS")


@pytest.mark.slow
@pytest.mark.skipif(not FOLDER, reason="SNAKEGEN_ROBOTS names no folder of public robots")
def test_public_robots_are_what_pinocchio_and_mujoco_read(tmp_path: Path) -> None:
    outcomes = [examine(path, tmp_path) for path in files(Path(str(FOLDER)))]
    both = [o for o in outcomes if o.pinocchio and o.mujoco]
    assert len(outcomes) > 100 and len(both) > 60
    assert not [o.path for o in both if o.errors or o.refused]
    assert not [
        (o.path, o.torque_error) for o in outcomes if not o.refused and o.torque_error > 1e-9
    ]
    named = picked(outcomes)
    assert len(named) >= 20
    whole = 0
    for out in named:
        try:
            made = snakegen.convert(out.path, tmp_path / "whole")
        except snakegen.SnakegenError:
            continue
        assert snakegen.compare(out.path, made.mjcf).same, out.path
        whole += 1
    assert whole >= 20
