"""Tables, options and postures of a sweep: what it takes, what it refuses in one line."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from snakegen.base.geometry import rotation_from_rpy
from snakegen.errors import AnalysisError
from snakegen.robot.robot import Robot, load
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.run import sweep
from snakegen.sweep.samples import chosen_joints, draw, read_postures


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load("dragon4")


def test_tables_of_a_person(robot: Robot, tmp_path: Path) -> None:
    names = robot.chain_joints
    low, high, _ = robot.limits(names)
    good = tmp_path / "good.csv"
    good.write_text(",".join(names) + "\n" + "\n".join("0.1,0.2,0.3,0.4,0.5,0.6" for _ in range(3)))
    assert read_postures(good, names, low, high).shape == (3, 6)
    cases = {
        "line 3: joint1_yaw is 'nan', not a finite number": "0,0,0,0,0,0\n0,nan,0,0,0,0",
        "line 2: joint1_pitch = 9 is outside": "9,0,0,0,0,0",
        "has no rows": "",
    }
    for message, rows in cases.items():
        bad = tmp_path / "bad.csv"
        bad.write_text(",".join(names) + "\n" + rows + "\n")
        with pytest.raises(AnalysisError, match=message):
            read_postures(bad, names, low, high)
    with pytest.raises(AnalysisError, match="has no column 'joint1_pitch'"):
        bad.write_text("a,b\n1,2\n")
        read_postures(bad, names, low, high)
    with pytest.raises(AnalysisError, match="no such file"):
        read_postures(tmp_path / "none.parquet", names, low, high)


def test_bad_requests_are_one_line(robot: Robot) -> None:
    with pytest.raises(AnalysisError, match="Did you mean 'joint1_yaw'"):
        chosen_joints(robot, "joint1_yav")
    with pytest.raises(AnalysisError, match="is a gimbal"):
        chosen_joints(robot, "gimbal1_roll")
    with pytest.raises(AnalysisError, match="between 1 and"):
        draw("sobol", 0, 0, np.zeros(2), np.ones(2))
    with pytest.raises(AnalysisError, match="needs rotors"):
        Body.of(load("arm6"), ("joint1_pitch",), np.eye(3), 1e-3)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--margin", "force_margn"], "Did you mean 'force_margin'"),
        (["--base-rpy", "nan,0,0"], "base_rpy: 'nan' is not a finite number"),
        (["--workers", "0"], "0 is not in the range"),
        (["--tolerance", "nan"], "tolerance is nan; it must be finite"),
        (["--samples", "0"], "between 1 and"),
        (["--joints", "joint1_yav"], "Did you mean 'joint1_yaw'"),
    ],
)
def test_bad_options_are_one_line_before_any_work(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from snakegen.cli import main

    out = tmp_path / "s.parquet"
    with pytest.raises(SystemExit) as left:
        main(["analyze", "sweep", "dragon4", "--samples", "4", "-o", str(out), *arguments])
    assert left.value.code in (1, 2)
    assert says in capsys.readouterr().err and not out.exists()


def test_joints_and_attitude_are_held(robot: Robot, tmp_path: Path) -> None:
    """A sweep of two joints with the others held is that of all joints with columns to match."""
    posture = robot.configuration(
        {"joint1_pitch": 0.3, "joint3_yaw": -0.7, "base_rpy": (0.2, 0, 0)}
    )
    names = chosen_joints(robot, None, posture.posture())
    assert set(names) == set(robot.chain_joints) - {"joint1_pitch", "joint3_yaw"}
    with pytest.raises(AnalysisError, match="cannot be varied too"):
        chosen_joints(robot, "joint1_pitch", posture.posture())
    rows = np.random.default_rng(3).uniform(-0.5, 0.5, (6, 2))
    chosen = ("joint1_yaw", "joint2_yaw")
    path = sweep(robot, chosen, rows, tmp_path / "held.parquet", posture=posture, workers=1)
    whole = np.zeros((6, len(robot.chain_joints)))
    for name, column in (
        *zip(chosen, rows.T, strict=True),
        ("joint1_pitch", 0.3),
        ("joint3_yaw", -0.7),
    ):
        whole[:, robot.chain_joints.index(name)] = column
    want = evaluate(
        Body.of(robot, robot.chain_joints, rotation_from_rpy((0.2, 0.0, 0.0)), 1e-3), whole
    )
    found = pq.read_table(path)
    for column in ("force_margin", "dual_torque_margin", "self_distance"):
        np.testing.assert_allclose(found[column], want[column], rtol=1e-12)
