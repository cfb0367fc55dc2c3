"""Public robots: which are called wrong, loaded, equal to RNEA, converted and compared.

Files of three packages (example-robot-data, pybullet, rtb-data) are downloaded into a folder and
read there; nothing of theirs is kept. `python benchmarks/public_robots.py --write` writes the
tables of docs/public_robots.md.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import warnings
import zipfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

import snakegen
from snakegen.errors import SnakegenError
from snakegen.statics.joint_torques import joint_torques

PACKAGES = ("example-robot-data", "pybullet", "rtb-data")
PAGE = Path(__file__).parent.parent / "docs/public_robots.md"
SHOWN = 24  # named robots in the table of conversions
_SHAPES = re.compile(r"<(visual|collision)\b.*?</\1>|<(visual|collision)\b[^>]*/>", re.S)


@dataclass
class Outcome:
    """What became of one file."""

    path: Path
    name: str = ""
    pinocchio: bool = False
    mujoco: bool = False
    errors: list[str] = field(default_factory=list)  # codes of the linter
    refused: str = ""  # why it was not loaded
    torque_error: float = np.nan  # relative, against RNEA
    joints: int = 0
    converted: str = "-"
    mass_matrix: float = np.nan


def main() -> None:
    """Reads every file and prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, help="where the packages are, or are put")
    parser.add_argument("--write", action="store_true", help="write docs/public_robots.md")
    parser.add_argument("--only", default="", help="text that a path must hold")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as made:
        folder = args.folder or Path(made)
        if not any(folder.glob("*/**/*.urdf")):
            download(folder)
        outcomes = []
        for path in files(folder):
            if args.only in str(path):
                print(path.relative_to(folder), file=sys.stderr)
                outcomes.append(examine(path, Path(made)))
        named = picked(outcomes)
        for out in named:
            print(f"whole: {out.name}", file=sys.stderr)
            convert(out, out.path, Path(made))
        text = "\n\n".join(tables(outcomes, named))
    print(text)
    if args.write:
        head = PAGE.read_text(encoding="utf-8").partition("<!-- tables -->")[0]
        PAGE.write_text(f"{head}<!-- tables -->\n\n{text}\n", encoding="utf-8")


def download(folder: Path) -> None:
    """Downloads the packages' wheels without their dependencies, and unpacks them."""
    folder.mkdir(parents=True, exist_ok=True)
    wheels = folder / "wheels"
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(wheels)]
    subprocess.run([*command, *PACKAGES], check=True)
    for wheel in wheels.glob("*.whl"):
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder / wheel.name.partition("-")[0])


def files(folder: Path) -> Iterator[Path]:
    """Yields the URDFs in order; of the thousand random objects of pybullet none."""
    for path in sorted(folder.glob("*/**/*.urdf")):
        if "random_urdfs" not in path.parts:
            yield path


def examine(path: Path, scratch: Path) -> Outcome:
    """Runs one file through everything."""
    out = Outcome(path, path.stem)
    out.errors = [f.code for f in snakegen.lint(path) if f.severity == "error"]
    text = path.read_text(encoding="utf-8", errors="replace").lstrip("\ufeff \t\r\n")
    try:
        pin.buildModelFromXML(text)
        out.pinocchio = True
    except (ValueError, RuntimeError):
        pass
    try:  # shapes aside: meshes that are not installed are no fault of the file
        bare = re.sub(r"<mujoco\b.*?</mujoco>", "", _SHAPES.sub("", text), flags=re.S)
        mujoco.MjModel.from_xml_string(bare)
        out.mujoco = True
    except (ValueError, mujoco.FatalError):
        pass
    try:
        robot = snakegen.load(path)
    except SnakegenError as error:
        out.refused = " ".join(str(error).split()).removeprefix(f"{path}: ")
        return out
    out.joints = len(robot.joint_names)
    out.torque_error = torque_error(robot)
    plain = scratch / "plain.urdf"
    plain.write_text(_SHAPES.sub("", text), encoding="utf-8")
    convert(out, plain, scratch)
    return out


def convert(out: Outcome, path: Path, scratch: Path) -> None:
    """Converts a file and compares its URDF with the MJCF made of it."""
    try:
        made = snakegen.convert(path, scratch / "out")
        out.mass_matrix = made.equivalence.mass_matrix
        found = snakegen.compare(path, made.mjcf)
        out.converted = "same" if found.same else found.differences[0]
    except SnakegenError as error:
        out.converted = " ".join(str(error).split())[:160]


