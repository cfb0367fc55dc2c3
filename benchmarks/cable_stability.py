"""Held or balanced: the sign of the least eigenvalue against MuJoCo, over many postures.

    python benchmarks/cable_stability.py [POSTURES]

Each posture of arm6 is held by its least tensions above a random one, bent by 1 mrad in its softest
direction and let go for 30 s at most.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import snakegen
from snakegen.analysis import cables


def main(count: int = 50) -> None:
    """Prints a row a kind: how many came back, left, or did neither."""
    arm = snakegen.load("arm6")
    rng = np.random.default_rng(1)
    rows = {True: [0, 0, 0, []], False: [0, 0, 0, []]}
    done = 0
    with tempfile.TemporaryDirectory() as folder:
        while done < count:
            q = rng.uniform(-0.5, 0.5, arm.model.nq)
            least = float(rng.uniform(1.0, 200.0))
            found = cables.analyze(arm, q, minimum=least, mjcf=Path(folder) / "a.xml")
            row = rows[found.holds]
            row[{False: 0, True: 1, None: 2}[found.held.left]] += 1
            row[3].append(found.least)
            done += 1
    print("| predicted | postures | came back | left | neither | least eigenvalue N·m/rad |")
    print("|---|---|---|---|---|---|")
    for holds, (back, left, neither, least) in rows.items():
        span = f"{min(least):.3g} … {max(least):.3g}" if least else "–"
        word = "held" if holds else "balanced"
        print(f"| {word} | {len(least)} | {back} | {left} | {neither} | {span} |")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:2]))
