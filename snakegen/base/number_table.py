"""Tables of numbers in one format, in and out: CSV, Parquet or YAML, by the file's ending.

A CSV file's first line names its columns; where the reader knows them (x,y,z) it may be left out.
Empty lines and lines that begin with ``#`` are passed over. A YAML table is a mapping of columns,
``{time: [0, 1], joint1_yaw: [0, 0.5]}``, or a list of rows, ``[{time: 0, joint1_yaw: 0}, …]``.
"""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base import yaml_file
from snakegen.base.atomic_io import replace_whole, require_suffix, write_atomically
from snakegen.base.bounded_text import what_is_there
from snakegen.base.memory import refuse_beyond
from snakegen.errors import AnalysisError, near

Floats = NDArray[np.float64]
ENDINGS = (".csv", ".parquet", ".yaml", ".yml")
FORMATS = "CSV, Parquet or YAML, a header naming its columns"  # for help texts
_MOST_TEXT = 100_000_000  # bytes of a CSV file, whose cells take some ten times as many
DIGITS = 9  # significant, of numbers written as text


@dataclass(frozen=True, repr=False)
class NumberTable:
    """Columns of numbers, converted and checked when they are asked for.

    Attributes:
        name: of the file, for errors.
        columns: cells by column: text of CSV files, values of others.
        places: of each row in the file, for errors: its line where it is text.
    """

    name: str
    columns: Mapping[str, Sequence[Any]]
    places: Sequence[str]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.columns)

    def __len__(self) -> int:
        """Returns the number of rows."""
        return len(self.places)

    def __repr__(self) -> str:
        """Returns name, size and columns."""
        return f"NumberTable({self.name}: {len(self)} rows of {', '.join(self.names)})"

    def column(self, name: str) -> Floats:
        """Returns the column `name` (m,).

        Raises:
            AnalysisError: no such column, or a cell that is not a finite number, with its line.
        """
        if name not in self.columns:
            raise AnalysisError(f"{self.name} has no column '{name}'.{near(name, self.columns)}")
        cells = self.columns[name]
        if isinstance(cells, np.ndarray) and cells.dtype.kind in "iuf":
            out = cells.astype(np.float64)
        else:
            out = np.array([_number(cell) for cell in cells])
        bad = np.flatnonzero(~np.isfinite(out))
        if bad.size:
            k = int(bad[0])
            raise AnalysisError(
                f"{self.name}, {self.places[k]}: {name} is '{cells[k]}', not a finite number."
            )
        return out

    def stack(self, names: Sequence[str]) -> Floats:
        """Returns the columns `names` side by side (m, k)."""
        return np.stack([self.column(name) for name in names], axis=1)


def _number(cell: Any) -> float:
    if isinstance(cell, bool | np.bool_):
        return float("nan")
    try:
        return float(cell)
    except (TypeError, ValueError):
        return float("nan")


def read_number_table(path: str | Path, columns: Sequence[str] = ()) -> NumberTable:
    """Reads a table of numbers.

    Args:
        path: a file that ends in .csv, .parquet, .yaml or .yml.
        columns: names of a CSV file's columns where its first line is numbers already; without
            them a header is needed.

    Raises:
        AnalysisError: a file that cannot be read, another ending, no header, rows of unlike length,
            a name that stands twice; with the line.
    """
    file = Path(path)
    readers: dict[str, Callable[[Path, Sequence[str]], NumberTable]] = {
        ".csv": _from_csv,
        ".parquet": _from_parquet,
        ".yaml": _from_yaml,
        ".yml": _from_yaml,
    }
    if file.suffix.lower() not in readers:
        raise AnalysisError(f"{file}: a table's file name ends in {', '.join(ENDINGS)}.")
    if not file.is_file():
        raise AnalysisError(f"{file}: {what_is_there(file)}.")
    return readers[file.suffix.lower()](file, columns)


