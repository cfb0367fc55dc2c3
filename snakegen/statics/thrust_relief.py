"""Thrust as an actuator of an arm: what it takes off the joints, and what the tip can then push.

Each apparatus gives a force in any direction up to its thrust limit (a ball; gimbals are taken as
free to turn). ``τ = τ_load - Σ J_jᵀ f_j`` stays within the servos' limits. Both questions are cone
programs, solved by linear ones: a ball is cut by the plane at the force that leaves it, until none
does. The linear program bounds from outside; forces scaled back into their balls, from inside.
"""

from dataclasses import dataclass, replace

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.allocation_maps import mean_drag
from snakegen.robot.kinematics import tip_jacobian
from snakegen.robot.robot import Robot

_CUTS = 200
_CLOSE = 1e-6  # of a thrust limit, by which a force may leave its ball before it is cut


@dataclass(frozen=True)
class ThrustMap:
    """Thrust and joints of an arm in a posture.

    Attributes:
        joints: (k,) names of the chain's.
        relief: (k, 3 m) N·m per newton of each apparatus' force, world axes: ``Jᵀ``.
        limit: (m,) N, of each apparatus.
        effort: (k,) N·m, of the servos.
    """

    joints: tuple[str, ...]
    relief: Floats
    limit: Floats
    effort: Floats


@dataclass(frozen=True)
class Relieved:
    """A solution of a program over thrusts.

    Attributes:
        value: reached by `forces`: the share of servo torque, or the force at the tip [N].
        bound: that no forces get past; from outside.
        forces: (m, 3) N, world axes.
    """

    value: float
    bound: float
    forces: Floats


def thrust_map(robot: Robot, q: Floats) -> ThrustMap:
    """Returns thrust and joints of an arm in posture q (nq,)."""
    gimbals, angles = robot.gimbals, robot.angles(q)
    base = robot.base_pose(q)[0]
    index = [robot.joint_names.index(n) for n in robot.chain_joints]
    count = len(robot.modules.apparatuses)
    drag = mean_drag(robot.rotors, count)
    columns = []
    for j in range(count):
        body, point = int(gimbals.thrust_body[j]), gimbals.thrust_point[j]
        J = tip_jacobian(robot.tree, base, angles, body, point)[2]
        columns.append((J[:3] + drag[j] * J[3:]).T[index])
    effort = robot.limits(robot.chain_joints)[2]
    return ThrustMap(robot.chain_joints, np.hstack(columns), gimbals.limit.copy(), effort)


def least_use(thrust: ThrustMap, load: Floats, slack: Floats | float = 0.0) -> Relieved:
    """Returns the forces that make the highest share of servo torque least.

    ``min t`` with ``|load - Jᵀ f| ≤ t τ_max + slack``, each force within its ball.

    Args:
        thrust: from `thrust_map`.
        load: (k,) N·m that the joints carry without thrust.
        slack: (k,) N·m, by which the load may differ, for a bound of all such loads.
    """
    size = thrust.relief.shape[1]
    share = thrust.relief / thrust.effort[:, None]
    wanted = load / thrust.effort
    one = np.ones((len(wanted), 1))
    rows = np.vstack([np.hstack([-share, -one]), np.hstack([share, -one])])
    free = slack / thrust.effort
    right = np.concatenate([free - wanted, free + wanted])
    cost = np.zeros(size + 1)
    cost[-1] = 1.0
    x = _within_balls(thrust, cost, rows, right, (0.0, None))
    if x is None:  # t is free to grow: cannot happen
        return Relieved(float(np.abs(wanted).max()), 0.0, np.zeros((len(thrust.limit), 3)))
    forces = _least_forces(thrust, share, wanted, _scaled(thrust, x[:-1]))
    value = float(np.abs(wanted - share @ forces.ravel()).max())
    return Relieved(value, float(x[-1]), forces)


def _least_forces(thrust: ThrustMap, share: Floats, wanted: Floats, forces: Floats) -> Floats:
    """Returns forces (m, 3) of least norm that reach the share of `forces`; these where none do."""
    from scipy.optimize import minimize

    best = float(np.abs(wanted - share @ forces.ravel()).max())
    room = best * (1.0 + 1e-6) + 1e-9
    squares = thrust.limit**2
    found = minimize(
        lambda f: 0.5 * f @ f,
        forces.ravel(),
        jac=lambda f: f,
        constraints=[
            {
                "type": "ineq",
                "fun": lambda f: np.concatenate(
                    [room - wanted + share @ f, room + wanted - share @ f]
                ),
                "jac": lambda _: np.vstack([share, -share]),
            },
            {
                "type": "ineq",
                "fun": lambda f: squares - np.sum(f.reshape(-1, 3) ** 2, axis=1),
            },
        ],
        method="SLSQP",
        options={"maxiter": 200, "ftol": 1e-10},
    )
    better = _scaled(thrust, np.asarray(found.x))
    reached = float(np.abs(wanted - share @ better.ravel()).max())
    return better if found.success and reached <= best + 1e-6 else forces


