"""Actuation: rank, condition and class of each mode, against the paper's own rule."""

from dataclasses import replace
from typing import Any

import numpy as np

from snakegen.analysis.actuation_result import Actuation, ModeClass, Rank
from snakegen.analysis.allocation import Allocation, allocation
from snakegen.base.describe_motion import motions
from snakegen.base.geometry import Floats
from snakegen.control.lost_motion import dual_loss
from snakegen.control.one_sided import one_sided_loss
from snakegen.robot.kinematics import forward
from snakegen.robot.robot import Robot

COMMAND = "actuation"
ORDER = 20
AT_LIMIT = 1e-6  # rad, of a gimbal from the end of its range
WHOLE_TURN = 2e-3  # rad: limits of ±3.14 mean a whole turn
RANK_TOLERANCE = 1e-6  # of the largest singular value


def applies(robot: Robot) -> bool:
    """A robot with rotors and a free base."""
    return robot.floating and bool(robot.modules.apparatuses)


def scaled(robot: Robot, matrix: Floats, columns: Floats) -> Floats:
    """Returns ``diag(1/F0, 1/T0) matrix diag(columns)``, free of units."""
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    return np.asarray(rows[:, None] * matrix * columns)


def analyze(robot: Robot, q: Floats) -> Actuation:
    """Ranks the allocation matrices at q and classes each mode.

    Columns are scaled by the largest thrust; a gimbal's column counts 1 rad, 0 where its limits
    leave it no range. Tolerance 1e-6 σ1.
    """
    a = allocation(robot, q)
    limits, rotor_limits = robot.gimbals.limit, robot.rotors.thrust_max
    count = limits.size
    rises, falls, held = _room(robot, q)
    gimbal = turning_gimbals(robot)
    inputs = {
        "dual": (a.dual, rotor_limits),
        "virtual": (a.virtual, limits),
        "force": (a.force @ _turnable(robot, q, a), np.repeat(limits, 3)),
        "jacobian": (a.jacobian, np.concatenate([limits, gimbal])),
        "all": (
            np.hstack([a.dual, a.jacobian[:, count:]]),
            np.concatenate([rotor_limits, gimbal]),
        ),
    }
    ranks = {k: _rank(robot, k, m, c, a.thrust_points) for k, (m, c) in inputs.items()}
    vectored = bool(robot.gimbal_names)
    up = a.hover_wrench[:3] / np.linalg.norm(a.hover_wrench[:3])
    rows = scaled(robot, a.dual, rotor_limits)
    trunc = np.vstack([up @ rows[:3], rows[3:]])
    loss = dual_loss(
        a.dual,
        robot.rotors,
        up=up,
        length=robot.link_length,
        weight=robot.force_scale,
        least=RANK_TOLERANCE * float(np.linalg.norm(trunc, 2)),
    )
    classes = _classes(ranks, trunc, count, vectored, loss)
    lost = one_sided_loss(scaled(robot, *inputs["jacobian"]), rises, falls) if vectored else None
    if lost is not None and ranks["jacobian"].rank == 6:
        classes = (classes[0], _one_sided(robot, a, classes[1], lost, held))
    return Actuation(
        RANK_TOLERANCE,
        robot.force_scale,
        robot.torque_scale,
        tuple(ranks.values()),
        classes,
        a,
    )


def _room(robot: Robot, q: Floats) -> tuple[Any, Any, tuple[str, ...]]:
    """Returns which inputs [all λ | all φ | all θ] may rise and fall, and gimbals at a limit.

    Thrusts are those of a level hover, m g/Ñ each, within the limits of each apparatus.
    """
    count = robot.gimbals.limit.size
    share = robot.force_scale / max(count, 1)
    rises, falls = np.ones(3 * count, bool), np.ones(3 * count, bool)
    least = np.bincount(robot.rotors.apparatus, robot.rotors.thrust_min, count)
    rises[:count], falls[:count] = share < robot.gimbals.limit, share > least
    angles, held = robot.angles(q), []
    for j, apparatus in enumerate(robot.modules.apparatuses):
        for k, name in enumerate((apparatus.roll, apparatus.pitch)):
            column = (k + 1) * count + j
            if name is None:
                continue
            low, high, _ = (float(x[0]) for x in robot.limits([name]))
            if high - low >= 2.0 * np.pi - WHOLE_TURN:
                continue
            angle = angles[robot.joint_names.index(name)]
            rises[column], falls[column] = angle < high - AT_LIMIT, angle > low + AT_LIMIT
            if not (rises[column] and falls[column]):
                held.append(name)
    return rises, falls, tuple(held)


def _one_sided(
    robot: Robot, a: Allocation, found: ModeClass, lost: Floats, held: tuple[str, ...]
) -> ModeClass:
    """Returns the class of virtual-single-rotor mode where limits take one sense of a motion."""
    wrench = lost * np.repeat([robot.force_scale, robot.torque_scale], 3)
    twist = np.concatenate([wrench[:3], wrench[3:] / robot.link_length**2])
    what = motions(twist[:, None], robot.link_length, a.thrust_points)[0]
    where = ", ".join(held) or "thrusts"
    sentence = f"J_w has rank 6, but {where} at a limit: one sense of {what} is out of reach"
    return replace(found, value="underactuated", sentence=sentence, agrees=False)


