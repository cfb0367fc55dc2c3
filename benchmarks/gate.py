"""The equivalence gate's worst figure over robot sizes: MuJoCo against Pinocchio, state by state.

    python benchmarks/gate.py [LINKS …]

Builds `dragon4` with 1 to 400 links on a floating and on a fixed base, as `snakegen build` does,
reads the files back, and prints the five relative errors of each. Above nv = 200 the other side is
snakegen's own kinematics and recursive Newton-Euler (pin.Data grows as nv³).
"""

import sys
import tempfile
import time
from pathlib import Path

import snakegen
from snakegen.spec.loading import load_spec

LINKS = (1, 2, 4, 8, 16, 64, 240, 400)
COLUMNS = ("mass", "centre_of_mass", "frames", "mass_matrix", "bias")


def main() -> None:
    """Prints a row a robot, and the worst of all."""
    counts = [int(a) for a in sys.argv[1:]] or LINKS
    head = " ".join(f"{c:>14}" for c in COLUMNS)
    print(f"{'links':>5} {'base':<8} {'nv':>5} files {head}     worst  against               s")
    worst = 0.0
    for links in counts:
        for base in ("floating", "fixed"):
            spec = load_spec("dragon4", links=links, overrides=[f"base={base}"])
            with tempfile.TemporaryDirectory() as folder:
                start = time.perf_counter()
                made = snakegen.build(spec, Path(folder) / "robot", picture=False)
                took = time.perf_counter() - start
                files = len(list(made.mjcf.parent.glob("dragon4*.xml")))
            e = made.equivalence
            nv = (6 if base == "floating" else 0) + 2 * (links - 1) + 2 * links
            figures = " ".join(f"{getattr(e, c):14.1e}" for c in COLUMNS)
            row = (
                f"{links:>5} {base:<8} {nv:>5} {files:>5} {figures} {e.worst:9.1e}  {e.oracle:<16}"
            )
            print(f"{row} {took:6.1f}", flush=True)
            worst = max(worst, e.worst)
    print(f"worst {worst:.1e}; the build fails above 1e-9")


if __name__ == "__main__":
    main()
