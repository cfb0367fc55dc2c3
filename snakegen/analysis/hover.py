"""Hover: the thrust that each rotor needs, its reserve, the φ servo's load, and the flight time."""

from dataclasses import replace
from typing import Any

import numpy as np

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.analysis.hover_result import UNMET, Hover
from snakegen.base.geometry import Floats
from snakegen.control.power import battery_joules, power_factors
from snakegen.robot.box_allocation import box_allocation
from snakegen.robot.posture import aim_gimbals
from snakegen.robot.robot import Robot
from snakegen.robot.rotor_streams import kept_in_streams
from snakegen.wrench_margins.vectored import set_margins

COMMAND = "hover"
ORDER = 40
_LOST = 0.01  # of a rotor's thrust: less is not worth a line


def applies(robot: Robot) -> bool:
    """A robot with rotors and a free base."""
    return bool(robot.modules.apparatuses) and robot.floating


def analyze(robot: Robot, q: Floats) -> Hover:
    """Returns hover thrusts at q in both modes, their reserve and the roll servos' load.

    Dual: ``min ‖λ/λ_max‖`` with ``Q_dual λ = w0`` and the limits (a small QP). Virtual: eq 36,
    ``F = Q_force^# w0``. Roll moment: ``Σ_k λ_k (p_k − o) × u_k + drag``, along the roll axis.
    """
    a = allocation(robot, q)
    rotors, gimbals = robot.rotors, robot.gimbals
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    dual = box_allocation(
        a.dual, a.hover_wrench, rows, rotors.thrust_max, rotors.thrust_min, rotors.thrust_max
    )
    forces = np.linalg.pinv(rows[:, None] * a.force, rcond=1e-9) @ (rows * a.hover_wrench)
    moment, largest = _roll_moments(robot, a, dual)
    effort = np.array(
        [
            robot.limits([robot.joint_names[b - 1]])[2][0] if b >= 0 else np.inf
            for b in gimbals.roll_body
        ]
    )
    beyond, short = _reach(robot, q, a, forces.reshape(-1, 3))
    found = Hover(
        dual,
        float(np.linalg.norm(rows * (a.dual @ dual - a.hover_wrench))),
        np.linalg.norm(forces.reshape(-1, 3), axis=1),
        float(np.linalg.norm(rows * (a.force @ forces - a.hover_wrench))),
        np.array(rotors.thrust_max),
        np.array(gimbals.limit),
        moment,
        largest,
        effort,
        a.mass * 9.81,
        np.bincount(rotors.apparatus, rotors.thrust_min, len(gimbals.limit)).astype(float),
        beyond,
        short,
        vectored=bool(robot.gimbal_names),
        power=_powers(robot, dual, np.linalg.norm(forces.reshape(-1, 3), axis=1)),
        battery=battery_joules(robot.modules.plant.get("battery_energy", 0.0)),
        voltage_sag=float(robot.modules.plant.get("voltage_sag", 0.1)),
        apparatuses=robot.apparatus_names,
        stream_loss=_stream_loss(robot, a, dual),
        stream_share=_stream_share(robot),
    )
    if not found.vectored or found.virtual_feasible:
        return found
    return replace(found, possible=_possible(robot, q, a))


def _stream_loss(robot: Robot, a: Allocation, thrust: Floats) -> dict[str, float]:
    """Returns the share, of 1 % or more, that rotors lose to streams of other bodies' rotors."""
    rotors = [r for apparatus in robot.modules.apparatuses for r in apparatus.rotors]
    radius = 0.5 * np.array([max(r.diameter, 1e-6) for r in rotors])
    apart = robot.rotors.body[:, None] != robot.rotors.body
    lost = 1.0 - kept_in_streams(a.rotor_positions, a.rotor_axes, radius, thrust, apart)
    named = zip(rotors, lost, strict=True)
    return {r.label: float(x) for r, x in named if x >= _LOST}


def _stream_share(robot: Robot) -> dict[str, float]:
    """Returns the share of its still-air thrust that limits count on, of each rotor in a stream."""
    rotors = [r for apparatus in robot.modules.apparatuses for r in apparatus.rotors]
    return {r.label: r.stream_efficiency for r in rotors if r.stream_efficiency < 1.0}


