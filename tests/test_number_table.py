"""Tables of numbers: three formats say the same, and a fault is named with its line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snakegen.base.number_table import read_number_table, write_number_table
from snakegen.errors import AnalysisError, SnakegenError

COLUMNS = {"time": [0.0, 0.5, 2.0], "joint1_yaw": [0.1, -0.25, 1e-7]}


@pytest.mark.parametrize("ending", ["csv", "parquet", "yaml", "yml"])
def test_what_is_written_is_read(tmp_path: Path, ending: str) -> None:
    path = write_number_table(tmp_path / f"t.{ending}", COLUMNS)
    table = read_number_table(path)
    assert table.names == ("time", "joint1_yaw") and len(table) == 3
    for name, values in COLUMNS.items():
        np.testing.assert_allclose(table.column(name), values, rtol=1e-9)
    assert table.stack(["joint1_yaw", "time"]).shape == (3, 2)


@given(st.lists(st.floats(-1e300, 1e300), min_size=1, max_size=5))
def test_numbers_keep_nine_digits(tmp_path_factory: pytest.TempPathFactory, numbers) -> None:
    folder = tmp_path_factory.mktemp("t")
    for ending in ("csv", "yaml"):
        table = read_number_table(write_number_table(folder / f"t.{ending}", {"a": numbers}))
        np.testing.assert_allclose(table.column("a"), numbers, rtol=1e-8, atol=1e-300)


def test_headers_comments_and_rows(tmp_path: Path) -> None:
    """A known header may be left out; comments and empty lines are none; rows do as columns."""
    path = tmp_path / "p.csv"
    for text in (
        "1,2,3\n4,5,6\n",
        "# tip, m\nx, y, z\n\n1,2,3\n4,5,6\n",
        "\ufeffz,x,y\n3,1,2\n6,4,5",
    ):
        path.write_text(text, encoding="utf-8")
        found = read_number_table(path, ("x", "y", "z")).stack(("x", "y", "z"))
        np.testing.assert_array_equal(found, [[1, 2, 3], [4, 5, 6]])
    rows = tmp_path / "rows.yaml"
    rows.write_text("- {time: 0, a: 1}\n- {a: 2, time: 1}\n")
    np.testing.assert_array_equal(read_number_table(rows).column("a"), [1, 2])


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("t.csv", "time,a\n0,1\n\n1,x\n", "t.csv, line 4: a is 'x', not a finite number"),
        ("t.csv", "time,a\n0,inf\n", "line 2: a is 'inf'"),
        ("t.csv", "time,a\n0\n", r"line 2: 1 entries for 2 columns \(time, a\)"),
        ("t.csv", "a,a\n0,1\n", "names 'a' twice"),
        ("t.csv", "0,1\n", "the first line must name the columns"),
        ("t.csv", "", "is empty"),
        ("t.csv", "time,b\n0,1\n", "has no column 'a'"),
        ("t.yaml", "{time: [0, 1], a: [true, 0]}", "row 1: a is 'True'"),
        ("t.yaml", "{time: [0, 1], a: [1]}", "1 to 2 entries"),
        ("t.yaml", "- {time: 0, a: 1}\n- {time: 0}\n", "row 2: columns time; the first row has"),
        ("t.yaml", "{a: 1}", "columns or rows, as in"),
        ("t.parquet", "no Parquet", "cannot be read as Parquet"),
        ("t.xlsx", "", r"ends in .csv, .parquet, .yaml, .yml"),
    ],
)
def test_faults_are_one_line_with_their_place(
    tmp_path: Path, name: str, text: str, says: str
) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(AnalysisError, match=says) as caught:
        read_number_table(path).column("a")
    assert "\n" not in str(caught.value)
    with pytest.raises(AnalysisError, match="no such file"):
        read_number_table(tmp_path / "none.csv")
    with pytest.raises(SnakegenError, match="ends in"):
        write_number_table(tmp_path / "t.txt", COLUMNS)
    assert not (tmp_path / "t.txt").exists()
