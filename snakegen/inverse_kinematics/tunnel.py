"""Follow the leader in space: a whole body enters a hole and stays on its centreline.

What a point of the body does the next one repeats: with the tip at arc length s of the centreline,
whatever of the body is nearer to the tip than s has to lie on it too. The base is held, or fed
along the hole's first direction. Each step is a bounded least-squares problem; joints that are
still outside are free and fold the rest of the body.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.inverse_kinematics.body_line import Body, off_line
from snakegen.inverse_kinematics.hole import Hole
from snakegen.inverse_kinematics.path_following import Chain

_TIP = 30.0  # weight of the tip's error against the body's
_WALL = 10.0  # weight of what stands in the wall about the mouth
_PULL = 1e-3  # m/rad, weight of the joints' way from mid-range
_STILL = 2e-2  # m/rad, weight of a step's length: no leap between two folds of the body outside
_ITERATIONS = 15
_FIRST = 100  # iterations at the mouth, from wherever the arm stands
_FOLDS = 6  # postures at the mouth that are tried
_SETTLED = 1e-7  # m and rad, of a step
_FREE = 1e-4  # rad from a limit at which a joint counts as held


@dataclass(frozen=True)
class Entry:
    """How a body went into a hole, a row a step.

    Attributes:
        depth: (m,) m, of the tip along the centreline.
        angles: (m, k) rad, of the chain's joints.
        feed: (m,) m, of the base along the hole's first direction.
        off: (m,) m, largest distance of the body's line inside from the centreline.
        between: m, the same while joints turn from step to step.
        tip_error: (m,) m.
        whole: m, length of the centreline.
        why: "" if all of it was entered, else what stopped the next step.
    """

    depth: Floats
    angles: Floats
    feed: Floats
    off: Floats
    tip_error: Floats
    whole: float
    why: str
    between: float = 0.0


def enter(
    chain: Chain, full: Floats, hole: Hole, *, feed: float, step: float, give_up: float
) -> Entry:
    """Leads a chain into a hole, as far as it gets: the deepest way of several folds outside.

    Args:
        chain: from `chain_of`.
        full: (n-1,) the tree's angles at the start, the tip near the mouth.
        hole: the centreline and the room about it.
        feed: m, that the base can go along the hole's first direction; 0: it is held.
        step: m, between two depths.
        give_up: m, tip error at which it is lost.

    Raises:
        AnalysisError: no posture was found that stands outside with its tip in the mouth.
    """
    rng, best, trouble = np.random.default_rng(0), None, ""
    for k in range(_FOLDS):
        begin = full.copy()
        if k > 0:
            share = rng.uniform(0.1, 0.9, len(chain.joints))
            begin[chain.joints] = chain.lower + share * (chain.upper - chain.lower)
        rows, why = _lead(chain, begin, hole, feed, step, give_up)
        trouble = trouble or why
        if rows and (best is None or len(rows) > len(best[0])):
            best = rows, why
        if best is not None and (not best[1] or "stretched" in best[1]):
            break
    if best is None:
        raise AnalysisError(f"the body cannot stand outside with its tip in the mouth: {trouble}.")
    columns = [np.array(c) for c in zip(*best[0], strict=True)]
    whole = float(hole.arcs[-1])
    entry = Entry(columns[0], columns[1], columns[2], columns[3], columns[4], whole, best[1])
    between = off_between(Body(chain, 1), entry, full, hole)
    return replace(entry, between=max(between, float(entry.off.max())))


def _lead(
    chain: Chain, full: Floats, hole: Hole, feed: float, step: float, give_up: float
) -> tuple[list[tuple[float, Floats, float, float, float]], str]:
    """Returns the rows of `Entry` from one posture, and what stopped it, "" if nothing did."""
    body, seen = Body(chain), Body(chain, 1)
    whole, fed = float(hole.arcs[-1]), 0.0
    rows: list[tuple[float, Floats, float, float, float]] = []
    for s in np.linspace(0.0, whole, max(int(np.ceil(whole / step)), 1) + 1):
        full, fed = _settle(body, full, fed, hole, float(s), feed)
        places = seen.places(full, fed * hole.inwards)
        off, outside = off_line(seen, places, hole, float(s))
        error = float(np.linalg.norm(places[0] - hole.at(float(s))))
        short = float(np.linalg.norm(hole.at(float(s)) - feed * hole.inwards)) - chain.scale
        if error > give_up and short > 0:
            far = f"the next point is {1e3 * short:.3g} mm beyond the stretched chain"
            return rows, far + (" with all of its feed" if feed > 0 else "")
        why = _trouble(chain, full, fed, feed, hole, error, off, outside, give_up)
        if why:
            return rows, why
        rows.append((float(s), full[chain.joints].copy(), fed if feed > 0 else 0.0, off, error))
    return rows, ""


def _settle(
    body: Body, full: Floats, fed: float, hole: Hole, s: float, feed: float
) -> tuple[Floats, float]:
    """Returns angles and feed with the tip at depth s and the body behind it on the centreline."""
    first = s == 0.0
    chain, k = body.chain, len(body.chain.joints)
    low, high = np.append(chain.lower, 0.0), np.append(chain.upper, max(feed, 1e-9))
    middle = np.append(0.5 * (chain.lower + chain.upper), 0.0)
    x = np.clip(np.append(full[chain.joints], fed), low, high)
    full = full.copy()
    start = x.copy()
    for _ in range(_FIRST if first else _ITERATIONS):
        full[chain.joints] = x[:k]
        residual, rows = _misses(body, full, x[k], hole, s)
        pull = np.append(np.full(k, _PULL), 0.0)
        still = np.append(np.full(k, 0.0 if first else _STILL), 0.0)
        A = np.vstack([rows, np.diag(pull), np.diag(still)])
        b = -np.concatenate([residual, pull * (x - middle), still * (x - start)])
        found = lsq_linear(A, b, bounds=(low - x - 1e-12, high - x + 1e-12), method="bvls").x
        length = float(np.abs(found).max())
        x = np.clip(x + found * min(1.0, 0.3 / max(length, 1e-12)), low, high)
        if length < _SETTLED:
            break
    full[chain.joints] = x[:k]
    return full, float(x[k])


def _misses(body: Body, full: Floats, fed: float, hole: Hole, s: float) -> tuple[Floats, Floats]:
    """Returns what should vanish, and its Jacobian by joints and feed.

    The tip's error; across the centreline, the distance of what should be inside or, one link
    long, straight before it; how far anything else stands beyond the mouth.
    """
    inwards = hole.inwards
    places = body.places(full, fed * inwards)
    feeds = np.broadcast_to(inwards[:, None], (len(places), 3, 1))
    J = np.concatenate([body.jacobians(full), feeds], axis=2)
    drawn = hole.with_run_up(body.run_up)
    on, along, _ = drawn.nearest(places)
    off = places - on
    beyond = (places - hole.points[0]) @ inwards
    led = (body.behind < s + body.run_up) | (
        (beyond > 0.0) & (np.linalg.norm(off, axis=1) < hole.room)
    )
    wall = ~led & (beyond > 0.0)
    led[0] = wall[0] = False
    nearer = np.clip(1.0 + (s - body.behind[led, None]) / body.run_up, 0.1, 1.0)
    weight = nearer**2  # eased in, lest the body leap where another point of it counts
    across = np.eye(3) - along[led, :, None] * along[led, None, :]
    residual = [
        _TIP * (places[0] - hole.at(s)),
        (weight * np.einsum("nij,nj->ni", across, off[led])).ravel(),
        _WALL * beyond[wall],
    ]
    rows = [
        _TIP * J[0],
        (weight[..., None] * (across @ J[led])).reshape(-1, J.shape[2]),
        _WALL * inwards @ J[wall],
    ]
    return np.concatenate(residual), np.vstack(rows)


def off_between(body: Body, entry: Entry, full: Floats, hole: Hole) -> float:
    """Returns the largest distance of the body inside while joints turn from step to step [m].

    Joints and feed go straight from one row of `entry` to the next; eight instants a step.
    """
    joints, worst, full = body.chain.joints, 0.0, full.copy()
    for k in range(len(entry.depth) - 1):
        for w in np.arange(1, 8) / 8.0:
            near, far = 1.0 - w, w
            full[joints] = near * entry.angles[k] + far * entry.angles[k + 1]
            fed = near * entry.feed[k] + far * entry.feed[k + 1]
            s = near * entry.depth[k] + far * entry.depth[k + 1]
            places = body.places(full, fed * hole.inwards)
            worst = max(worst, off_line(body, places, hole, float(s))[0])
    return worst


def _trouble(
    chain: Chain,
    full: Floats,
    fed: float,
    feed: float,
    hole: Hole,
    error: float,
    off: float,
    outside: float,
    give_up: float,
) -> str:
    """Returns why a step is none, "" if it is one."""
    if error <= give_up and off <= hole.room and outside <= give_up:
        return ""
    if error > give_up:
        what = f"the tip stays {1e3 * error:.3g} mm behind"
    elif off > hole.room:
        what = f"the body is {1e3 * off:.3g} mm off the centreline"
    else:
        what = f"the body outside stands {1e3 * outside:.3g} mm in the wall"
    angles = full[chain.joints]
    near = (angles - chain.lower < _FREE) | (chain.upper - angles < _FREE)
    names = [chain.robot.joint_names[j] for j, n in zip(chain.joints, near, strict=True) if n]
    held = [f"{', '.join(names)} at the limit"] if names else []
    if feed > 0 and fed > feed - 1e-6:
        held.append(f"the feed of {feed:g} m is used up")
    return f"{what}" + (f", {' and '.join(held)}" if held else "")