def _turnable(robot: Robot, q: Floats, a: Allocation) -> Floats:
    """Returns the projector (3Ñ, 3Ñ) onto the forces that gimbals can turn to, link axes.

    All of space with two gimbal axes, the plane across the axis with one, the thrust axis with
    none.
    """
    gimbals, tree = robot.gimbals, robot.tree
    base, origin = robot.base_pose(q)
    rotation, _ = forward(tree, base, origin, robot.angles(q))
    out = np.zeros((3 * gimbals.limit.size,) * 2)
    for j, bodies in enumerate(zip(gimbals.roll_body, gimbals.pitch_body, strict=True)):
        turning = [int(b) for b in bodies if b >= 0 and _range(robot, int(b)) > AT_LIMIT]
        part = np.eye(3)
        if len(turning) < 2:
            body = turning[0] if turning else int(gimbals.thrust_body[j])
            axis = tree.axis[body] if turning else gimbals.thrust_axis[j]
            u = a.link_axes[j].T @ base.T @ rotation[body] @ axis
            part = np.eye(3) - np.outer(u, u) if turning else np.outer(u, u)
        out[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] = part
    return out


def turning_gimbals(robot: Robot) -> Floats:
    """Returns (2Ñ,) [all φ | all θ]: 1 for a joint with a range, 0 for one without; 1 if absent."""
    bodies = np.concatenate([robot.gimbals.roll_body, robot.gimbals.pitch_body])
    return np.array([float(b < 0 or _range(robot, int(b)) > AT_LIMIT) for b in bodies])


def _range(robot: Robot, body: int) -> float:
    """Returns the range [rad] of the joint that moves `body`."""
    low, high, _ = robot.limits([robot.joint_names[body - 1]])
    return float(high[0] - low[0])


def _rank(robot: Robot, name: str, matrix: Floats, columns: Floats, points: Floats) -> Rank:
    whole = np.zeros((6, max(6, matrix.shape[1])))
    whole[:, : matrix.shape[1]] = scaled(robot, matrix, columns)
    left, sigma, _ = np.linalg.svd(whole)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma[0])) if sigma[0] > 0 else 0
    condition = float(sigma[0] / sigma[5]) if rank == 6 else float("inf")
    unscale = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    twists = unscale[:, None] * left[:, rank:]
    lost = motions(twists, robot.link_length, points)
    return Rank(name, tuple(float(s) for s in sigma), rank, condition, lost)


def _classes(
    ranks: dict[str, Rank], truncated: Floats, count: int, vectored: bool, loss: str
) -> tuple[ModeClass, ...]:
    """Returns a class for each mode; the paper's rules are about apparatuses that turn."""
    dual = _dual_class(ranks["dual"], truncated, count, loss)
    if vectored:
        return dual, _virtual_class(ranks, count)
    return (replace(dual, paper="about rotors on gimbals; this robot has none", agrees=True),)


def _dual_class(rank: Rank, truncated: Floats, count: int, loss: str) -> ModeClass:
    """Gimbals held, every rotor free: six, or four degrees of freedom, or no stable hover."""
    paper = "underactuated by design: the paper flies two apparatuses in this mode"
    sigma = np.linalg.svd(truncated, compute_uv=False)
    four = sigma.size == 4 and sigma[-1] > RANK_TOLERANCE * sigma[0]
    if rank.rank == 6:
        return ModeClass(
            "dual_rotor", "fully_actuated", "Q_dual has rank 6 with the gimbals held", paper, True
        )
    if four:
        sentence = (
            f"Q_dual has rank {rank.rank}; altitude and attitude can be "
            f"commanded (σ4 of [f_z; τ] {sigma[-1]:.3g}), {'; '.join(rank.lost)} cannot"
        )
        return ModeClass("dual_rotor", "underactuated", sentence, paper, True)
    sentence = (
        f"Q_dual has rank {rank.rank} and [f_z; τ] not 4: thrusts alone cannot hold altitude and "
        f"attitude; {loss}"
    )
    return ModeClass("dual_rotor", "uncontrollable", sentence, paper, count != 2)


def _listed(lost: tuple[str, ...], one: str, more: str) -> str:
    """Returns motions joined, with the verb that fits their number."""
    return f"{'; '.join(lost)} {one if len(lost) == 1 else more}"


def _virtual_class(ranks: dict[str, Rank], count: int) -> ModeClass:
    """Thrust and gimbals free: full when the instantaneous map J_w has rank 6."""
    jacobian, force = ranks["jacobian"], ranks["force"]
    full = jacobian.rank == 6
    paper_full = count > 2
    paper = (
        f"Ñ = {count} {'>' if paper_full else '≤'} 2, so "
        f"{'fully' if paper_full else 'under'}-actuated"
    )
    if full and force.rank == 6:
        sentence = f"J_w has rank 6 (σ6/σ1 {1 / jacobian.condition:.2g}), as has Q_force"
    elif full:
        sentence = (
            f"J_w reaches rank 6 through the gimbal offset alone (σ6/σ1 "
            f"{1 / jacobian.condition:.2g}); Q_force has rank {force.rank} and cannot "
            f"resist {'; '.join(force.lost)}"
        )
    else:
        sentence = f"J_w has rank {jacobian.rank}: {_listed(jacobian.lost, 'is', 'are')} lost"
    value = "fully_actuated" if full else "underactuated"
    return ModeClass("virtual_single_rotor", value, sentence, paper, full == paper_full)
