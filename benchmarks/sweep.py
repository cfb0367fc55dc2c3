"""A sweep of a million postures of a preset: time by stage, rows that closed, peak memory.

Run: ``python benchmarks/sweep.py`` (``--samples 1000000 --workers 2 --robot dragon4``). Memory is
that of this process and all its children together, sampled while the sweep runs; the
machine's load before it starts is printed, as other work on the same cores makes it slower.
"""

import argparse
import os
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from snakegen.robot import load
from snakegen.sweep.batch import Body, evaluate
from snakegen.sweep.run import sweep
from snakegen.sweep.samples import draw


def memory(pid: int) -> int:
    """Returns the memory of a process and its descendants, bytes (Linux).

    Proportional set size: a page that several of them share (libraries) counts once in all.
    """
    try:
        rows = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        total = next(int(row.split()[1]) * 1024 for row in rows if row.startswith("Pss:"))
        tasks = Path(f"/proc/{pid}/task").glob("*/children")
        children = [child for task in tasks for child in task.read_text().split()]
    except (OSError, StopIteration):  # it has ended meanwhile
        return 0
    return total + sum(memory(int(child)) for child in children)


class Watch(threading.Thread):
    """Samples the memory until told to stop."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.peak, self.done = 0, threading.Event()

    def run(self) -> None:
        while not self.done.wait(0.5):
            self.peak = max(self.peak, memory(os.getpid()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="dragon4")
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    print(f"load before: {' '.join(f'{x:.2f}' for x in os.getloadavg())} on {os.cpu_count()} cores")
    robot = load(options.robot)
    low, high, _ = robot.limits(robot.chain_joints)
    body = Body.of(robot, robot.chain_joints, np.eye(3), 1e-3)
    samples = draw("sobol", options.samples, 0, low, high)
    start = time.perf_counter()
    evaluate(body, samples[:2])
    print(
        f"first two postures (compiled or read from the cache): {time.perf_counter() - start:.1f} s"
    )
    start = time.process_time()
    evaluate(body, samples[:4096])
    print(
        f"one core: {(time.process_time() - start) / 4096 * 1e6:.0f} µs of processor time a posture"
    )
    watch = Watch()
    watch.start()
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        path = sweep(
            robot, robot.chain_joints, samples, Path(folder) / "s.parquet", workers=options.workers
        )
        seconds, size = time.perf_counter() - start, path.stat().st_size
        watch.done.set()
        table = pq.read_table(path, columns=["closed", "force_margin", "torque_margin"])
    closed = np.asarray(table["closed"])
    print(
        f"{len(closed):,} postures in {seconds:.1f} s with {options.workers} workers: "
        f"{seconds / len(closed) * 1e6:.0f} µs a posture, {100 * closed.mean():.4f} % closed, "
        f"{size / 1e6:.0f} MB of Parquet, peak memory {watch.peak / 2**20:.0f} MiB"
    )


if __name__ == "__main__":
    main()
