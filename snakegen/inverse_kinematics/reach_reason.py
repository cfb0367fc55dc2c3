"""Why a tip does not follow a path: the true reason where it is lost, in one sentence."""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.inverse_kinematics.path_following import Chain, Options, Track, place, reach_point
from snakegen.kernels.kinematics.chain import forward


def stretched(chain: Chain) -> tuple[Floats, float]:
    """Returns the first joint's place (3,) and the length of the chain stretched from there [m]."""
    tree, body = chain.robot.tree, chain.tip.body
    length = float(np.linalg.norm(chain.tip.point))
    first = int(chain.joints[0]) + 1
    while body != first:
        length += float(np.linalg.norm(tree.translation[body]))
        body = int(tree.parent[body])
    # Only the first joint's place is read, which no chain joint moves.
    _, position = forward(tree, chain.base, np.zeros(3), np.zeros(len(tree.parent) - 1))
    return position[first], length


def describe_track(
    chain: Chain, full: Floats, path: Floats, missed: float, track: Track | None, loop: Options
) -> str:
    """Returns one sentence about the path's fate, and the reason where it is lost.

    Args:
        chain: that follows.
        full: (n-1,) rad, of the tree, where the path's first point was missed.
        path: (m, 3) m.
        missed: m, distance from the path's first point.
        track: what became of the path; None where its first point is missed.
        loop: the options.
    """
    if track is not None and track.complete:
        text = f"the whole path of {track.whole:.4g} m was followed"
        if track.clearance < 0:
            return f"{text}, but the body passes {length_text(-track.clearance)} outside the port"
        return text
    if track is None:
        at, begin = path[0], f"the path's first point is missed by {length_text(missed)}"
    else:
        at = path[track.reached]
        begin = f"the path is lost after {track.length:.4g} of {track.whole:.4g} m"
        full = full.copy()
        full[chain.joints] = track.angles[-1]
    return f"{begin}: {_reason(chain, full, at, loop)}"


def _reason(chain: Chain, full: Floats, target: Floats, loop: Options) -> str:
    """Returns why the tip does not get from posture `full` to `target` (3,) m."""
    first, whole = stretched(chain)
    far = float(np.linalg.norm(target - first))
    if far > whole:
        return (
            f"the next point is {far:.4g} m from the first joint, "
            f"{length_text(far - whole)} beyond the stretched chain"
        )
    step = float(np.linalg.norm(target - place(chain, full)[0]))
    nearest, left, _ = reach_point(chain, full, target, loop)
    if left <= loop.give_up:
        return (
            f"the next point can be reached, but not in one step of {length_text(step)}; "
            "points closer together would do"
        )
    short = (
        f"no posture found within the joint limits brings the tip nearer than {length_text(left)}"
    )
    angles = nearest[chain.joints]
    near = np.minimum(angles - chain.lower, chain.upper - angles) < 1e-6
    held = [chain.robot.joint_names[j] for j in chain.joints[near]]
    if held:
        return f"{short}: {', '.join(held)} at the limit"
    tip, J = place(chain, nearest)
    u, s, _ = np.linalg.svd(J)
    error = (target - tip) / left
    lost = u[:, [k >= len(s) or s[k] < loop.floor * chain.scale for k in range(3)]]
    if np.linalg.norm(lost.T @ error) > 0.7:
        way = " ".join(f"{x:.2f}" for x in np.round(error, 2) + 0.0)
        return f"{short}: the workspace ends there, the tip cannot move along [{way}]"
    return short


def port_text(room: float, thickest: float) -> str:
    """Returns how near the body's line comes to a port's rim, and whether its links fit.

    Args:
        room: m, from the line to the rim; less than 0 beyond it.
        thickest: m, largest radius of a link.
    """
    words = "from the body's line to its rim" if room >= 0 else "beyond its rim at worst"
    fit = "" if room >= thickest else ", which does not fit"
    body = f"the thickest link has a radius of {length_text(thickest)}{fit}"
    return f"{length_text(abs(room))} {words}; {body}"


def length_text(metres: float) -> str:
    """Returns a length as people say it: mm below a metre."""
    return f"{metres:.3g} m" if metres >= 1.0 else f"{1e3 * metres:.3g} mm"