def _from_csv(path: Path, columns: Sequence[str]) -> NumberTable:
    size = path.stat().st_size
    if size > _MOST_TEXT:
        raise AnalysisError(
            f"{path}: {size / 1e6:.0f} MB; up to {_MOST_TEXT / 1e6:.0f} MB of CSV are read: write "
            "it as Parquet."
        )
    try:
        text = path.read_text(encoding="utf-8-sig").splitlines()
        rows = [(i + 1, r) for i, r in enumerate(csv.reader(text))]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise AnalysisError(f"{path}: cannot be read as CSV ({error}).") from None
    kept = [
        (line, [cell.strip() for cell in row])
        for line, row in rows
        if any(map(str.strip, row)) and not row[0].lstrip().startswith("#")
    ]
    head: Sequence[str] = columns
    if kept and not all(np.isfinite(_number(cell)) or cell == "nan" for cell in kept[0][1]):
        head = kept.pop(0)[1]
    elif kept and not columns:
        raise AnalysisError(
            f"{path.name}, line {kept[0][0]}: numbers; the first line must name the columns, as in "
            "time,joint1_yaw."
        )
    if not head:
        raise AnalysisError(f"{path.name} is empty.")
    for name in head:
        if not name:
            raise AnalysisError(f"{path.name}: its header has a column without a name.")
        if list(head).count(name) > 1:
            raise AnalysisError(f"{path.name}: its header names '{name}' twice.")
    for line, row in kept:
        if len(row) != len(head):
            raise AnalysisError(
                f"{path.name}, line {line}: {len(row)} entries for {len(head)} columns "
                f"({', '.join(head)})."
            )
    cells = {name: [row[k] for _, row in kept] for k, name in enumerate(head)}
    return NumberTable(path.name, cells, [f"line {line}" for line, _ in kept])


def _from_parquet(path: Path, _: Sequence[str]) -> NumberTable:
    import pyarrow as pa
    import pyarrow.parquet

    try:
        kept = pyarrow.parquet.read_metadata(path)
        size = 8.0 * kept.num_rows * kept.num_columns
        refuse_beyond(size, f"{path}: {kept.num_rows:,} rows", "fewer rows or columns would fit")
        table = pyarrow.parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise AnalysisError(f"{path}: cannot be read as Parquet ({reason}).") from None
    for name in table.column_names:
        if table.column_names.count(name) > 1:
            raise AnalysisError(f"{path.name}: its header names '{name}' twice.")
    cells = {name: table[name].to_numpy() for name in table.column_names}
    return NumberTable(path.name, cells, [f"row {k + 1}" for k in range(table.num_rows)])


def _from_yaml(path: Path, _: Sequence[str]) -> NumberTable:
    return table_of(path.name, yaml_file.read(path))


def table_of(name: str, data: Any) -> NumberTable:
    """Returns the table that a YAML file's `data` is.

    Raises:
        AnalysisError: neither a mapping of columns of one length nor a list of like rows.
    """
    form = "{time: [0, 1], joint1_yaw: [0, 0.5]} or [{time: 0, joint1_yaw: 0}, …]"
    if isinstance(data, list) and data and all(isinstance(row, dict) for row in data):
        head = list(data[0])
        for k, row in enumerate(data):
            if set(row) != set(head):
                raise AnalysisError(
                    f"{name}, row {k + 1}: columns {', '.join(map(str, row))}; the first row has "
                    f"{', '.join(map(str, head))}."
                )
        columns = {key: [row[key] for row in data] for key in head}
    elif isinstance(data, dict) and data and all(isinstance(c, list) for c in data.values()):
        columns = data
    else:
        raise AnalysisError(f"{name}: a YAML table is columns or rows, as in {form}.")
    lengths = {len(cells) for cells in columns.values()}
    if len(lengths) > 1:
        raise AnalysisError(f"{name}: its columns have {min(lengths)} to {max(lengths)} entries.")
    return NumberTable(name, columns, [f"row {k + 1}" for k in range(lengths.pop())])


def write_number_table(path: str | Path, columns: Mapping[str, ArrayLike]) -> Path:
    """Writes a table of numbers in the format of the file's ending, whole or not at all.

    Args:
        path: ends in .csv, .parquet, .yaml or .yml.
        columns: (m,) each, by name; text formats hold nine significant digits.

    Raises:
        SnakegenError: another ending, or a file that cannot be written.
    """
    file = Path(path)
    require_suffix(file, *ENDINGS)
    values = {name: np.asarray(cells, np.float64) for name, cells in columns.items()}
    if file.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet

        table = pa.table(values)
        replace_whole(file, lambda beside: pyarrow.parquet.write_table(table, beside))
        return file
    text = {name: [f"{x:.{DIGITS}g}" for x in cells] for name, cells in values.items()}
    if file.suffix == ".csv":
        rows = [",".join(values), *map(",".join, zip(*text.values(), strict=True))]
    else:
        rows = [f"{name}: [{', '.join(cells)}]" for name, cells in text.items()]
    write_atomically(file, "\n".join(rows) + "\n")
    return file
