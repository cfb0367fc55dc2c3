"""Who catches what: the faulty files of the linter's tests, given to other programs that read URDF.

A fault counts as caught where a program refuses the file, or says more on stderr or in warnings
than of the sound file. Drake counts where it is installed (pip install drake). `--public DIR` also
counts the public files that each accepts (benchmarks/public_robots.py downloads them). `--write`
writes the table into README.md.
"""

import argparse
import json
import os
import struct
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))
README = ROOT / "README.md"
MARKS = ("<!-- who catches what -->", "<!-- end of who catches what -->")
TIERS = ("schema", "topology", "physics", "assets", "portability")
SKIPPED = {"absolute mesh", "file mesh"}  # they name files outside the folder
TOOLS = ("snakegen lint", "Drake", "MuJoCo", "Pinocchio", "yourdfpy", "check_urdf", "rerun")


def _snakegen(path: str) -> None:
    from snakegen.linter.lint import lint

    for finding in lint(path):
        if finding.severity == "error":
            raise ValueError(str(finding))
        if finding.severity == "warning":
            print(finding, file=sys.stderr, flush=True)


def _drake(path: str) -> None:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(path)
    plant.Finalize()


def _mujoco(path: str) -> None:
    import mujoco

    mujoco.MjModel.from_xml_path(path)


def _pinocchio(path: str) -> None:
    import pinocchio as pin

    pin.buildModelFromUrdf(path)


def _yourdfpy(path: str) -> None:
    import yourdfpy

    robot = yourdfpy.URDF.load(path)
    if not robot.validate():
        raise ValueError("validate() is False")


def _check_urdf(path: str) -> None:
    done = subprocess.run(["check_urdf", path], capture_output=True, text=True)
    sys.stderr.write(done.stderr)
    sys.stderr.flush()
    if done.returncode:
        raise ValueError(f"exit {done.returncode}")


def _rerun(path: str) -> None:
    import rerun as rr
    from rerun.urdf import UrdfTree

    recording = rr.RecordingStream("faults")
    UrdfTree.from_file_path(path).log_urdf_to_recording(recording)


READERS: dict[str, tuple[Callable[[str], None], Callable[[], bool]]] = {
    "snakegen lint": (_snakegen, lambda: True),
    "Drake": (_drake, lambda: find_spec("pydrake") is not None),
    "MuJoCo": (_mujoco, lambda: True),
    "Pinocchio": (_pinocchio, lambda: True),
    "yourdfpy": (_yourdfpy, lambda: True),
    "check_urdf": (_check_urdf, lambda: which("check_urdf") is not None),
    "rerun": (_rerun, lambda: True),
}


def faults() -> dict[str, tuple[str, str]]:
    """Returns tier and text of each faulty URDF of the linter's tests, by name."""
    from snakegen.linter.catalogue import RULES
    from tests.test_lint import FAULTS, mutate
    from tests.test_lint_rules import CASES

    found = {name: (row[2], mutate(name)) for name, row in FAULTS.items()}
    found |= {f"case {code}": (code, text) for code, text in CASES.items()}
    counted = {n: c for n, c in found.items() if RULES[c[0]].severity != "note"}
    return {
        name: (RULES[code].tier, text)
        for name, (code, text) in counted.items()
        if name not in SKIPPED
    }


