"""The exact part of a log: a recording as one JSON header and one Parquet table a time axis.

Scalars that rerun plots are thinned to what an eye can see; these columns are the run, every
sample bit for bit. Parquet's BYTE_STREAM_SPLIT with zstd takes 20 % off float64 signals that
rerun's own LZ4 cannot shrink at all. Equal columns (joint angles inside `q`) are stored once. A
long run is encoded some rows at a time.
"""

from __future__ import annotations

import hashlib
import io
import json
import struct
from collections.abc import Callable, Sequence
from math import isfinite
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from snakegen.base.memory import refuse_beyond
from snakegen.base.sample_store import LONG, SampleStore, in_pieces
from snakegen.errors import AnalysisError, LogError
from snakegen.simulation.recording.recording import Channel, Event, Recording
from snakegen.simulation.recording.verdict import Verdict

Floats = NDArray[np.float64]
F = TypeVar("F", bound=IO[bytes])
Writer = Callable[[Floats, dict[str, Floats], IO[bytes], Callable[[], None]], None]
FORMAT = 3  # 2 had the samples of an axis in one piece, 1 no checksum of the whole file
_NUMBERS = 1 << 20  # of a row group
_SHAPE = struct.Struct("<QQ")  # columns and rows of a quick table


def encode(recording: Recording, *, quick: bool = False) -> tuple[str, list[bytes]]:
    """Returns the JSON header and the tables, one for each time axis.

    `quick` ones are no Parquet files: of a few rows these take ten times as long.
    """
    header, files = encode_into(recording, io.BytesIO, _write_quick if quick else _write_parquet)
    return header, [file.getvalue() for file in files]


def encode_into(
    recording: Recording, new_file: Callable[[], F], write: Writer | None = None
) -> tuple[str, list[F]]:
    """Returns the JSON header and the tables, written to what `new_file` returns.

    The files are at their end; they are Parquet files unless `write` says otherwise.
    """
    write = write or _write_parquet
    axes: list[Floats] = []
    tables: list[dict[str, Floats]] = []  # columns as they lie in the channels
    known: list[dict[bytes, str]] = []
    channels = {}
    for name, c in recording.channels.items():
        i = _axis_index(axes, recording.times(name))
        if i == len(tables):
            tables.append({})
            known.append({})
        columns = [
            _column(tables[i], known[i], c.values[:, j], recording.release)
            for j in range(len(c.labels))
        ]
        channels[name] = {
            "unit": c.unit,
            "labels": c.labels,
            "group": c.group,
            "meaning": c.meaning,
            "axis": i,
            "own_time": c.time is not None,
            "columns": columns,
        }
    main = _axis_index(axes, recording.time)
    if main == len(tables):
        tables.append({})
    files = []
    for time, table in zip(axes, tables, strict=True):
        files.append(new_file())
        write(time, table, files[-1], recording.release)
    header = {
        "format": FORMAT,
        "sha256": [_digest(file) for file in files],
        "axis": main,
        "channels": channels,
        "events": recording.events,
        "meta": recording.meta,
        "report": recording.report,
        "metrics": recording.metrics,
        "verdict": None if recording.verdict is None else recording.verdict.to_json(),
    }
    return json.dumps(header, ensure_ascii=False), files


