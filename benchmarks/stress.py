"""Kills, full disks, damage and Ctrl-C against the real commands; prints a summary table.

Run: ``python benchmarks/stress.py`` (``--kills 50 --seed 0 --only build sweep``), or ``make
stress``. Every case starts snakegen as a person does and looks at what is left: exit codes, files,
processes. A tmpfs that is really full needs root; without it the limit on file sizes
(RLIMIT_FSIZE) stands for it, and the table says so. Exits 1 if anything was broken.
"""

import argparse
import hashlib
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

MARK = "SNAKEGEN_STRESS"  # in the environment of every process that a case starts
SNAKEGEN = [sys.executable, "-m", "snakegen"]
SWEEP = ["analyze", "sweep", "dragon4", "--samples", "60000", "--workers", "2", "-o", "s.parquet"]


class Case:
    """A folder of its own, and what was found wrong in it."""

    def __init__(self, name: str, seed: int) -> None:
        self.name, self.rng, self.wrong, self.count = name, np.random.default_rng(seed), [], 0
        self.folder = Path(tempfile.mkdtemp(prefix=f"stress-{name}-"))
        self.token = f"{os.getpid()}-{name}"

    def start(self, *words: str, **options) -> subprocess.Popen:
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        pipes |= {"env": os.environ | {MARK: self.token}, "cwd": self.folder}
        return subprocess.Popen([*SNAKEGEN, *words], **(pipes | options))

    def run(self, *words: str, **options) -> subprocess.CompletedProcess:
        child = self.start(*words, **options)
        out, err = child.communicate(timeout=900)
        return subprocess.CompletedProcess(words, child.returncode, out, err)

    def killed(self, *words: str, within: float, number: int = signal.SIGKILL) -> tuple[int, str]:
        """Starts a command, signals it at a random time; returns exit code and stderr."""
        child = self.start(*words)
        try:
            child.wait(self.rng.uniform(0.05, within))
        except subprocess.TimeoutExpired:
            child.send_signal(number)
        _, err = child.communicate(timeout=600)
        return child.returncode, err

    def hold(self, condition: bool, text: str) -> None:
        self.count += 1
        if not condition:
            self.wrong.append(text)

    def none_running(self) -> None:
        """Holds that no process of this case is left 20 s later."""
        until = time.monotonic() + 20
        while (left := self.running()) and time.monotonic() < until:
            time.sleep(0.1)
        self.hold(not left, f"still running: {left}")

    def running(self) -> list[int]:
        wanted, found = f"{MARK}={self.token}".encode(), []
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                if wanted in (entry / "environ").read_bytes().split(b"\0"):
                    found.append(int(entry.name))
            except OSError:
                continue
        return found

    def took(self, *words: str) -> float:
        """Runs a command undisturbed; returns its seconds."""
        begun = time.monotonic()
        done = self.run(*words)
        self.hold(done.returncode in (0, 3), f"undisturbed: {done.stderr[-300:]}")
        return time.monotonic() - begun


