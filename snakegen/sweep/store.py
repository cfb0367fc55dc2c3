"""Sweeps as Parquet that survive interruptions: parts next to the file, joined when all are there.

Every part carries the digest of the sweep that it belongs to, its first row, its row count and
page checksums, all checked before it is kept or joined. Parts and the file are brought to the
disk before they are renamed.
"""

import hashlib
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from snakegen.base.atomic_io import replace_whole, write_atomically, writing
from snakegen.errors import AnalysisError

KEY = b"snakegen"
PART_KEY = b"snakegen_part"
FORMAT = 2  # of parts and files; files of format 1 have the same columns and no checksums
_SHOWN = ("robot", "seed", "snakegen")  # what a part says of its sweep, for people


class Store:
    """The parts of one sweep in ``FILE.parquet.parts/``; `identity` says what sweep it is."""

    def __init__(
        self, path: Path, identity: dict[str, Any], *, postures: int, part: int, resume: bool
    ) -> None:
        """Opens the store; the caller holds the lock of `path`.

        Args:
            path: of the Parquet file in the end.
            identity: what determines the rows, JSON-able.
            postures: rows in all.
            part: rows a part, fewer in the last.
            resume: keep the parts of this sweep; otherwise earlier parts are removed.

        Raises:
            AnalysisError: `resume`, and the folder says that it belongs to another sweep.
        """
        self.path, self.identity = path, identity | {"format": FORMAT}
        self.postures, self.rows = postures, part
        self.folder = path.with_name(path.name + ".parts")
        text = json.dumps(self.identity, sort_keys=True)
        self._digest = hashlib.sha256(text.encode()).hexdigest()
        stamp = self.folder / "sweep.json"
        if resume:
            self._check(stamp)
        with writing(self.folder):
            if self.folder.exists() and not resume:
                shutil.rmtree(self.folder)
            self.folder.mkdir(parents=True, exist_ok=True)
            for left in self.folder.glob(".*.part"):  # of a process that was killed
                left.unlink(missing_ok=True)
        write_atomically(stamp, text)

    def _check(self, stamp: Path) -> None:
        """Refuses the folder of another sweep; an unreadable stamp decides nothing."""
        try:
            other = json.loads(stamp.read_text(encoding="utf-8"))
            names = [k for k in self.identity if other.get(k) != self.identity[k]]
        except (OSError, ValueError, AttributeError):
            return
        short = [k for k in names if k not in ("urdf", "spec")]
        if names:
            raise AnalysisError(
                f"{self.folder} belongs to another sweep: its {', '.join(short or names)} differ."
            )

    @property
    def count(self) -> int:
        """How many parts there are in all."""
        return -(-self.postures // self.rows)

    def part(self, index: int) -> Path:
        """Returns the file of a part."""
        return self.folder / f"part-{index:06d}.parquet"

    def _label(self, index: int) -> dict[str, Any]:
        """Returns what part `index` of this sweep says of itself."""
        first = index * self.rows
        rows = min(self.rows, self.postures - first)
        told = {k: self.identity.get(k) for k in _SHOWN}
        return told | {"sweep": self._digest, "first": first, "rows": rows}

    def has(self, index: int) -> bool:
        """Tells whether a part is there, whole and of this sweep; removes one that is not."""
        try:
            self._read(index)
        except AnalysisError:
            with writing(self.folder):
                self.part(index).unlink(missing_ok=True)
            return False
        return True

    def put(self, index: int, table: pa.Table) -> None:
        """Writes a part, whole or not at all, brought to the disk."""
        label = json.dumps(self._label(index), sort_keys=True).encode()
        marked = table.replace_schema_metadata({PART_KEY: label})
        write = {"use_dictionary": False, "write_page_checksum": True}
        replace_whole(
            self.part(index), lambda beside: pq.write_table(marked, beside, **write), sync=True
        )

    def _read(self, index: int) -> pa.Table:
        """Returns the rows of a part without metadata.

        Raises:
            AnalysisError: it is missing, damaged, or of another sweep.
        """
        path = self.part(index)
        try:
            table = pq.read_table(path, page_checksum_verification=True, memory_map=False)
            label = json.loads((table.schema.metadata or {})[PART_KEY])
        except (OSError, pa.ArrowException, KeyError, ValueError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            raise AnalysisError(f"{path.name} is missing or damaged ({reason})") from None
        if label != self._label(index) or table.num_rows != label["rows"]:
            raise AnalysisError(f"{path.name} belongs to another sweep")
        return table.replace_schema_metadata(None)

    def join(self) -> None:
        """Writes the parts as one Parquet file with the sweep's identity, and removes them.

        Raises:
            AnalysisError: a part that is missing, damaged or of another sweep; no file is written.
        """
        metadata = {KEY: json.dumps(self.identity).encode()}

        def write(beside: Path) -> None:
            schema = self._read(0).schema.with_metadata(metadata)
            options = {"use_dictionary": False, "write_page_checksum": True}
            with pq.ParquetWriter(beside, schema, compression="zstd", **options) as writer:
                for i in range(self.count):
                    writer.write_table(self._read(i).replace_schema_metadata(metadata))

        try:
            replace_whole(self.path, write, sync=True)
        except AnalysisError as error:
            raise AnalysisError(
                f"{self.path}: not written, {error}; resume the sweep: it is computed again."
            ) from None
        shutil.rmtree(self.folder, ignore_errors=True)


def read_columns(path: Path, names: Sequence[str]) -> pa.Table:
    """Returns some columns of a sweep's file, their checksums verified.

    Raises:
        AnalysisError: not Parquet, or damaged.
    """
    try:
        return pq.read_table(
            path, columns=list(dict.fromkeys(names)), page_checksum_verification=True
        )
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise AnalysisError(f"{path}: cannot be read as Parquet ({reason}).") from None


def row_groups(path: Path, names: Sequence[str]) -> Iterator[pa.Table]:
    """Yields some columns of a sweep's file, a part at a time."""
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        for i in range(file.num_row_groups):
            yield file.read_row_group(i, columns=list(dict.fromkeys(names)))


def identity_of(path: Path) -> dict[str, Any]:
    """Returns what a sweep's Parquet file says of itself.

    Raises:
        AnalysisError: not Parquet, not written by a sweep, or of a later format.
    """
    try:
        metadata = pq.read_schema(path).metadata or {}
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise AnalysisError(f"{path}: cannot be read as Parquet ({reason}).") from None
    if KEY not in metadata:
        raise AnalysisError(f"{path.name} was not written by 'snakegen analyze sweep'.")
    found: dict[str, Any] = json.loads(metadata[KEY])
    if found.get("format", 1) > FORMAT:
        raise AnalysisError(
            f"{path.name} is a sweep of format {found['format']}; formats up to {FORMAT} are read."
        )
    return found
