"""Exact derivatives of joint-limited margins by the joints (THEORY A5, A9).

With joint torques within limits a slice's support gains a multiplier for each joint: to the
forces' wrench come the joints' own torques, segments of ± their limit, which must balance
``bias + M f``. So the optimum is that of `saddle_point` in 6 + k dimensions, and with forces f,
twist d and multipliers μ held

    dm/dq = ∂/∂q [d · (Q f - w0) + μ · (bias + D w0 + (M - D Q) f)].
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linprog, minimize

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, near
from snakegen.kernels.allocation.wrench_map import dual_map, rotor_frames
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.sensitivity.chain_rule import BodyPoses
from snakegen.sensitivity.margin_gradient import DUAL, MODES, VIRTUAL
from snakegen.statics.joint_loads import joint_loads
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.gradients import LOOSE, UNIT
from snakegen.wrench_margins.joint_limited import (
    JointLimitedMargins,
    LimitedProblem,
    limited_problem,
)
from snakegen.wrench_margins.joint_limited_rotors import thrust_joint_limited
from snakegen.wrench_margins.joint_limited_sets import sets_joint_limited
from snakegen.wrench_margins.rays import Bounds
from snakegen.wrench_margins.saddle_point import ROUNDED, Saddle, newton

STEP = 1e-5  # rad or m, of differences of closed forms with the optimum held
SMOOTH = 1e-3  # rounding of the norms where the multipliers are looked for


@dataclass(frozen=True, eq=False)
class JointLimitedGradient:
    """A joint-limited margin of one posture and its derivative by the joints.

    Attributes:
        value: the exact margin, N or N·m.
        bounds: (2,) certified ones.
        by_joints: (n-1,) per rad, in the order of ``robot.joint_names``, gimbals included; of the
            weakest direction known, so a subgradient where two tie.
        joints: names of those at their torque limit there.
    """

    value: float
    bounds: Floats
    by_joints: Floats
    joints: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Maps:
    """A posture's problem: scaled, and the axes (n, 3, 3) that its forces are given in."""

    problem: LimitedProblem
    frames: Floats


def joint_limited_gradient(
    robot: Robot, q: Floats, kind: str, mode: str = VIRTUAL, link: str | None = None
) -> JointLimitedGradient:
    """Returns the joint-limited margin at q, exact, and its derivative by the joints.

    Args:
        robot: floating, with apparatuses and joints that have torque limits.
        q: (nq,) configuration; gimbals as they are in it.
        kind: "force" or "torque".
        mode: "virtual_single_rotor" or "dual_rotor".
        link: on which the disturbance acts; the root by default.

    Raises:
        AnalysisError: a robot that cannot hover or has no limited joints, an unknown kind or mode,
            hover out of the joints' reach, apparatuses whose force sets are not convex, a margin
            of 0 for lack of a direction, or an optimum that was not found.
    """
    if mode not in MODES:
        raise AnalysisError(f"mode '{mode}' is unknown.{near(mode, (VIRTUAL, DUAL))}")
    if kind not in ("force", "torque"):
        raise AnalysisError(f"joint-limited margins are force and torque, not '{kind}'.")
    if not robot.modules.apparatuses or not robot.floating:
        raise AnalysisError(f"{robot.name} cannot hover: margins need rotors and a free base.")
    q, mode = robot.validate_configuration(q), MODES[mode]
    loads = joint_loads(robot, q, link)
    if not loads.names or not np.all(np.isfinite(loads.limit) & (loads.limit > 0)):
        raise AnalysisError(f"{robot.name} has no joints with torque limits.")
    if mode == VIRTUAL and not robot.force_sets(q).convex.all():
        raise AnalysisError(
            "joint-limited derivatives need convex force sets: free gimbals, one tilt axis or "
            "fixed rotors without a least thrust; use mode dual_rotor."
        )
    here, bounds = _maps(robot, q, mode, link), _margins(robot, q, mode, link)
    ends = getattr(bounds, f"{kind}_bounds")
    if not ends[1] > 0.0:
        raise AnalysisError(
            f"the joint-limited {kind} margin has no derivative here: "
            + ("hover is out of reach." if np.isnan(ends[1]) else "it is 0, a direction is lost.")
        )
    size = robot.force_scale if kind == "force" else robot.torque_scale
    saddle = _optimum(robot, q, mode, here.problem, kind, bounds, ends / size)
    n = len(here.frames)
    held = np.einsum("jba,jb->ja", here.frames, saddle.forces[:n])
    by = np.empty(len(robot.joint_names))
    for i in range(len(by)):
        values = []
        for side in (STEP, -STEP):
            at = q.copy()
            at[7 + i] += side
            values.append(_lagrangian(_maps(robot, at, mode, link), saddle.twist, held, mode))
        by[i] = (values[0] - values[1]) / (2.0 * STEP)
    stopped = np.abs(saddle.forces[n:, 0]) >= here.problem.limit * (1.0 - 1e-9)
    names = tuple(name for name, yes in zip(loads.names, stopped, strict=True) if yes)
    return JointLimitedGradient(saddle.value * size, ends, by * size, names)