def contents(folder: Path) -> dict[str, bytes]:
    """Returns the files of a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def builds(case: Case, kills: int) -> None:
    """A killed build leaves the set of one robot or of the other, whole."""
    sets = {}
    for links in ("3", "4"):
        words = ("build", "dragon4", "--links", links, "--no-picture", "-o", "out")
        within = case.took(*words)
        sets[links] = contents(case.folder / "out")
    for i in range(kills):
        case.killed(*words[:3], "34"[i % 2], *words[4:], within=1.1 * within)
        case.hold(contents(case.folder / "out") in sets.values(), f"kill {i}: a mixed folder")
    case.took(*words)
    case.hold({p.name for p in case.folder.iterdir()} == {"out"}, "work folders are left")
    case.none_running()


def conversions(case: Case, kills: int) -> None:
    """A killed conversion leaves the set of one robot or of the other, whole."""
    sys.path.insert(0, str(Path(__file__).parent.parent))
    from tests.foreign_robots import ROBOTS

    sets, within = [], 0.0
    for mass in ("1.0", "1.5"):
        text = ROBOTS["serpent"]().replace('<mass value="1.0"/>', f'<mass value="{mass}"/>')
        (case.folder / f"m{mass}.urdf").write_text(text)
        within = case.took("convert", f"m{mass}.urdf", "-o", "out")
        sets.append(contents(case.folder / "out"))
    case.hold(sets[0] != sets[1], "both robots are the same")
    for i in range(kills):
        case.killed("convert", ("m1.0.urdf", "m1.5.urdf")[i % 2], "-o", "out", within=1.1 * within)
        case.hold(contents(case.folder / "out") in sets, f"kill {i}: a mixed folder")
    case.took("convert", "m1.0.urdf", "-o", "out")
    left = {p.name for p in case.folder.iterdir()}
    case.hold(left == {"out", "m1.0.urdf", "m1.5.urdf"}, f"left: {left}")
    case.none_running()


def sweeps(case: Case, kills: int) -> None:
    """Three kills and resumes, over and over, give the columns of the undisturbed sweep."""
    import pyarrow.parquet as pq

    within = case.took(*SWEEP)
    whole = pq.read_table(case.folder / "s.parquet").replace_schema_metadata(None)
    for i in range(kills):
        (case.folder / "s.parquet").unlink(missing_ok=True) if i % 3 == 0 else None
        case.killed(*SWEEP, *(["--resume"] if i % 3 else []), within=within)
        case.none_running()
        if i % 3 == 2 or i == kills - 1:
            done = case.run(*SWEEP, "--resume")
            case.hold(done.returncode == 0, f"kill {i}: {done.stderr[-200:]}")
            found = pq.read_table(case.folder / "s.parquet").replace_schema_metadata(None)
            case.hold(found.equals(whole), f"kill {i}: other rows")


def flights(case: Case, kills: int) -> None:
    """A killed flight is readable up to its last whole second, or had not flown one."""
    words = ("analyze", "flight", "dragon4", "--duration", "60", "-o", "f.rrd")
    within = case.took(*words)
    readable = 0
    for i in range(kills):
        (case.folder / "f.rrd").unlink(missing_ok=True)
        case.killed(*words, within=1.2 * within)
        journal = case.folder / ".f.rrd.journal"
        if journal.is_file() and journal.stat().st_size > 300_000:
            done = case.run("inspect", "f.rrd", "--json")
            case.hold(done.returncode in (0, 3), f"kill {i}: {done.stderr[-200:]}")
            readable += 1
        journal.unlink(missing_ok=True)
    case.hold(readable > 0 or kills < 10, "no kill met a flight in the air")
    case.took(*words)
    left = {p.name for p in case.folder.iterdir()} - {"f.rrd"}
    case.hold(not left, f"left: {left}")
    case.none_running()


def trials(case: Case, kills: int) -> None:
    """Killed trials of two seeds by turns leave the log of the one or of the other, whole."""
    from snakegen.log import read

    words = ("analyze", "flight", "dragon4", "--duration", "2", "--trials", "4", "-o", "t.rrd")
    sets, within = [], 0.0
    for seed in ("1", "2"):
        within = case.took(*words, "--seed", seed)
        sets.append(read(case.folder / "t.rrd").metrics)
    case.hold(sets[0] != sets[1], "both seeds give the same")
    for i in range(kills):
        case.killed(*words, "--seed", "12"[i % 2], within=1.1 * within)
        case.hold(read(case.folder / "t.rrd").metrics in sets, f"kill {i}: another log")
        if i % 10 == 9 or i == kills - 1:
            done = case.run("inspect", "t.rrd", "--json")
            case.hold(done.returncode in (0, 3), f"kill {i}: {done.stderr[-200:]}")
    case.took(*words, "--seed", "1")
    left = {p.name for p in case.folder.iterdir()} - {"t.rrd"}
    case.hold(not left, f"left: {left}")
    case.none_running()


def interrupts(case: Case, kills: int) -> None:
    """Ctrl-C at any moment: 130 or the finished result, one line, no traceback."""
    words = ("analyze", "flight", "dragon4", "--duration", "5", "-o", "f.rrd")
    within = case.took(*words)
    for i in range(kills):
        code, err = case.killed(*words, within=1.05 * within, number=signal.SIGINT)
        starting = "Traceback" in err and "snakegen/" not in err  # Python itself
        case.hold(code in (0, 130) or starting, f"Ctrl-C {i}: exit {code}: {err[-200:]}")
        case.hold("Traceback" not in err or starting, f"Ctrl-C {i}: {err[-300:]}")
    case.none_running()


def damage(case: Case, kills: int) -> None:
    """Flipped bits and cuts in logs and parts: refused or computed again, never other numbers."""
    from snakegen.errors import LogError
    from snakegen.log import read

    case.took("analyze", "flight", "dragon4", "--duration", "2", "-o", "f.rrd")
    good = (case.folder / "f.rrd").read_bytes()
    for i in range(4 * kills):
        content = bytearray(good)
        content[case.rng.integers(4, len(good))] ^= 1 << case.rng.integers(8)
        if i % 4 == 0:
            content = content[: case.rng.integers(len(good))]
        (case.folder / "d.rrd").write_bytes(content)
        try:
            read(case.folder / "d.rrd")
            case.hold(False, f"flip {i} went unnoticed")
        except LogError:
            case.hold(True, "")


def caches(case: Case, kills: int) -> None:
    """Damaged, full, locked and shared kernel caches: the same page, and whole entries again."""
    cache = case.folder / "cache"
    words = ("analyze", "reach", "arm6", "--json")  # compiles a few kernels, in seconds

    def page(folder: Path) -> subprocess.CompletedProcess:
        environment = os.environ | {"SNAKEGEN_CACHE_DIR": str(folder), MARK: case.token}
        return case.run(*words, env=environment)

    good = page(cache).stdout
    entries = sorted(cache.rglob("*.nbc"))
    case.hold(bool(good and entries), "nothing was compiled: the case shows nothing")
    case.hold(all(map(sound, entries)), "an entry is damaged from the start")
    for i in range(max(1, kills // 5)):
        kind = list(DAMAGE)[i % len(DAMAGE)]
        struck = case.rng.choice(entries, min(1 + i, len(entries)), replace=False)
        for path in struck:
            path.write_bytes(DAMAGE[kind](path.read_bytes() or b"x", case.rng))
        given = {path: path.read_bytes() for path in struck}
        done = page(cache)
        case.hold(done.stdout == good and done.returncode == 0, f"{kind} {i}: another page")
        case.hold(quiet(done), f"{kind} {i}: {done.stderr[-200:]}")
        kept = all(sound(path) or path.read_bytes() == given[path] for path in struck)
        case.hold(kept, f"{kind} {i}: an entry is neither whole nor unread")
        left = {p.name for p in cache.rglob("*") if p.is_file()} - {p.name for p in entries}
        case.hold(not left, f"{kind} {i}: left {left}")
    for i in range(max(1, kills // 25)):
        struck_by(case, entries, lambda: page(cache), good, f"struck while it runs {i}")
    for i in range(max(1, kills // 25)):
        shutil.rmtree(cache)  # two that compile at once, one of them killed
        environment = os.environ | {"SNAKEGEN_CACHE_DIR": str(cache), MARK: case.token}
        other = case.start(*words, env=environment)
        time.sleep(case.rng.uniform(1.0, 8.0))
        threading.Timer(case.rng.uniform(0.0, 8.0), other.kill).start()
        done = page(cache)
        other.communicate()
        case.hold(done.stdout == good and quiet(done), f"two at once {i}: {done.stderr[-200:]}")
        again = page(cache)
        case.hold(again.stdout == good and quiet(again), f"after a kill {i}: another page")
        case.hold(all(map(sound, cache.rglob("*.nbc"))), f"after a kill {i}: damaged entries")
    disk, mounted = case.folder / "disk", False
    try:
        mounted = mount(disk, "200k")
        for name in ("full", "read-only") if mounted else ():
            if name == "read-only":
                subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
            done = page(disk)
            notes = [row for row in done.stderr.splitlines() if row.startswith("note:")]
            case.hold(done.stdout == good and done.returncode == 0, f"{name}: another page")
            told = "Traceback" not in done.stderr and len(notes) <= 1  # none: ~/.cache serves
            case.hold(told, f"{name}: {done.stderr[-300:]}")
            case.hold(not list(disk.rglob("*.part")), f"{name}: half-written entries")
            case.hold(all(map(sound, disk.rglob("*.nbc"))), f"{name}: damaged entries")
    finally:
        if mounted:
            subprocess.run(["umount", str(disk)], check=True)
    case.none_running()


def flipped(content: bytes, rng: np.random.Generator) -> bytes:
    """Returns bytes with one bit turned."""
    out = bytearray(content)
    out[rng.integers(len(out))] ^= 1 << rng.integers(8)
    return bytes(out)


DAMAGE: dict[str, Callable[[bytes, np.random.Generator], bytes]] = {
    "0 bytes": lambda content, rng: b"",
    "garbage": lambda content, rng: rng.bytes(len(content)),
    "flipped bit": flipped,
    "cut short": lambda content, rng: content[: rng.integers(1, len(content))],
    "another's entry": lambda content, rng: hashlib.sha256(b"x").digest() + b"x",
}


def quiet(done: subprocess.CompletedProcess) -> bool:
    """Tells whether a command said nothing but what it compiles, which takes some seconds."""
    rows = [row for row in done.stderr.splitlines() if row.strip()]
    return all(row.startswith("compiling, once") for row in rows)


def sound(path: Path) -> bool:
    """Tells whether a kernel's entry is as it was written, by the checksum before it."""
    content = path.read_bytes() if path.is_file() else b""
    return len(content) > 32 and hashlib.sha256(content[32:]).digest() == content[:32]