def tip_force(thrust: ThrustMap, load: Floats, pull: Floats, close: float = _CLOSE) -> Relieved:
    """Returns nearly the largest force at the tip, along a direction, that thrust and servos hold.

    ``max s`` with ``|load - s Jᵀ_tip u - Jᵀ f| ≤ τ_max``. A value of nan: not even s = 0. Servos
    keep what forces lose where they are drawn back into their balls; `tip_bound` has the bound.

    Args:
        thrust: from `thrust_map`.
        load: (k,) N·m that the joints carry without thrust and tip force.
        pull: (k,) N·m per newton at the tip along the direction: ``Jᵀ_tip u``.
        close: share of a thrust limit by which the outer program may exceed it.
    """
    count = len(thrust.limit)
    size = np.linalg.norm(thrust.relief.reshape(-1, count, 3), axis=2)
    effort = np.maximum(thrust.effort - close * size @ thrust.limit, 0.0)
    x = _farthest(replace(thrust, effort=effort), load, pull, close)
    nothing = np.zeros((count, 3))
    if x is None or np.isinf(x[-1]):
        value = float("nan" if x is None else "inf")
        return Relieved(value, np.inf, nothing)
    value, forces = force_along(thrust, load, pull, _scaled(thrust, x[:-1]))
    return Relieved(value, np.inf, forces)


def tip_bound(thrust: ThrustMap, load: Floats, pull: Floats) -> float:
    """Returns what no force at the tip exceeds [N]; arguments as of `tip_force`."""
    x = _farthest(thrust, load, pull, _CLOSE)
    return float("nan") if x is None else float(x[-1])


def _farthest(thrust: ThrustMap, load: Floats, pull: Floats, close: float) -> Floats | None:
    """Returns forces (3 m,) and s of the largest s, as `_within_balls`."""
    both = np.hstack([thrust.relief, pull[:, None]])
    rows = np.vstack([both, -both])
    right = np.concatenate([load + thrust.effort, thrust.effort - load])
    cost = np.zeros(both.shape[1])
    cost[-1] = -1.0
    return _within_balls(thrust, cost, rows, right, (0.0, None), close)


def force_along(
    thrust: ThrustMap, load: Floats, pull: Floats, forces: Floats
) -> tuple[float, Floats]:
    """Returns the largest force [N] at the tip that is borne with less or all of these forces.

    ``max s`` with ``|load - s pull - Σ λ_j J_jᵀ f_j| ≤ τ_max``, 0 ≤ λ_j ≤ 1: directions of the
    forces stay. And the forces (m, 3) [N]; nan where none are borne. Arguments as of `tip_force`.
    """
    from scipy.optimize import linprog

    count = len(forces)
    columns = (thrust.relief * forces.ravel()).reshape(len(load), count, 3).sum(axis=2)
    both = np.hstack([columns, pull[:, None]])
    rows, right = (
        np.vstack([both, -both]),
        np.concatenate([load + thrust.effort, thrust.effort - load]),
    )
    cost = np.append(np.zeros(count), -1.0)
    found = linprog(cost, rows, right, bounds=[(0.0, 1.0)] * count + [(0.0, None)], method="highs")
    if found.status == 3:
        return np.inf, forces
    if found.status != 0:
        return np.nan, forces
    return float(found.x[-1]), found.x[:-1, None] * forces


def _within_balls(
    thrust: ThrustMap,
    cost: Floats,
    rows: Floats,
    right: Floats,
    last: tuple[float, float | None],
    close: float = _CLOSE,
) -> Floats | None:
    """Solves ``min cost·x``, ``rows x ≤ right`` with the forces in x within their balls.

    x holds the forces (3 m,) and one more number, in the range `last`. None where nothing is
    feasible; its last entry is inf where the program is unbounded.
    """
    from scipy.optimize import linprog

    bounds = [(-f, f) for f in np.repeat(thrust.limit, 3)] + [last]
    cuts, ends = rows, right
    x: Floats | None = None
    for _ in range(_CUTS):
        found = linprog(cost, A_ub=cuts, b_ub=ends, bounds=bounds, method="highs")
        if found.status == 3:
            return np.append(np.zeros(len(cost) - 1), np.inf)
        if found.status != 0:
            return None
        x = np.asarray(found.x)
        forces = x[:-1].reshape(-1, 3)
        size = np.linalg.norm(forces, axis=1)
        out = np.flatnonzero(size > thrust.limit * (1.0 + close))
        if not len(out):
            return x
        more = np.zeros((len(out), len(cost)))
        for i, j in enumerate(out):
            more[i, 3 * j : 3 * j + 3] = forces[j] / size[j]
        cuts, ends = np.vstack([cuts, more]), np.concatenate([ends, thrust.limit[out]])
    return x


def _scaled(thrust: ThrustMap, flat: Floats) -> Floats:
    """Returns forces (m, 3), those outside their balls drawn back to them."""
    forces = flat.reshape(-1, 3)
    size = np.maximum(np.linalg.norm(forces, axis=1), 1e-300)
    return np.asarray(forces * np.minimum(1.0, thrust.limit / size)[:, None])