def decode(
    header_text: str, files: Sequence[bytes | IO[bytes]], *, quick: bool = False
) -> Recording:
    """Returns the recording that `encode` was given, bit for bit.

    Raises:
        LogError: another format number, samples that are not the ones that were written, or a
            header that is damaged or does not fit them.
    """
    import pyarrow as pa

    try:
        header = json.loads(header_text)
        if header.get("format") not in range(1, FORMAT + 1):
            raise LogError(
                f"log format {header.get('format')}; this snakegen reads formats up to {FORMAT}"
            )
        opened = [io.BytesIO(each) if isinstance(each, bytes) else each for each in files]
        if header["sha256"] != [_digest(file) for file in opened]:
            raise LogError("its samples have changed since they were written")
        read = _quick_columns if quick else _columns
        return _recording(header, [read(file) for file in opened])
    except (
        KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError, OSError,
        pa.ArrowException, AnalysisError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise LogError(f"its header is damaged ({type(error).__name__}: {reason})") from None


def format_of(header_text: str) -> int:
    """Returns the format number of a header; 0 where it has none."""
    try:
        found = json.loads(header_text).get("format")
    except (ValueError, AttributeError, RecursionError):
        return 0
    return found if isinstance(found, int) else 0


def _recording(header: dict[str, Any], tables: list[dict[str, Floats]]) -> Recording:
    """Returns the recording of a header and its tables; raises what a damaged header leads to."""
    channels = {}
    for name, c in header["channels"].items():
        table = tables[_index(c["axis"])]
        values = _beside(table, [table[column] for column in c["columns"]])
        time = table["time"] if c["own_time"] else None
        labels = tuple(_text(label) for label in c["labels"])
        unit, group, meaning = (_text(c[key]) for key in ("unit", "group", "meaning"))
        channels[name] = Channel(values, unit, labels, group, meaning, time)
    judged = header["verdict"]
    for key in ("meta", "metrics"):
        if not isinstance(header[key], dict):
            raise TypeError(f"{key} is no mapping")
    return Recording(
        time=tables[_index(header["axis"])]["time"],
        channels=channels,
        events=tuple(_event(*e) for e in header["events"]),
        meta=header["meta"],
        report=_text(header["report"]),
        metrics=header["metrics"],
        verdict=None if judged is None else Verdict.from_json(judged),
    )


def _beside(table: dict[str, Floats], columns: list[Floats]) -> Floats:
    """Returns columns of a table side by side (T, k); those of a long run lie on the disk."""
    count = len(table["time"])

    def rows(part: slice) -> tuple[Floats]:
        out = np.empty((part.stop - part.start, len(columns)))
        for j, column in enumerate(columns):
            out[:, j] = column[part]
        return (out,)

    return in_pieces(count, rows)[0]


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _index(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise TypeError(f"{value!r} is no index")
    return value


def _event(time: Any, level: Any, text: Any) -> Event:
    if isinstance(time, bool) or not isinstance(time, int | float) or not isfinite(time):
        raise TypeError(f"{time!r} is no time")
    return Event(float(time), _text(level), _text(text))


def _axis_index(axes: list[Floats], time: Floats) -> int:
    for i, axis in enumerate(axes):
        if axis is time or np.array_equal(axis, time):
            return i
    axes.append(time)
    return len(axes) - 1


def _column(
    table: dict[str, Floats], known: dict[bytes, str], values: Floats, release: Callable[[], None]
) -> str:
    """Adds a column unless the table has the same bits already; returns its name."""
    bits = hashlib.sha256(np.ascontiguousarray(values).data).digest()
    release()
    if bits not in known:
        known[bits] = f"c{len(known)}"
        table[known[bits]] = values
    return known[bits]


def _digest(file: IO[bytes]) -> str:
    """Returns the SHA-256 of a file, which is at its end again."""
    file.seek(0)
    digest = hashlib.sha256()
    while data := file.read(1 << 20):
        digest.update(data)
    return digest.hexdigest()


def _write_parquet(
    time: Floats, table: dict[str, Floats], file: IO[bytes], release: Callable[[], None]
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {"time": time, **table}
    with pq.ParquetWriter(
        file,
        pa.schema([(name, pa.float64()) for name in columns]),
        compression="zstd",
        compression_level=1,
        use_dictionary=False,
        write_statistics=False,
        column_encoding=dict.fromkeys(columns, "BYTE_STREAM_SPLIT"),
    ) as writer:
        size = max(4096, _NUMBERS // len(columns))
        for first in range(0, len(time), size):
            rows = {k: pa.array(v[first : first + size]) for k, v in columns.items()}
            writer.write_table(pa.table(rows))
            release()


def _write_quick(
    time: Floats, table: dict[str, Floats], file: IO[bytes], _: Callable[[], None]
) -> None:
    """Writes numbers of rows and columns, and the columns: first bytes first, then compressed."""
    import pyarrow as pa

    whole = np.vstack([time[None], *(v[None] for v in table.values())])
    planes = np.ascontiguousarray(whole.view(np.uint8).reshape(-1, 8).T)
    file.write(_SHAPE.pack(*whole.shape))
    file.write(pa.Codec("zstd", compression_level=1).compress(planes, asbytes=True))


def _quick_columns(file: IO[bytes]) -> dict[str, Floats]:
    import pyarrow as pa

    file.seek(0)
    data = file.read()
    columns, rows = _SHAPE.unpack_from(data)
    size = 8 * columns * rows
    refuse_beyond(float(size), "its samples", "read it where there is more memory")
    packed = pa.Codec("zstd").decompress(data[_SHAPE.size :], size, asbytes=True)
    planes = np.frombuffer(packed, np.uint8).reshape(8, -1)
    whole = np.ascontiguousarray(planes.T).view(np.float64).reshape(columns, rows)
    return dict(zip(("time", *(f"c{i}" for i in range(columns - 1))), whole, strict=True))


def _columns(file: IO[bytes]) -> dict[str, Floats]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    file.seek(0)
    with pq.ParquetFile(file) as table:
        names, count = table.schema_arrow.names, table.metadata.num_rows
        for column in table.schema_arrow:
            if column.type != pa.float64():
                raise TypeError(f"column {column.name} holds {column.type}")
        if count <= LONG:
            refuse_beyond(
                8.0 * count * len(names), "its samples", "read it where there is more memory"
            )
            whole = table.read()
            return {name: whole[name].to_numpy() for name in names}
        store, first = SampleStore(), 0
        columns = store.reserve(count, len(names))
        for i in range(table.num_row_groups):
            group = table.read_row_group(i)
            values = np.column_stack([group[name].to_numpy() for name in names])
            store.put(columns, first, values)
            first += len(values)
        return dict(zip(names, store.array(columns, count).T, strict=True))