def struck_by(
    case: Case,
    entries: list[Path],
    page: Callable[[], subprocess.CompletedProcess],
    good: str,
    name: str,
) -> None:
    """Holds that a command gives its page while another process damages entries all the time."""
    over, struck = threading.Event(), 0

    def strike() -> None:
        nonlocal struck
        while not over.wait(0.05):
            path = entries[case.rng.integers(len(entries))]
            kind = list(DAMAGE)[case.rng.integers(len(DAMAGE))]
            try:
                path.write_bytes(DAMAGE[kind](path.read_bytes() or b"x", case.rng))
                struck += 1
            except (OSError, ValueError):  # removed, or cut to a byte
                continue

    thread = threading.Thread(target=strike)
    thread.start()
    done = page()
    over.set()
    thread.join()
    case.hold(done.stdout == good and done.returncode == 0, f"{name}: another page")
    case.hold("Traceback" not in done.stderr, f"{name}: {done.stderr[-300:]}")
    case.hold(struck > 0, f"{name}: nothing was struck")
    done = page()
    case.hold(done.stdout == good and quiet(done), f"{name}, after it: {done.stderr[-200:]}")


def mount(disk: Path, size: str) -> bool:
    """Mounts a tmpfs of some size at a new folder; returns whether that is allowed here."""
    disk.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(disk)]
    return os.getuid() == 0 and subprocess.run(words, capture_output=True).returncode == 0


