"""Compile time of the kernels, one by one, in processor seconds, against a budget.

python benchmarks/compile_time.py [COMMAND …]

Each command runs in a process of its own with an empty kernel cache. Own time is what is spent on
a function without those that it calls; a kernel that Python calls has its whole in the first table.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from typing import Any

COMMANDS = {  # processor seconds of compilation that a first run may take
    "analyze dragon4": 0.0,
    "analyze dragon4 --joint joint1_yaw=1": 0.0,  # limited by its servos
    "analyze mass dragon4": 0.0,
    "analyze actuation dragon4": 0.0,
    "analyze singularity dragon4": 0.0,
    "analyze hover dragon4": 0.0,
    "analyze margin dragon4": 0.0,
    "analyze arm6": 8.0,
    "analyze screw4": 12.0,
    "analyze flight dragon4 --mission hover --option duration=1": 75.0,
}
SHOWN = 12  # rows of each table
CHILD = "SNAKEGEN_COMPILE_TIME_CHILD"


def compiled(command: list[str]) -> None:
    """Runs a snakegen command in this process and prints what it compiled."""
    begin = time.perf_counter(), time.process_time()
    from numba.core import event

    open_: list[list[float]] = []
    own, whole = Counter[str](), Counter[str]()

    class Watch(event.Listener):
        def on_start(self, event: Any) -> None:
            open_.append([time.process_time(), 0.0])

        def on_end(self, event: Any) -> None:
            start, inside = open_.pop()
            spent, function = time.process_time() - start, event.data["dispatcher"].py_func
            name = f"{function.__module__.removeprefix('snakegen.kernels.')}.{function.__name__}"
            own[name] += spent - inside
            if open_:
                open_[-1][1] += spent
            else:
                whole[name] += spent

    event.register("numba:compile", Watch())
    from snakegen.cli import main

    sys.argv = ["snakegen", *command]
    code = 0
    try:
        main()
    except SystemExit as end:
        code = int(end.code or 0)
    wall, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
    total = sum(own.values())
    print(f"{total:.2f} {processor:.2f} {wall:.2f} {len(own)} {code}", file=sys.stderr)
    for table in (whole, own):
        for name, spent in table.most_common(SHOWN):
            print(f"  {spent:7.2f}  {name}", file=sys.stderr)
        print("--", file=sys.stderr)


def measure(command: str, budget: float) -> bool:
    """Prints what a command compiles with an empty cache; True if that is within the budget."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as cache:
        words = command.split()
        if "flight" in words:
            words += ["-o", f"{cache}/flight.rrd"]
        done = subprocess.run(
            [sys.executable, __file__, *words],
            env=os.environ | {"SNAKEGEN_CACHE_DIR": cache, CHILD: "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
    lines = done.stderr.splitlines()
    at = next((i for i, x in enumerate(lines) if x[:1].isdigit() and x.count(" ") == 4), None)
    if at is None:
        sys.exit(f"{command}: failed\n{done.stderr[-2000:]}")
    total, processor, wall, count, _ = lines[at].split()
    kept = float(total) <= budget
    print(
        f"\n{command}\n  {total} s compiling {count} functions (budget {budget:g} s"
        f"{'' if kept else ': EXCEEDED'}), {processor} s of processor in all, {wall} s of wall time"
    )
    called, own, *_ = "\n".join(lines[at + 1 :]).split("--")
    for title, table in (("called from Python, with all they call", called), ("own time", own)):
        if table.strip():
            print(f"  {title}:\n{table.strip(chr(10))}")
    return kept


def main() -> None:
    """Measures the commands; exit code 1 where a budget is exceeded."""
    if os.environ.get(CHILD):
        compiled(sys.argv[1:])
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commands", nargs="*", help="of COMMANDS, quoted; all if absent")
    asked = parser.parse_args().commands or list(COMMANDS)
    print(f"load before: {os.getloadavg()[0]:.2f} on {os.cpu_count()} cores")
    kept = [measure(command, COMMANDS.get(command, float("inf"))) for command in asked]
    sys.exit(not all(kept))


if __name__ == "__main__":
    main()
