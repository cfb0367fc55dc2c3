"""Parquet that survives interruptions: parts beside the file, joined when all are there."""

import json
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from snakegen.errors import AnalysisError
from snakegen.files import replace_whole

KEY = b"snakegen"


class Store:
    """The parts of one sweep in ``FILE.parquet.parts/``; `identity` says what sweep it is."""

    def __init__(self, path: Path, identity: dict[str, Any], *, resume: bool) -> None:
        """Opens the store.

        Raises:
            AnalysisError: parts of another sweep, or of this one without `resume`.
        """
        self.path, self.identity = path, identity
        self.folder = path.with_name(path.name + ".parts")
        self._text = json.dumps(identity, sort_keys=True)
        stamp = self.folder / "sweep.json"
        if stamp.exists():
            known = stamp.read_text(encoding="utf-8")
            if resume and known != self._text:
                raise AnalysisError(
                    f"{self.folder} belongs to another sweep{self._differs(known)}."
                )
            if not resume:
                shutil.rmtree(self.folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            stamp.write_text(self._text, encoding="utf-8")
        except OSError as error:
            raise AnalysisError(f"{self.folder}: cannot be written ({error.strerror}).") from None

    def _differs(self, known: str) -> str:
        """Returns what differs between the stored sweep and this one."""
        try:
            other = json.loads(known)
        except json.JSONDecodeError:
            return " (its sweep.json cannot be read)"
        names = [k for k in self.identity if other.get(k) != self.identity[k]]
        short = [k for k in names if k not in ("urdf", "spec")]
        return f": its {', '.join(short or names)} differ" if names else ""

    def part(self, index: int) -> Path:
        """Returns the file of a part."""
        return self.folder / f"part-{index:06d}.parquet"

    def has(self, index: int) -> bool:
        """Tells whether a part is there, whole."""
        return self.part(index).is_file()

    def put(self, index: int, table: pa.Table) -> None:
        """Writes a part, whole or not at all."""
        replace_whole(self.part(index), lambda beside: pq.write_table(table, beside))

    def join(self, parts: int) -> None:
        """Writes the parts as one Parquet file with the sweep's identity, and removes them."""
        missing = [i for i in range(parts) if not self.has(i)]
        if missing:
            raise AnalysisError(
                f"{len(missing)} of {parts} parts are missing; run again with --resume."
            )

        def write(beside: Path) -> None:
            first = pq.read_schema(self.part(0))
            schema = first.with_metadata({KEY: json.dumps(self.identity).encode()})
            with pq.ParquetWriter(beside, schema, compression="zstd") as writer:
                for i in range(parts):
                    table = pq.read_table(self.part(i))
                    writer.write_table(table.replace_schema_metadata(schema.metadata))

        replace_whole(self.path, write)
        shutil.rmtree(self.folder, ignore_errors=True)


def identity_of(path: Path) -> dict[str, Any]:
    """Returns what a sweep's Parquet file says of itself.

    Raises:
        AnalysisError: not Parquet, or not written by a sweep.
    """
    try:
        metadata = pq.read_schema(path).metadata or {}
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise AnalysisError(f"{path}: cannot be read as Parquet ({reason}).") from None
    if KEY not in metadata:
        raise AnalysisError(f"{path.name} was not written by 'snakegen analyze sweep'.")
    found: dict[str, Any] = json.loads(metadata[KEY])
    return found