def million(case: Case, kills: int) -> None:
    """A sweep of 1,000,000 postures, killed and resumed three times: the same columns byte by byte.

    Parts of the killed one are damaged too, two at each kill.
    """
    words = ["analyze", "sweep", "dragon4", "--samples", "1000000", "--workers", "2"]
    within = case.took(*words, "-o", "whole.parquet")
    whole = columns(case.folder / "whole.parquet")
    parts = case.folder / "s.parquet.parts"
    for i in range(3):
        resume = ["--resume"] if i else []
        child = case.start(*words, "-o", "s.parquet", *resume)
        wanted = 12 * i + int(case.rng.integers(3, 12))  # of 62 parts
        while child.poll() is None and len(list(parts.glob("part-*.parquet"))) < wanted:
            time.sleep(0.05)
        time.sleep(case.rng.uniform(0.0, 2.0))
        case.hold(child.poll() is None, f"kill {i}: over before it was killed")
        child.kill()
        child.communicate()
        case.none_running()
        found = sorted(parts.glob("part-*.parquet"))
        print(f"  kill {i}: {len(found)} parts are whole", flush=True)
        for path in case.rng.choice(found, min(2, len(found)), replace=False):
            path.write_bytes(flipped(path.read_bytes(), case.rng))
    done = case.run(*words, "-o", "s.parquet", "--resume")
    case.hold(done.returncode == 0, f"resume: {done.stderr[-200:]}")
    found = columns(case.folder / "s.parquet")
    case.hold(found == whole, f"other columns: {[k for k in whole if whole[k] != found.get(k)]}")
    print(f"  {len(whole)} columns, undisturbed {within:.0f} s", flush=True)


