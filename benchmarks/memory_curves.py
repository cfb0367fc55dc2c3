"""Memory over time of sweeps and flights of growing length, as pictures.

Run: ``python benchmarks/memory_curves.py`` (``--sweeps 100000 1000000 --flights 60 600 --out
docs``). Memory is the resident size of a command and all its children, read from /proc twice a
second; the table gives its largest value and the size of the file written. Flights have an endless
battery; what an hour takes is told from the last flight's growth, if it is flat.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def resident(pid: int) -> int:
    """Returns the bytes that a process and its descendants have resident (Linux)."""
    try:
        rows = Path(f"/proc/{pid}/status").read_text().splitlines()
        own = next((int(r.split()[1]) * 1024 for r in rows if r.startswith("VmRSS:")), 0)
        tasks = Path(f"/proc/{pid}/task").glob("*/children")
        children = [int(c) for task in tasks for c in task.read_text().split()]
    except OSError:  # it has ended meanwhile
        return 0
    return own + sum(resident(child) for child in children)


def curve(words: list[str], file: Path) -> tuple[list[float], list[float], float]:
    """Runs a command; returns times [s], resident MB, and the size of `file` in MB."""
    child = subprocess.Popen(
        [sys.executable, "-m", "snakegen", *words, "-o", str(file)], stdout=subprocess.DEVNULL
    )
    begun, at, memory = time.monotonic(), [], []
    while child.poll() is None:
        at.append(time.monotonic() - begun)
        memory.append(resident(child.pid) / 1e6)
        time.sleep(0.5)
    if child.returncode not in (0, 3):
        raise SystemExit(f"{' '.join(words)}: exit {child.returncode}")
    return at, memory, file.stat().st_size / 1e6


def draw(path: Path, title: str, curves: dict[str, tuple[list[float], list[float], float]]) -> None:
    """Draws memory over time, a curve a command."""
    from snakegen.picture.style import save

    def fill(figure) -> None:
        axes = figure.add_subplot()
        for label, (at, memory, _) in curves.items():
            axes.plot(at, memory, label=label)
        axes.set(xlabel="time [s]", ylabel="resident memory [MB]", title=title, ylim=(0, None))
        axes.legend()

    save(path, (7.0, 3.5), fill)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sweeps", type=int, nargs="*", default=[100_000, 300_000, 1_000_000])
    parser.add_argument("--flights", type=float, nargs="*", default=[60, 300, 1200])
    parser.add_argument("--workers", default="2")
    parser.add_argument("--out", type=Path, default=Path("out"))
    options = parser.parse_args()
    sweep = ["analyze", "sweep", "dragon4", "--workers", options.workers, "--samples"]
    with tempfile.TemporaryDirectory() as folder:
        endless = str(Path(folder) / "endless.yaml")
        flight = ["analyze", "flight", endless, "--duration"]
        built = ["build", "dragon4", "--set", "plant.battery_energy=0", "--no-picture"]
        built += ["-o", f"{folder}/built", "--save-spec", endless]
        subprocess.run([sys.executable, "-m", "snakegen", *built], check=True, capture_output=True)
        sweeps = {
            f"{n:,} postures": curve([*sweep, str(n)], Path(folder) / "s.parquet")
            for n in options.sweeps
        }
        flights = {
            f"{t:g} s": curve([*flight, f"{t:g}"], Path(folder) / "f.rrd") for t in options.flights
        }
    print(f"{'command':<26}{'peak MB':>9}{'file MB':>9}{'seconds':>9}")
    for kind, curves in (("sweep", sweeps), ("flight", flights)):
        for label, (at, memory, size) in curves.items():
            print(f"{kind + ', ' + label:<26}{max(memory):>9.0f}{size:>9.1f}{at[-1]:>9.0f}")
        if curves:
            draw(options.out / f"memory_{kind}.png", f"Memory of a {kind}", curves)


if __name__ == "__main__":
    main()
