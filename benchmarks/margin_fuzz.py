"""Margins against hulls, linear programs and least squares over many random thrust sets.

Run: ``python benchmarks/margin_fuzz.py --cases 10000 --seed 0``. Exit 1 where any case is off by
more than 1e-9 (scaled), each such case on a line of its own.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from margin_cases import disagreement, random_case

from snakegen.analysis.wrench_margin import thrust_margins


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--most", type=int, default=7, help="largest number of rotors")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    worst, failed, outside, ranks, started = 0.0, 0, 0, {}, time.time()
    for i in range(options.cases):
        case = random_case(rng, most=options.most)
        margins = thrust_margins(
            case.q,
            case.lower,
            case.upper,
            case.hover,
            force_scale=case.force_scale,
            torque_scale=case.torque_scale,
        )
        off = disagreement(case, margins, rng)
        ranks[int(margins.rank)] = ranks.get(int(margins.rank), 0) + 1
        outside += not margins.feasible
        worst = max(worst, off)
        if off > 1e-9:
            failed += 1
            print(f"case {i}: off by {off:.2e}, rank {margins.rank}, {case.q.shape[1]} rotors")
    print(
        f"{options.cases} cases, ranks {dict(sorted(ranks.items()))}, {outside} infeasible: "
        f"worst disagreement {worst:.2e}, {failed} above 1e-9, {time.time() - started:.0f} s"
    )
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