def columns(path: Path) -> dict[str, str]:
    """Returns the SHA-256 of the values of each column of a Parquet file."""
    import pyarrow.parquet as pq

    out = {}
    with pq.ParquetFile(path) as file:
        for name in file.schema_arrow.names:
            digest = hashlib.sha256()
            for i in range(file.num_row_groups):
                values = file.read_row_group(i, columns=[name]).column(0).combine_chunks()
                digest.update(np.ascontiguousarray(values.to_numpy(zero_copy_only=False)).tobytes())
            out[name] = digest.hexdigest()
    return out


ROOM = 100_000  # bytes left on the full disk for the first of these, none for the second
FULL = [
    ("build", "dragon4", "-o", "{}/b"),
    ("build", "dragon4", "--format", "ros2", "-o", "{}/b"),
    ("build", "dragon4", "--format", "menagerie", "-o", "{}/b"),
    ("convert", "made/dragon4.urdf", "-o", "{}/c"),
    ("analyze", "dragon4", "--report", "{}/report.md"),
    ("analyze", "dragon4", "--report", "{}/page.html"),
    ("analyze", "flight", "dragon4", "--duration", "2", "-o", "{}/f.rrd"),
    ("analyze", "flight", "dragon4", "--duration", "1", "--trials", "2", "-o", "{}/t.rrd"),
    ("analyze", "flight", "screw4", "--mission", "square", "--duration", "1", "-o", "{}/d.rrd"),
    ("analyze", "flight", "arm6", "--mission", "table3", "-o", "{}/arm.rrd"),
    ("analyze", "sweep", "dragon4", "--samples", "20000", "--workers", "2", "-o", "{}/s.parquet"),
    ("inspect", "f.rrd", "--png", "{}/f.png"),
    ("inspect", "f.rrd", "--html", "{}/f.html"),
]
NO_ROOM = [
    ("build", "dragon4", "--no-picture", "-o", "b", "--save-spec", "{}/s.yaml"),
    ("plan", "dragon4", "doorway", "-o", "{}/plan.yaml"),
    ("adopt", "foreign.urdf", "-o", "{}/modules.yaml"),
    ("design", "study.yaml", "--minutes", "0.05", "-o", "{}/d"),
    ("analyze", "sweep", "dragon4", "--samples", "50", "-o", "{}/s.parquet"),
]