def _bounds_of(robot: Robot, q: Floats, mode: str, link: str | None) -> Bounds:
    loads = joint_loads(robot, q, link)
    rows = loads.forces if mode == VIRTUAL else loads.rotors
    return Bounds(rows, loads.bias, loads.disturbance, loads.limit)


def _load(robot: Robot, q: Floats) -> tuple[BodyPoses, Floats]:
    """Returns the poses in the root's axes and the hover wrench (6,)."""
    poses = BodyPoses.of(robot.tree, robot.angles(q))
    up = robot.base_pose(q)[0][2]
    return poses, np.concatenate([poses.mass * GRAVITY * up, np.zeros(3)])


def _dual(robot: Robot, poses: BodyPoses) -> Floats:
    """Returns Q (6, n) of the rotors."""
    points, axes = rotor_frames(
        robot.rotors, poses.rotation, poses.position, np.ascontiguousarray(poses.cog), np.eye(3)
    )
    return np.asarray(dual_map(robot.rotors, points, axes))


def _maps(robot: Robot, q: Floats, mode: str, link: str | None) -> _Maps:
    """Returns the problem at q."""
    poses, hover = _load(robot, q)
    scale = inputs.scale(robot.force_scale, robot.torque_scale)
    bounds = _bounds_of(robot, q, mode, link)
    if mode == VIRTUAL:
        sets = robot.force_sets(q)
        wrench, frames = inputs.force_map(sets.points, sets.drag), sets.frames
    else:
        wrench = _dual(robot, poses)
        frames = np.broadcast_to(np.eye(3), (wrench.shape[1], 3, 3))
    rows = np.reshape(bounds.rows, (len(bounds.bias), -1))
    return _Maps(limited_problem(wrench, hover, scale, rows, bounds), frames)


def _margins(robot: Robot, q: Floats, mode: str, link: str | None) -> JointLimitedMargins:
    poses, hover = _load(robot, q)
    bounds = _bounds_of(robot, q, mode, link)
    force, torque = robot.force_scale, robot.torque_scale
    if mode == VIRTUAL:
        sets = robot.force_sets(q)
        return sets_joint_limited(sets, hover, bounds, force_scale=force, torque_scale=torque)
    low, high = robot.rotors.thrust_min, robot.rotors.thrust_max
    return thrust_joint_limited(
        _dual(robot, poses), low, high, hover, bounds, force_scale=force, torque_scale=torque
    )


def _optimum(
    robot: Robot,
    q: Floats,
    mode: str,
    problem: LimitedProblem,
    kind: str,
    found: JointLimitedMargins,
    ends: Floats,
) -> Saddle:
    """Returns the optimum near the weakest direction of the certified search.

    Its forces are the apparatuses' or rotors' in newtons, along x where they have one direction,
    then the joints' torques, scaled.
    """
    e = np.zeros(6)
    e[:3] = found.force_direction if kind == "force" else 0.0
    e[3:] = found.torque_direction if kind == "torque" else 0.0
    at = _facet(robot, problem, e) if mode == DUAL else _stationary(robot, q, problem, kind, e)
    loose = LOOSE * ends[1]
    for s in at:
        if s.solved and ends[0] - loose <= s.value <= ends[1] + loose:
            return s
    raise AnalysisError(f"the joint-limited {kind} margin's optimum was not found.")