def _possible(robot: Robot, q: Floats, a: Allocation) -> bool | None:
    """Returns whether some forces of the apparatuses' sets give the hover wrench, None if open."""
    scale: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    m = set_margins(robot.force_sets(q), a.hover_wrench, wrench_starts=0, **scale)
    low, high = (float(x) for x in m.wrench_bounds)
    return True if low > 0.0 else False if high < 0.0 else None  # 0: a lost rank, no proof


def _reach(
    robot: Robot, q: Floats, a: Allocation, forces: Floats
) -> tuple[tuple[tuple[str, float], ...], Floats]:
    """Returns gimbals that forces (Ñ, 3), link axes, turn past their limits, and angles short.

    An apparatus without a force keeps its direction.
    """
    base, _ = robot.base_pose(q)
    size = np.linalg.norm(forces, axis=1)
    asked = size > UNMET * a.mass
    up = np.einsum("nij,nj->ni", a.link_axes, forces) / np.where(asked, size, 1.0)[:, None]
    directions = np.where(asked[:, None], up, [0.0, 0.0, 1.0]) @ base.T
    short = np.where(asked, aim_gimbals(robot, q, directions)[1], 0.0)
    free = robot.angles(aim_gimbals(robot, q, directions, limited=False)[0])
    low, high, _ = robot.limits(robot.joint_names)
    beyond = []
    for j, apparatus in enumerate(robot.modules.apparatuses):
        for name in (apparatus.roll, apparatus.pitch):
            if name is None or short[j] < UNMET:
                continue
            k = robot.joint_names.index(name)
            if not low[k] - UNMET <= free[k] <= high[k] + UNMET:
                beyond.append((name, float(free[k])))
    return tuple(beyond), short


def _powers(robot: Robot, dual: Floats, virtual: Floats) -> tuple[float, float]:
    """Returns the electric power [W] of hover in both modes; a pair shares its force equally."""
    owner = robot.rotors.apparatus
    shared = (virtual / np.bincount(owner))[owner]
    factors = power_factors(robot)
    dual_power, virtual_power = (factors @ np.maximum(t, 0.0) ** 1.5 for t in (dual, shared))
    return float(dual_power), float(virtual_power)


def _roll_moments(robot: Robot, a: Allocation, thrust: Floats) -> tuple[Floats, Floats]:
    """Returns each roll servo's moment [N·m] for `thrust`, and the largest the limits allow."""
    rotors, gimbals = robot.rotors, robot.gimbals
    now, most = np.zeros(gimbals.limit.size), np.zeros(gimbals.limit.size)
    for j in range(gimbals.limit.size):
        mine = np.flatnonzero(rotors.apparatus == j)
        # at hover the roll axis and the thrust are square: use the link's own x as the axis
        axis = a.link_axes[j] @ _roll_axis(robot, j)
        arm = a.rotor_positions[mine] - a.thrust_points[j]
        unit = (
            np.cross(arm, a.rotor_axes[mine]) + rotors.torque_ratio[mine, None] * a.rotor_axes[mine]
        ) @ axis
        now[j] = float(unit @ thrust[mine])
        high, low = rotors.thrust_max[mine], rotors.thrust_min[mine]
        up = np.where(unit > 0, high, low) @ unit
        down = np.where(unit < 0, high, low) @ unit
        most[j] = max(abs(float(up)), abs(float(down)))
    return now, most


def _roll_axis(robot: Robot, j: int) -> Floats:
    """Returns the roll axis of apparatus j in its link's axes."""
    roll = int(robot.gimbals.roll_body[j])
    if roll < 0:
        return np.array([1.0, 0.0, 0.0])
    in_parent = robot.tree.rotation[roll] @ robot.tree.axis[roll]
    if robot.tree.parent[roll] == robot.gimbals.link_body[j]:
        return np.asarray(robot.gimbals.link_rotation[j].T @ in_parent)
    return np.array([1.0, 0.0, 0.0])