def torque_error(robot: snakegen.Robot) -> float:
    """Returns the largest error of joint torques against RNEA over ten random states, relative."""
    rng, worst = np.random.default_rng(0), 0.0
    model, data = robot.model, robot.model.createData()
    for _ in range(10):
        q = pin.neutral(model)
        q = pin.integrate(model, q, rng.uniform(-1.0, 1.0, model.nv))
        v, a = rng.normal(size=(2, model.nv))
        expected = np.array(pin.rnea(model, data, q, v, a))
        found = joint_torques(robot, q, v, a)
        scale = float(np.abs(expected).max(initial=1e-9))
        worst = max(worst, float(np.abs(found - expected).max(initial=0.0)) / scale)
    return worst


def picked(outcomes: list[Outcome]) -> list[Outcome]:
    """Returns named robots of four joints or more, spread over the alphabet."""
    found = [o for o in outcomes if not o.refused and o.joints >= 4]
    unique = sorted({o.name: o for o in reversed(found)}.values(), key=lambda o: o.name)
    at = np.linspace(0, len(unique) - 1, min(SHOWN, len(unique))).astype(int)
    return [unique[i] for i in at]


def tables(outcomes: list[Outcome], named: list[Outcome]) -> list[str]:
    """Returns the tables as Markdown."""
    both = [o for o in outcomes if o.pinocchio and o.mujoco]
    read = [o for o in outcomes if o.pinocchio]
    loaded = [o for o in outcomes if not o.refused]
    wrong = [o for o in both if o.errors]
    equal = [o for o in loaded if o.torque_error < 1e-9]
    worst = max((o.torque_error for o in loaded), default=0.0)
    same = [o for o in loaded if o.converted == "same"]
    tight = [o for o in loaded if o.mass_matrix < 1e-9]
    rows = [
        ("URDF files", len(outcomes)),
        ("Pinocchio reads", len(read)),
        ("Pinocchio and MuJoCo read (shapes aside)", len(both)),
        ("of those called wrong by `lint`", len(wrong)),
        ("loaded", len(loaded)),
        ("loaded of those that both read", sum(not o.refused for o in both)),
        (f"torques equal RNEA to 1e-9 (worst {worst:.1e})", f"{len(equal)} of {len(loaded)}"),
        (
            "converted (most without shapes), mass matrix equal to 1e-9",
            f"{len(tight)} of {len(loaded)}",
        ),
        ("`compare` calls URDF and MJCF the same robot", f"{len(same)} of {len(loaded)}"),
    ]
    parts = [_table(("what", "files"), rows)]
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for o in outcomes:
        if o.refused:
            code = re.search(r"\[(\w+)\]", o.refused)
            groups[f"`{code[1]}`" if code else _general(o.refused)].append(o)
    refused = [
        (why, len(found), sum(o.pinocchio and o.mujoco for o in found), _names(found))
        for why, found in sorted(groups.items(), key=lambda item: -len(item[1]))
    ]
    parts.append("Refused, and why:")
    parts.append(_table(("reason", "files", "of them read by both", "which"), refused))
    rows_ = [
        (o.name, o.joints, f"{o.torque_error:.0e}", f"{o.mass_matrix:.0e}", o.converted)
        for o in named
    ]
    parts.append("Named robots, converted with their shapes and compared:")
    parts.append(_table(("robot", "joints", "torque error", "mass matrix", "compare"), rows_))
    failed = Counter(_general(o.converted) for o in loaded if o.converted != "same")
    if failed:
        parts.append("Loaded, but not converted or not the same:")
        examples = {_general(o.converted): o.name for o in loaded if o.converted != "same"}
        rows__ = [(why, count, examples[why]) for why, count in failed.most_common()]
        parts.append(_table(("why", "files", "as"), rows__))
    return parts


def _general(text: str) -> str:
    """Returns a message without its names and numbers."""
    text = re.sub(r"/[^ ]*/", "", text)
    text = re.sub(r"'[^']*'", "'…'", text)
    return re.sub(r"[-+]?\d[\d.e+-]*", "…", text)[:110]


def _names(found: list[Outcome]) -> str:
    names = list(dict.fromkeys(o.name for o in found))
    return ", ".join(names[:6]) + (" …" if len(names) > 6 else "")


def _table(head: tuple[str, ...], rows: list[tuple]) -> str:
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    lines += [f"| {' | '.join(str(c).replace('|', '/') for c in row)} |" for row in rows]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