def _facet(robot: Robot, problem: LimitedProblem, e: Floats) -> list[Saddle]:
    """Returns where the ray along e leaves the rotors' polytope: thrusts, and the facet's duals."""
    n = problem.map.shape[1]
    found = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=np.pad(np.vstack([problem.rows, -problem.rows]), ((0, 0), (0, 1))),
        b_ub=np.r_[problem.limit - problem.bias, problem.limit + problem.bias],
        A_eq=np.column_stack([problem.map, -e]),
        b_eq=problem.hover,
        bounds=[*zip(robot.rotors.thrust_min, robot.rotors.thrust_max, strict=True), (None, None)],
    )
    if found.x is None:
        return []
    over, under = np.split(found.ineqlin.marginals, 2)
    forces = np.zeros((n + len(problem.limit), 3))
    forces[:, 0] = np.r_[found.x[:-1], -problem.bias - problem.rows @ found.x[:-1]]
    twist = np.r_[found.eqlin.marginals, over - under]
    return [Saddle(float(found.x[-1]), twist, forces, True)]


def _stationary(
    robot: Robot, q: Floats, problem: LimitedProblem, kind: str, e: Floats
) -> list[Saddle]:
    """Returns the stationary points that Newton's method reaches from the direction e (6,)."""
    k, sets = len(problem.limit), robot.force_sets(q)
    whole = np.vstack([problem.map, problem.rows])
    slack = np.zeros((k, 3, 6 + k))
    slack[np.arange(k), 0, 6 + np.arange(k)] = 1.0
    line = np.broadcast_to(np.diag([1.0, 0.0, 0.0]), (k, 3, 3))
    size = np.concatenate([np.full(len(sets), robot.force_scale), np.ones(k)])  # all about 1
    jacobians = np.concatenate([whole.reshape(6 + k, -1, 3).transpose(1, 2, 0), slack])
    jacobians = jacobians * size[:, None, None]
    spans = np.concatenate([sets.frames @ sets.spans, line])
    low = np.concatenate([sets.low, -problem.limit]) / size
    high = np.concatenate([sets.high, problem.limit]) / size
    load, rows = np.r_[problem.hover, -problem.bias], np.r_[UNIT[kind], np.zeros(k)]
    start = _multipliers((jacobians, spans, low, high, load), rows, np.r_[e, np.zeros(k)])
    out = []
    for rounded in ROUNDED:
        s = newton(jacobians, spans, (low, high), load, rows, start, rounded)
        out.append(replace(s, forces=s.forces * size[:, None]))
    return out


def _multipliers(
    problem: tuple[Floats, Floats, Floats, Floats, Floats], rows: Floats, start: Floats
) -> Floats:
    """Returns `start` with the free part of the twist and the multipliers at the least support."""
    jacobians, spans, low, high, load = problem
    free = np.flatnonzero(rows == 0.0)
    inside = np.einsum("jca,jck->jak", spans, jacobians)  # along each set's own axes
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    line = (spans**2).sum(axis=(1, 2)) < 1.5
    middle, half = np.where(line, middle, 0.0), np.where(line, half, high)

    def value(x: Floats) -> tuple[float, Floats]:
        d = start.copy()
        d[free] = x
        speed = inside @ d
        length = np.sqrt((speed**2).sum(axis=1) + SMOOTH**2)
        slope = np.einsum("j,ja,jak->k", half / length, speed, inside)
        slope += np.einsum("j,jk->k", middle, inside[:, 0]) - load
        total = half @ length + middle @ speed[:, 0] - load @ d
        return float(total), slope[free]

    out = start.copy()
    out[free] = minimize(value, np.zeros(free.size), jac=True, method="BFGS").x
    return out


def _lagrangian(maps: _Maps, twist: Floats, held: Floats, mode: str) -> float:
    """Returns ``d · (Q f - w0) + μ · (bias + M f)``, forces held in their sets' axes."""
    p = maps.problem
    f = np.einsum("jab,jb->ja", maps.frames, held)
    x = f.ravel() if mode == VIRTUAL else f[:, 0]
    return float(twist[:6] @ (p.map @ x - p.hover) + twist[6:] @ (p.bias + p.rows @ x))
