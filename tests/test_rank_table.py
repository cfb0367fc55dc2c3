"""THEORY A3's table, all rows, from the package's own analyses: ranks exact, margins as printed."""

import pytest

from benchmarks.rank_table import Row, row

TABLE = [
    Row(1, "straight", (2, 2, 2), 3, (3, 3), 44.4, 0.0, 0.0),
    Row(2, "straight", (4, 3, 3), 5, (5, 5), 88.8, 0.0, 0.0),
    Row(2, "planar", (4, 3, 3), 5, (5, 6), 88.8, 0.0, 0.0),
    Row(2, "spatial", (4, 4, 3), 5, (5, 6), 88.8, 0.0, 0.0),
    Row(3, "straight", (4, 3, 3), 5, (5, 5), 133.1, 0.0, 0.0),
    Row(3, "planar", (4, 4, 3), 6, (6, 6), 133.1, 8.07, 0.323),
    Row(3, "spatial", (4, 4, 3), 6, (6, 6), 133.1, 6.30, 0.253),
    Row(4, "straight", (4, 3, 3), 5, (5, 5), 177.5, 0.0, 0.0),
    Row(4, "planar", (4, 4, 3), 6, (6, 6), 177.5, 27.96, 0.794),
    Row(4, "spatial", (4, 4, 3), 6, (6, 6), 177.5, 23.37, 0.678),
    Row(5, "straight", (4, 3, 3), 5, (5, 5), 221.9, 0.0, 0.0),
    Row(5, "planar", (4, 4, 3), 6, (6, 6), 221.9, 47.5, 1.116),
    Row(5, "spatial", (4, 4, 3), 6, (6, 6), 221.9, 42.3, 0.993),
]


@pytest.mark.parametrize("wanted", TABLE, ids=lambda r: f"{r.apparatuses}-{r.posture}")
def test_row(wanted: Row) -> None:
    found = row(wanted.apparatuses, wanted.posture)
    assert (found.dual, found.force, found.jacobian) == (wanted.dual, wanted.force, wanted.jacobian)
    assert found.force_margin == pytest.approx(wanted.force_margin, abs=0.05)
    assert found.torque_margin == pytest.approx(wanted.torque_margin, abs=0.05, rel=1e-3)
    assert found.wrench_margin == pytest.approx(wanted.wrench_margin, abs=5e-4, rel=1e-3)
