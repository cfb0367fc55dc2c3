"""A sweep of a million postures of a preset: time by stage, rows that closed, peak memory.

Run: ``python benchmarks/sweep.py`` (``--samples 1000000 --workers 2 --robot dragon4``). Memory is
that of this process and all its children together, sampled while the sweep runs, once with pages
that several of them share counted once and once as the plain sum; the machine's load before and
after is printed, as other work on the same cores makes it slower.
"""

import argparse
import os
import tempfile
import threading
import time
from pathlib import Path

# Everything else is imported in main(): the workers import this file too, and would keep it all.


def memory(pid: int) -> tuple[int, int]:
    """Returns the memory of a process and its descendants, bytes (Linux): shared pages once, sum.

    The first is the proportional set size: a page that several of them share (libraries) counts
    once in all. The second adds up what each has resident.
    """
    try:
        rows = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        once, resident = (
            next(int(row.split()[1]) * 1024 for row in rows if row.startswith(name))
            for name in ("Pss:", "Rss:")
        )
        tasks = Path(f"/proc/{pid}/task").glob("*/children")
        children = [child for task in tasks for child in task.read_text().split()]
    except (OSError, StopIteration):  # it has ended meanwhile
        return 0, 0
    below = [memory(int(child)) for child in children]
    return once + sum(b[0] for b in below), resident + sum(b[1] for b in below)


class Watch(threading.Thread):
    """Samples the memory until told to stop."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.once, self.resident, self.done = 0, 0, threading.Event()

    def run(self) -> None:
        while not self.done.wait(0.5):
            once, resident = memory(os.getpid())
            self.once, self.resident = max(self.once, once), max(self.resident, resident)


def load_now() -> str:
    return " ".join(f"{x:.2f}" for x in os.getloadavg())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="dragon4")
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    import numpy as np
    import pyarrow.parquet as pq

    from snakegen.robot.robot import load
    from snakegen.sweep.run import sweep
    from snakegen.sweep.samples import draw, sampling

    print(f"load before: {load_now()} on {os.cpu_count()} cores")
    robot = load(options.robot)
    low, high, _ = robot.limits(robot.chain_joints)
    samples = sampling("sobol", options.samples, 0, low, high)
    watch = Watch()
    watch.start()
    with tempfile.TemporaryDirectory() as folder:
        start, spent = time.perf_counter(), os.times()
        path = sweep(
            robot, robot.chain_joints, samples, Path(folder) / "s.parquet", workers=options.workers
        )
        seconds, size = time.perf_counter() - start, path.stat().st_size
        after = os.times()
        watch.done.set()
        table = pq.read_table(path, columns=["closed", "force_margin", "torque_margin"])
    closed = np.asarray(table["closed"])
    work = sum(after[:4]) - sum(spent[:4])
    print(
        f"{len(closed):,} postures in {seconds:.1f} s with {options.workers} workers "
        f"({seconds / len(closed) * 1e6:.0f} µs a posture, {work / len(closed) * 1e6:.0f} µs of "
        f"processor time in all), {100 * closed.mean():.4f} % closed, {size / 1e6:.0f} MB of "
        f"Parquet\npeak memory {watch.once / 2**20:.0f} MiB, {watch.resident / 2**20:.0f} MiB as "
        f"the plain sum of all processes; load after: {load_now()}"
    )
    one_core(robot, draw("sobol", 4096, 0, low, high))


def one_core(robot, samples) -> None:
    """Prints the time of a posture in this process, without Parquet."""
    import numpy as np

    from snakegen.sweep.batch import Body
    from snakegen.sweep.worker import work

    task = Body.of(robot, robot.chain_joints, np.eye(3), 1e-3).task
    work(task, samples[:2])
    times = []
    for _ in range(5):
        start = time.process_time()
        work(task, samples)
        times.append(time.process_time() - start)
    print(f"one core: {min(times) / len(samples) * 1e6:.1f} µs of processor time a posture")


if __name__ == "__main__":
    main()
