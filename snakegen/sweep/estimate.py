"""What a sweep will take, before it starts: rows a part, bytes on the disk, seconds."""

import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

from snakegen.errors import AnalysisError
from snakegen.sweep.batch import MARGINS, Body
from snakegen.sweep.samples import Samples
from snakegen.sweep.worker import work

_PART_BYTES = 1 << 25  # of a part at most: several are in memory at a time
_PART_HEAD = 16_384  # bytes, names and sizes of the columns of a part
_SPARE = 1 << 20  # bytes left free on the disk
_TIMED = 2048  # postures, of which the speed is taken


@dataclass(frozen=True)
class Estimate:
    """What a sweep takes.

    Attributes:
        postures: rows.
        parts: files on the way.
        file_bytes: of the finished table, an upper limit.
        disk_bytes: needed while it is joined, parts and table together.
        seconds: of all workers together on this machine; nan on a cluster.
    """

    postures: int
    parts: int
    file_bytes: int
    disk_bytes: int
    seconds: float

    def text(self) -> str:
        """Returns it as a line for a person."""
        size = f"{self.file_bytes / 1e6:.3g} MB ({self.disk_bytes / 1e6:.3g} MB on the way)"
        took = f"about {_duration(self.seconds)}, " if self.seconds == self.seconds else ""
        return f"{self.postures:,} postures: {took}{size} in {self.parts} parts"


def row_bytes(joints: int) -> float:
    """Returns the bytes of a row on the disk at most: float64 columns, two of bits."""
    return 8.0 * (joints + len(MARGINS) - 2) + 0.5


def part_rows(joints: int, most: int) -> int:
    """Returns the rows a part: `most`, fewer where a row is so wide that a part passes 32 MB."""
    return max(1, min(most, int(_PART_BYTES / row_bytes(joints))))


def disk_bytes(postures: int, parts: int, joints: int) -> int:
    """Returns the bytes of so many postures in so many parts at most."""
    return int(postures * row_bytes(joints)) + parts * _PART_HEAD


def estimate(
    body: Body, samples: Samples, part: int, workers: int | None, *, timed: bool
) -> Estimate:
    """Returns what the sweep takes; times some of its postures in this process if `timed`."""
    joints, parts = len(body.joints), -(-samples.count // part)
    size = disk_bytes(samples.count, parts, joints)
    seconds = float("nan")
    if timed:
        _, rows = next(samples.blocks(min(_TIMED, part)))
        work(body.task, rows[:2])  # compiles, or reads what is compiled
        begun = time.perf_counter()
        work(body.task, rows)
        number = min(workers or os.cpu_count() or 1, parts)
        seconds = (time.perf_counter() - begun) / len(rows) * samples.count / number
    return Estimate(samples.count, parts, size, 2 * size, seconds)


def check_disk(path: Path, postures: int, part: int, done: int, joints: int) -> None:
    """Refuses a sweep whose parts and table the disk cannot hold together.

    Args:
        path: of the table.
        postures: rows in all.
        part: rows a part.
        done: parts that are there already.
        joints: columns of angles.

    Raises:
        AnalysisError: both sizes, and how many postures would fit.
    """
    parts = -(-postures // part)
    whole = disk_bytes(postures, parts, joints)
    missing = disk_bytes(max(0, postures - done * part), parts - done, joints)
    needed, free = missing + whole + _SPARE, free_bytes(path.parent)
    if needed > free:
        fits = int((free - _SPARE) / (2 * whole / postures))
        remedy = f"{fits} postures would fit" if fits > 0 else "name a file on another disk"
        raise AnalysisError(
            f"{path}: {postures} postures need {needed / 1e6:.4g} MB of disk; "
            f"{free / 1e6:.4g} MB are free: {remedy}."
        )


def free_bytes(folder: Path) -> int:
    """Returns the bytes that a user may still write to the disk of `folder`."""
    there = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    return shutil.disk_usage(there).free


def _duration(seconds: float) -> str:
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{max(seconds, 1.0):.2g} s"