def write_files(folder: Path, texts: dict[str, str]) -> list[Path]:
    """Writes each text into the folder, which has the meshes that sound files name."""
    corners = ((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    rows = [struct.pack("<3f9fH", 0, 0, 1, *(x for i in f for x in corners[i]), 0) for f in faces]
    solid = b" " * 80 + struct.pack("<I", len(faces)) + b"".join(rows)
    (folder / "meshes").mkdir()
    (folder / "rod.stl").write_bytes(solid)
    (folder / "meshes/rod.stl").write_bytes(solid)
    (folder / "rod.dae").write_bytes(b"no mesh")
    (folder / "empty.stl").write_bytes(b" " * 80 + struct.pack("<I", 0))
    large = [
        struct.pack("<3f9fH", 0, 0, 1, *(4200.0 * x for i in f for x in corners[i]), 0)
        for f in faces
    ]
    (folder / "millimetres.stl").write_bytes(b" " * 80 + struct.pack("<I", 4) + b"".join(large))
    paths = []
    for k, text in enumerate(texts.values()):
        paths.append(folder / f"{k}.urdf")
        paths[-1].write_text(text, encoding="utf-8")
    return paths


def work(tool: str) -> None:
    """Reads paths from stdin; prints for each whether it was refused and how much was said."""
    warnings.simplefilter("always")
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    read = READERS[tool][0]
    for line in sys.stdin:
        with tempfile.TemporaryFile() as said:
            kept = os.dup(2)
            os.dup2(said.fileno(), 2)
            refused = False
            try:
                read(line.strip())
            except Exception:
                refused = True
            sys.stderr.flush()
            os.dup2(kept, 2)
            os.close(kept)
            said.seek(0)
            lines = [x for x in said.read().decode("utf-8", "replace").splitlines() if x.strip()]
        print(json.dumps([refused, len(lines)]), file=answers, flush=True)


def answers(tool: str, paths: list[Path]) -> list[tuple[bool, int]]:
    """Returns (refused, lines said) of each file; a crash of the program is a refusal."""
    out: list[tuple[bool, int]] = []
    while len(out) < len(paths):
        rest = paths[len(out) :]
        done = subprocess.run(
            [sys.executable, __file__, "--work", tool],
            input="".join(f"{p}\n" for p in rest),
            capture_output=True,
            text=True,
            cwd=rest[0].parent,
        )
        found = [tuple(json.loads(line)) for line in done.stdout.splitlines()]
        out += found
        if len(found) < len(rest):
            if not found and done.returncode in (1, 2):
                raise SystemExit(f"{tool}: {done.stderr[-400:]}")
            out.append((True, 1))
    return out


def main() -> None:
    """Prints the table, or writes it into README.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", help=argparse.SUPPRESS)
    parser.add_argument("--public", type=Path, help="folder of public robots")
    parser.add_argument("--write", action="store_true", help="write the table into README.md")
    parser.add_argument("--json", type=Path, help="write what each program did of each file")
    args = parser.parse_args()
    if args.work:
        work(args.work)
        return
    from tests.test_lint import GOOD

    cases = faults()
    tools = [t for t in TOOLS if READERS[t][1]()]
    table: dict[str, dict[str, int]] = {}
    details: dict[str, dict[str, str]] = {}
    accepted: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as made:
        texts = {"sound": GOOD} | {name: text for name, (_, text) in cases.items()}
        tag = '<transmission name="t"/>'  # Drake wants more of one, and no fault is about it
        paths = write_files(Path(made), {n: text.replace(tag, "") for n, text in texts.items()})
        for tool in tools:
            sound, *found = answers(tool, paths)
            if sound[0]:
                raise SystemExit(f"{tool} refuses the sound file")
            caught = [refused or said > sound[1] for refused, said in found]
            table[tool] = {
                tier: sum(c for c, (t, _) in zip(caught, cases.values(), strict=True) if t == tier)
                for tier in TIERS
            }
            details[tool] = {
                name: "refused" if refused else "said" if said > sound[1] else ""
                for name, (refused, said) in zip(cases, found, strict=True)
            }
            print(f"{tool}: {sum(caught)} of {len(cases)}", file=sys.stderr)
        if args.public is not None:
            from benchmarks.public_robots import files

            public = [p.resolve() for p in files(args.public)]
            for tool in tools:
                refused = sum(r for r, _ in answers(tool, public))
                accepted[tool] = f"{len(public) - refused} of {len(public)}"
                print(f"{tool}: accepts {accepted[tool]}", file=sys.stderr)
    if args.json is not None:
        args.json.write_text(json.dumps(details, indent=1), encoding="utf-8")
    text = markdown(tools, table, cases, accepted)
    print(text)
    if args.write:
        page = README.read_text(encoding="utf-8")
        before, _, rest = page.partition(MARKS[0])
        after = rest.partition(MARKS[1])[2]
        README.write_text(f"{before}{MARKS[0]}\n{text}\n{MARKS[1]}{after}", encoding="utf-8")


def markdown(
    tools: list[str],
    table: dict[str, dict[str, int]],
    cases: dict[str, Any],
    accepted: dict[str, str],
) -> str:
    """Returns the table: a row a tier, a column a program."""
    counts = {tier: sum(t == tier for t, _ in cases.values()) for tier in TIERS}
    lines = [f"| faults of | {' | '.join(tools)} |", "|---|" + "---|" * len(tools)]
    for tier in TIERS:
        if counts[tier]:
            row = " | ".join(str(table[t][tier]) for t in tools)
            lines.append(f"| {tier} ({counts[tier]}) | {row} |")
    total = " | ".join(str(sum(table[t].values())) for t in tools)
    lines.append(f"| all ({len(cases)}) | {total} |")
    if accepted:
        lines.append(f"| public files accepted | {' | '.join(accepted[t] for t in tools)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
