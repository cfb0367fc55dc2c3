"""Memory over time of sweeps and flights of growing length, as pictures.

Run: ``python benchmarks/memory_curves.py`` (``--sweeps 100000 1000000 --flights 600 3600 --moving
3600 --drives 300 --out docs``). Memory is the resident size of a command and all its children, read
from /proc twice a second; the table gives its largest value, the size of the file written and how
many times faster than real time a run was. Flights have an endless battery; `--moving` ones follow
waypoints all the way, `--elastic` ones have links that bend.
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
        if found := resident(child.pid):  # none of a process that has just ended
            at.append(time.monotonic() - begun)
            memory.append(found / 1e6)
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


def waypoints(path: Path, seconds: float) -> str:
    """Writes a mission that moves body and joints all the time; returns its name."""
    rows = ["waypoints:"]
    for k in range(round(seconds / 10.0) + 1):
        side, bend = 0.3 * (-1) ** k, 0.5 + 0.2 * (-1) ** (k // 2)
        rows.append(
            f"- {{time: {10.0 * k}, position: [{side}, 0, 1.6], rpy: [0, 0, {0.5 * side}], "
            f"joints: {{joint1_yaw: {bend}, joint2_yaw: 0.7, joint3_yaw: {bend}}}}}"
        )
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return str(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sweeps", type=int, nargs="*", default=[100_000, 300_000, 1_000_000])
    parser.add_argument("--flights", type=float, nargs="*", default=[60, 600, 3600])
    parser.add_argument("--moving", type=float, nargs="*", default=[600])
    parser.add_argument("--elastic", type=float, nargs="*", default=[])
    parser.add_argument("--drives", type=float, nargs="*", default=[])
    parser.add_argument("--workers", default="2")
    parser.add_argument("--out", type=Path, default=Path("out"))
    options = parser.parse_args()
    sweep = ["analyze", "sweep", "dragon4", "--workers", options.workers, "--samples"]
    print(f"{'command':<30}{'peak MB':>9}{'file MB':>9}{'seconds':>9}{'x real time':>13}")
    sweeps, flights = {}, {}

    def add(kind: dict, label: str, words: list[str], file: Path, seconds: float = 0.0) -> None:
        kind[label] = at, memory, size = curve(words, file)
        speed = f"{seconds / at[-1]:.1f}" if seconds else ""
        print(f"{label:<30}{max(memory):>9.0f}{size:>9.1f}{at[-1]:>9.0f}{speed:>13}", flush=True)

    with tempfile.TemporaryDirectory(dir=".") as name:
        folder = Path(name)
        endless, soft = str(folder / "endless.yaml"), str(folder / "soft.yaml")
        for spec, field in ((endless, []), (soft, ["--set", "plant.link_stiffness=200"])):
            built = ["build", "dragon4", "--set", "plant.battery_energy=0", "--no-picture", *field]
            built += ["-o", f"{folder}/built", "--save-spec", spec]
            subprocess.run(
                [sys.executable, "-m", "snakegen", *built], check=True, capture_output=True
            )
        fly, log = ["analyze", "flight"], folder / "f.rrd"
        for n in options.sweeps:
            add(sweeps, f"{n:,} postures", [*sweep, str(n)], folder / "s.parquet")
        for t in options.flights:
            words = [*fly, endless, "--duration", f"{t:g}"]
            add(flights, f"hover, {t:g} s", words, log, t)
        for t in options.moving:
            mission = waypoints(folder / "way.yaml", t)
            add(flights, f"moving, {t:g} s", [*fly, endless, "--mission", mission], log, t)
        for t in options.elastic:
            words = [*fly, soft, "--duration", f"{t:g}"]
            add(flights, f"elastic, {t:g} s", words, log, t)
        for t in options.drives:
            words = [*fly, "screw4", "--mission", "square", "--duration", f"{t:g}"]
            add(flights, f"drive, {t:g} s", words, log, t)
    for kind, curves in (("sweep", sweeps), ("flight", flights)):
        if curves:
            draw(
                options.out / f"memory_{kind}.png",
                f"Memory of a {kind}" if kind == "sweep" else "Memory of a run",
                curves,
            )


if __name__ == "__main__":
    main()
