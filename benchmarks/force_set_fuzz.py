"""Two-sided margins of random force sets against an independent optimisation.

Run: ``OPENBLAS_NUM_THREADS=1 python benchmarks/force_set_fuzz.py --count 1000 --seed 0`` (small
matrices: threads only wait for each other). Bodies are chains of 3 to 6 apparatuses, each of gimbal
limits .05 … π, a least thrust of 0 … 50 % and a kind drawn at random (two gimbals, one tilt axis,
fixed, reversible, free). Of every body in reach of hover it is checked that

- along the direction in which a margin is least, and along others, thrusts and gimbal angles in
  range give the lower bound, and a random share of it (a hole would be a fault): the proof's own
  forces, turned into thrusts and angles here, or else ones found by bounded least squares and
  SLSQP;
- no such search finds any that give a push past the upper bound along its direction.

Printed are the gaps (upper - lower)/upper, as totals of all bodies so far. Each body is drawn from
the seed and its number, so that a run with `--out` goes on where it was stopped. Exit 1 where a
bound is refuted or not reached.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import ClassVar

import numpy as np
from scipy.optimize import least_squares, minimize
from scipy.spatial.transform import Rotation

from snakegen.wrench_margins.branching import directions
from snakegen.wrench_margins.branching.piece_pool import Pool, holding_anchors
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.vectored import set_margins

LENGTH, WEIGHT = 0.42, 19.62
SHOWN = 20  # bodies between two lines of totals
MET = 1e-8  # share of all limits by which a wrench may be missed
WHOLE = np.array([-np.pi, np.pi])
SLICES = {"force": slice(0, 3), "torque": slice(3, 6)}
KINDS = ("sector", "sector", "sector", "tilt", "fixed", "reversible", "free")


def random_body(rng):
    """Returns force sets of a random chain, and its hover wrench, N and N·m."""
    n = int(rng.integers(3, 7))
    turn, at, points, frames = np.eye(3), np.zeros(3), [], []
    for _ in range(n):
        half = 0.5 * LENGTH * turn[:, 0]
        points.append(at + half)
        frames.append(turn)
        at = at + 2 * half
        turn = turn @ Rotation.from_euler("YZ", rng.uniform([-0.4, -1.5], [0.4, 1.5])).as_matrix()
    points = np.array(points) - np.mean(points, axis=0)
    high = rng.uniform(1.3, 3.5, n) * WEIGHT
    low = high * rng.uniform(0.0, 0.5, n) * (rng.random(n) < 0.5)
    phi, theta = (np.outer(rng.uniform(0.05, np.pi, n), [-1.0, 1.0]) for _ in range(2))
    mixed = rng.random() < 0.5
    for j in range(n):
        kind = KINDS[rng.integers(len(KINDS))] if mixed else "sector"
        if kind == "tilt":
            theta[j] = 0.0
        elif kind in ("fixed", "reversible"):
            phi[j] = theta[j] = 0.0
            low[j] = -high[j] if kind == "reversible" else low[j]
        elif kind == "free":
            phi[j] = theta[j] = WHOLE
            low[j] = 0.0
    drag = rng.uniform(-0.02, 0.02, n) * (rng.random() < 0.5)
    up = Rotation.from_euler("XY", rng.uniform(-0.15, 0.15, 2)).as_matrix()[:, 2]
    sets = ForceSets.checked(points, np.array(frames), low, high, phi, theta, drag)
    return sets, np.r_[n * WEIGHT * up, 0, 0, 0]


def forces(sets, x):
    """Returns (n, 3) forces, CoG axes, of thrusts and angles x (3n,)."""
    thrust, phi, theta = x.reshape(3, -1)
    u = [np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    return np.einsum("nij,jn->ni", sets.frames, thrust * np.array(u))


def wrench(sets, x):
    """Returns the wrench (6,) of thrusts and angles."""
    f = forces(sets, x)
    torque = np.cross(sets.points, f) + sets.drag[:, None] * f
    return np.r_[f.sum(axis=0), torque.sum(axis=0)]


def derivative(sets, x):
    """Returns (6, 3n), the derivative of `wrench`."""
    n = len(sets)
    thrust, phi, theta = x.reshape(3, -1)
    s, c, st, ct, zero = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta), np.zeros(n)
    parts = [[st, -s * ct, c * ct], [zero, -c * ct * thrust, -s * ct * thrust]]
    parts.append([ct * thrust, s * st * thrust, -c * st * thrust])
    out = np.empty((6, 3 * n))
    for k, part in enumerate(parts):
        f = np.einsum("nij,jn->ni", sets.frames, np.array(part))
        out[:3, k * n : (k + 1) * n] = f.T
        out[3:, k * n : (k + 1) * n] = (np.cross(sets.points, f) + sets.drag[:, None] * f).T
    return out


def held(rng, sets, w, starts, first=None):
    """Returns thrusts and angles (3n,) in range that give the wrench w (6,), None if not found.

    Bounded least squares over thrusts and angles, from `first` and `starts` random ones.
    """
    low = np.r_[sets.low, sets.phi[:, 0], sets.theta[:, 0]]
    high = np.r_[sets.high, sets.phi[:, 1], sets.theta[:, 1]]
    free = np.flatnonzero(high - low > 1e-9)
    unit = np.r_[np.ones(3), np.full(3, LENGTH)] * len(sets) * WEIGHT

    def whole(y):
        x = 0.5 * (low + high)
        x[free] = y
        return x

    for k in range(starts + 1):
        x = rng.uniform(low, high) if k or first is None else first
        found = least_squares(
            lambda y: (wrench(sets, whole(y)) - w) / unit,
            np.clip(x, low + 1e-10, high - 1e-10)[free],
            jac=lambda y: (derivative(sets, whole(y)) / unit[:, None])[:, free],
            bounds=(low[free], high[free]),
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
            max_nfev=80,
        )
        if np.abs(found.fun).max() < MET:
            return whole(found.x)
    return None


def climb(sets, hover, u, x, t):
    """Returns the largest t found with ``hover + t u`` held, from thrusts and angles x at `t`."""
    n = len(sets)
    low = np.r_[sets.low, sets.phi[:, 0], sets.theta[:, 0]]
    high = np.r_[sets.high, sets.phi[:, 1], sets.theta[:, 1]]
    unit = np.r_[np.ones(3), np.full(3, LENGTH)] * n * WEIGHT
    size = n * WEIGHT * (1.0 if u[:3].any() else LENGTH)

    def missed(y):
        return (wrench(sets, y[:-1]) - hover - y[-1] * size * u) / unit

    found = minimize(
        lambda y: -y[-1],
        np.r_[x, t / size],
        jac=lambda y: np.r_[np.zeros(3 * n), -1.0],
        constraints={
            "type": "eq",
            "fun": missed,
            "jac": lambda y: np.column_stack([derivative(sets, y[:-1]), -size * u]) / unit[:, None],
        },
        bounds=[*zip(low, high, strict=True), (-1.0, 1e3)],
        method="SLSQP",
        options={"maxiter": 100, "ftol": 1e-10},
    )
    return found.x[-1] * size if np.abs(missed(found.x)).max() < 10 * MET else -np.inf


def reaches(rng, sets, hover, u, low, starts):
    """Tells whether pushes of up to `low` along u are found: a random share of it, then all."""
    share = rng.uniform(0.0, 0.98)
    x = held(rng, sets, hover + share * low * u, starts)
    for k in range(starts):
        if x is not None and climb(sets, hover, u, x, share * low) >= low * (1.0 - 1e-6) - 1e-9:
            return True
        if x is None and k == 0:
            return False
        share = 1.0 - 10.0 ** -rng.uniform(1.0, 4.0)
        x = held(rng, sets, hover + share * low * u, 3, x)
    return False


def angles_of(sets, f):
    """Returns thrusts and angles x (3n,) in range, whose forces lie nearest to f (n, 3)."""
    out = np.empty((3, len(sets)))
    for j, local in enumerate(np.einsum("nij,ni->nj", sets.frames, f)):
        best = np.inf
        for side in (1.0, -1.0):
            d = side * local / max(np.linalg.norm(local), 1e-12)
            theta, phi = np.arcsin(np.clip(d[0], -1.0, 1.0)), np.arctan2(-d[1], d[2])
            pairs = [(phi, theta)] + [
                (phi + a, np.pi - theta + b) for a in (-np.pi, np.pi) for b in (0.0, -2.0 * np.pi)
            ]
            for a, b in pairs:
                a, b = np.clip(a, *sets.phi[j]), np.clip(b, *sets.theta[j])
                u = np.array([np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)])
                thrust = np.clip(u @ local, sets.low[j], sets.high[j])
                miss = np.linalg.norm(thrust * u - local)
                if miss < best:
                    best, out[:, j] = miss, (thrust, a, b)
    return out.ravel()


class Kept(Pool):
    """A pool of products that is kept: its forces are witnesses of a lower bound."""

    last: ClassVar[dict] = {}

    def __post_init__(self):
        super().__post_init__()
        Kept.last[self.part.start] = self


def witnessed(sets, hover, u, t):
    """Tells whether the proof's own forces give ``hover + t u`` by thrusts and angles in range.

    The forces are the proof's; that they are in range and what they give is worked out here.
    """
    part = SLICES["force"] if u[:3].any() else SLICES["torque"]
    scale = np.linalg.norm(hover) * np.array([1.0, LENGTH])
    pool, e = Kept.last.get(part.start), u[part]
    if pool is None:
        hull = sets.hull((scale[0], scale[1]))
        w0 = hover / np.repeat(scale, 3)
        pool = Kept(hull, w0, part)
        for near in holding_anchors(hull, w0, [np.tile(w0[:3], (len(sets), 1))]):
            index = pool.add(near, e)
            if index >= 0:
                pool.climb(index, e)
    goal = t / scale[part.start // 3]
    for k in range(len(pool.products)):
        start, end = pool.span(k, e)
        if start <= goal <= end and end > start:
            share = (goal - start) / (end - start)
            f = (1.0 - share) * pool.begin(k, e)[1] + share * pool.reach(k, e)[1]
            missed = wrench(sets, angles_of(sets, scale[0] * f)) - hover - t * u
            if np.abs(missed / np.repeat(scale, 3)).max() < 10 * MET:
                return True
    return False


def check(seed, sets, m, starts):
    """Returns lines that say which bounds of margins `m` the searches refute."""
    rng, wrong = np.random.default_rng(seed), []
    for name, part in SLICES.items():
        low, high = getattr(m, f"{name}_bounds")
        worst = np.nan_to_num(m.worst(name))
        others = np.zeros((2, 6))
        others[:, part] = rng.normal(size=(2, 3))
        others /= np.linalg.norm(others, axis=1, keepdims=True)
        for u in ([worst] if worst.any() else []) + ([*others] if low > 0 else []):
            proved = all(witnessed(sets, m.hover_wrench, u, k * low) for k in (rng.uniform(), 1.0))
            if not proved and not reaches(rng, sets, m.hover_wrench, u, low, starts):
                along = f"along {np.round(u[part], 3)}"
                wrong.append(f"{name}: lower {low:.6g} of {high:.6g} not reached {along}")
        if worst.any():
            past = high * (1.0 + 1e-4) + 1e-5 * np.linalg.norm(m.hover_wrench)
            if held(rng, sets, m.hover_wrench + past * worst, 3) is not None:
                wrong.append(f"{name}: upper {high:.6g}, yet {past:.6g} is held along {worst}")
    Kept.last.clear()
    return wrong


def measure(seed, number, searched, starts):
    """Returns what is known of one body: a row for the file, None where hover is out of reach."""
    rng = np.random.default_rng((seed, number))
    sets, hover = random_body(rng)
    scale = float(np.linalg.norm(hover))
    Kept.last.clear()
    begun = time.process_time()
    m = set_margins(sets, hover, force_scale=scale, torque_scale=scale * LENGTH, wrench_starts=0)
    spent = time.process_time() - begun
    if m.wrench_bounds[1] < 0:
        return None
    row = {"body": number, "seconds": spent, "unknown": not m.feasible, "hull": bool(m.hull)}
    row |= {"gaps": [], "wrong": [], "searched": searched}
    if m.feasible:
        row["gaps"] = [
            float(1.0 - low / high) if high > 1e-9 * scale else 0.0
            for low, high in (m.force_bounds, m.torque_bounds)
        ]
        row["wrong"] = check((seed, number), sets, m, starts) if searched else []
    return row


def totals(rows):
    """Returns lines on all rows so far."""
    held_rows = [r for r in rows if not r["unknown"]]
    wrong = sum(len(r["wrong"]) for r in rows)
    searched = sum(r["searched"] for r in held_rows)
    spent = np.mean([r["seconds"] for r in rows]) if rows else np.nan
    lines = [
        f"{len(held_rows)} bodies in reach, {len(rows) - len(held_rows)} within the hull but in no "
        f"pieces; {searched} searched, {wrong} bounds wrong; {spent:.2f} s of one core a body"
    ]
    for hull, label in ((False, "convex sets"), (True, "other sets"), (None, "all")):
        gap = np.array([g for r in held_rows if hull in (None, r["hull"]) for g in r["gaps"]])
        if gap.size:
            lines.append(
                f"{label}: {gap.size} margins, gap median {np.median(gap):.2%}, 95 % within "
                f"{np.quantile(gap, 0.95):.2%}, 99 % within {np.quantile(gap, 0.99):.2%}, worst "
                f"{gap.max():.2%}; within 5 %: {np.mean(gap <= 0.05):.1%}, "
                f"15 %: {np.mean(gap <= 0.15):.1%}"
            )
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="bodies in reach of hover")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first body")
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--every", type=int, default=1, help="search in one body of this many")
    parser.add_argument("--bounds-only", action="store_true", help="no independent searches")
    parser.add_argument("--minutes", type=float, default=np.inf, help="stop after, all the same")
    parser.add_argument("--out", type=Path, help="JSON lines, a body each; bodies in it are taken")
    options = parser.parse_args()
    directions.Pool = Kept
    kept = options.out.read_text().splitlines() if options.out and options.out.exists() else []
    rows = [json.loads(line) for line in kept]
    number = max((r["body"] + 1 for r in rows), default=options.first)
    clock = time.time()
    while sum(not r["unknown"] for r in rows) < options.count:
        if time.time() - clock > 60.0 * options.minutes:
            print("out of time")
            break
        searched = not options.bounds_only and number % options.every == 0
        row = measure(options.seed, number, searched, options.starts)
        number += 1
        if row is None:
            continue
        rows.append(row)
        if options.out:
            with options.out.open("a") as file:
                file.write(json.dumps(row) + "\n")
        for line in row["wrong"]:
            print(f"body {row['body']}: {line}", flush=True)
        if len(rows) % SHOWN == 0:
            print("\n".join(totals(rows)), flush=True)
    print("\n".join([*totals(rows), f"{time.time() - clock:.0f} s in this run"]))
    return int(any(r["wrong"] for r in rows))


if __name__ == "__main__":
    sys.exit(main())