def full_disks(case: Case, kills: int) -> None:
    """Each command on a disk that is full: one line that names the path, nothing half-made."""
    disk = case.folder / "disk"
    mounted = mount(disk, "2m")
    print("full disk: a tmpfs" if mounted else "full disk: RLIMIT_FSIZE, no mounts here")
    case.took("build", "dragon4", "--no-picture", "-o", "made")
    case.took("analyze", "flight", "dragon4", "--duration", "2", "-o", "f.rrd")
    text = (case.folder / "made" / "dragon4.urdf").read_text()
    cut = slice(text.index("<snakegen"), text.index("</snakegen>") + len("</snakegen>"))
    (case.folder / "foreign.urdf").write_text(text.replace(text[cut], ""))
    study = case.run("design", "--example").stdout
    (case.folder / "study.yaml").write_text(study)

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (room // 5, room // 5))

    try:
        for room, commands in ((ROOM, FULL), (0, NO_ROOM)):
            if mounted:
                (disk / "fill").write_bytes(b"x" * (2 * 2**20 - room))
            for words in commands:
                line = [word.format("disk") for word in words]
                done = case.run(*line, **({} if mounted else {"preexec_fn": limit}))
                errors = [row for row in done.stderr.splitlines() if row.startswith("Error:")]
                told = errors[-1] if errors else f"exit {done.returncode}"
                print(f"| `{' '.join(line)}` | {told} |", flush=True)
                one = done.returncode == 1 and len(errors) == 1 and "Traceback" not in done.stderr
                case.hold(one and done.stderr.splitlines()[-1] == told, f"{line}: {done.stderr}")
                case.hold("disk/" in told and told.startswith("Error: "), f"{line}: path")
                left = [str(p) for p in disk.rglob("*") if p.is_file() and p.name != "fill"]
                case.hold(not left, f"{line}: left {left}")
        for words in (("presets",), ("analyze", "mass", "dragon4", "--json")):
            with open("/dev/full", "w") as full:
                done = case.run(*words, stdout=full)
            errors = done.stderr.splitlines()
            print(f"| `{' '.join(words)} > /dev/full` | {errors[-1:]} |")
            one = done.returncode == 1 and len(errors) == 1 and "stdout" in errors[0]
            case.hold(one, f"{words} > /dev/full: {done.returncode} {done.stderr[-300:]}")
    finally:
        if mounted:
            subprocess.run(["umount", str(disk)], check=True)


def both_at_once(case: Case, kills: int) -> None:
    """Two sweeps of other seeds into one file: one is refused, the file is the other's."""
    import json

    import pyarrow.parquet as pq

    for i in range(max(1, kills // 10)):
        pair = [case.start(*SWEEP, "--seed", seed) for seed in ("7", "8")]
        errors = [child.communicate()[1] for child in pair]
        codes = sorted(child.returncode for child in pair)
        case.hold(codes == [0, 1], f"pair {i}: exit codes {codes}")
        case.hold(any("is writing it since" in e for e in errors), f"pair {i}: {errors}")
        metadata = pq.read_schema(case.folder / "s.parquet").metadata
        seed = json.loads(metadata[b"snakegen"])["seed"]
        case.hold(seed == (7, 8)[[c.returncode for c in pair].index(0)], f"pair {i}: seed {seed}")
        case.hold(pq.read_metadata(case.folder / "s.parquet").num_rows == 60000, f"pair {i}: rows")


CASES: dict[str, Callable[[Case, int], None]] = {
    "build": builds, "convert": conversions,
    "sweep": sweeps, "flight": flights, "trials": trials, "ctrl-c": interrupts,
    "damage": damage, "cache": caches, "full-disk": full_disks, "two-sweeps": both_at_once,
    "million": million,
}  # fmt: skip


USUAL = [name for name in CASES if name != "million"]  # which takes some five minutes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=list(CASES), default=USUAL)
    options = parser.parse_args()
    rows, broken = [], 0
    for name in options.only:
        case, begun = Case(name, options.seed), time.monotonic()
        try:
            CASES[name](case, options.kills)
        finally:
            shutil.rmtree(case.folder, ignore_errors=True)
        broken += len(case.wrong)
        rows.append((name, case.count, len(case.wrong), time.monotonic() - begun))
        print(f"{name}: {case.count} held, {len(case.wrong)} broken", flush=True)
        for text in case.wrong[:10]:
            print(f"  {text}", flush=True)
    print(f"\nseed {options.seed}, {options.kills} kills each, {os.cpu_count()} cores")
    print(f"{'case':<12}{'checks':>8}{'broken':>8}{'seconds':>9}")
    for name, count, wrong, seconds in rows:
        print(f"{name:<12}{count:>8}{wrong:>8}{seconds:>9.0f}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
