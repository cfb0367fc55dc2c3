"""Margins and σ_min along a run, of the mode flown and the rotors that still turn at each instant.

A rotor that stops is missing from its instant on, before the controller knows of it. A virtual
single rotor needs both rotors of its apparatus: one lost takes the whole apparatus out.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller
from snakegen.control.frame import cog_frame
from snakegen.kernels.allocation.fully_actuated import wrench_jacobian
from snakegen.kernels.allocation.gimbals import joint_order
from snakegen.kernels.allocation.underactuated import level_axes, rotor_map, truncated
from snakegen.kernels.control.types import VIRTUAL
from snakegen.kernels.core.cholesky import least_singular_value
from snakegen.kernels.flight.run_history import maps_history
from snakegen.robot.force_sets import force_sets_along
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plan import Plan
from snakegen.wrench_margins.thrust import thrust_margins
from snakegen.wrench_margins.vectored import set_margins

States = tuple[Floats, Floats, Floats]  # base attitude (m, 3, 3), position (m, 3), angles (m, n-1)


def lost_rotors(plan: Plan, time: float) -> tuple[int, ...]:
    """Returns the rotors that have stopped by `time` [s]."""
    gone = {r for f in plan.failures if f.time <= time + 1e-9 for r in f.rotors}
    return tuple(sorted(gone))


def margins_along(
    robot: Robot, controller: Controller, plan: Plan, rows: Any, states: States
) -> dict[str, Floats]:
    """Returns margins (m,) at ticks `rows` of a plan, where the robot was as `states` say.

    Gimbals are taken as they are. Virtual single rotor: wrench, force [N] and torque [N·m]
    margins, lower bounds, and upper ones as `…_upper` where sets are not balls; dual rotor: the
    wrench margin of ``[f_z; τ]``, force and torque undefined (NaN).
    """
    modes = np.full(len(plan.time), controller.mode) if plan.mode is None else plan.mode
    groups: dict[tuple[int, tuple[int, ...]], list[int]] = {}
    for i, k in enumerate(rows):
        key = int(modes[k]), lost_rotors(plan, float(plan.time[k]))
        groups.setdefault(key, []).append(i)
    out: dict[str, Floats] = {}
    maps = maps_history(robot.tree, robot.rotors, robot.gimbals, *states)
    hover = np.zeros((len(rows), 6))
    hover[:, :3] = robot.force_scale * states[0][:, 2]
    for (mode, lost), members in groups.items():
        left = controller.without(lost) if lost else controller
        if mode == VIRTUAL:
            found = _vectored(robot, left, maps[0][members], [s[members] for s in states],
                              hover[members])  # fmt: skip
        else:
            found = _thrusts(robot, left, maps[1][members], hover[members])
        for name, values in found.items():
            out.setdefault(name, np.full(len(rows), np.nan))[members] = values
    return out


def _vectored(
    robot: Robot, controller: Controller, points: Floats, states: Sequence[Floats], hover: Floats
) -> dict[str, Floats]:
    """Returns the margins of virtual single rotors within gimbal limits and least thrusts.

    Certain (lower) bounds, row by row; where all sets are balls the maps at hand are enough, and
    the bounds agree to 1 %. Elsewhere a batch leaves them apart, and the upper ones are kept too.
    """
    lost = np.flatnonzero(controller.gimbals.limit <= 0.0)
    shapes = robot.force_shapes.without(lost)
    if shapes.balls.all():
        sets = replace(shapes, points=points)
    else:
        sets = force_sets_along(robot, *states).without(lost)
    scales: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    m = set_margins(sets, hover, tolerance=1e-2, **scales)
    wrench = np.asarray(m.wrench_bounds)[:, 0]
    out = {
        "wrench_margin": np.where(np.isfinite(wrench), wrench, np.nan),  # -inf: no bound is known
        "force_margin": m.force_bounds[:, 0],
        "torque_margin": m.torque_bounds[:, 0],
    }
    if not shapes.balls.all():
        out["force_margin_upper"] = m.force_bounds[:, 1]
        out["torque_margin_upper"] = m.torque_bounds[:, 1]
    return out


def _thrusts(
    robot: Robot, controller: Controller, dual: Floats, hover: Floats
) -> dict[str, Floats]:
    """Returns the wrench margin of ``[f_z; τ]`` with a controller's thrust limits, row by row."""
    rotors = controller.rotors
    scales: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    m = thrust_margins(dual, rotors.thrust_min, rotors.thrust_max, hover, **scales)
    return {"wrench_margin": m.attitude_altitude}


def true_sigma_min(
    controller: Controller,
    plan: Plan,
    believed: Floats,
    states: States,
    thrust: Floats,
    gimbals: Floats,
) -> Floats:
    """Returns σ_min (T,) without the rotors that have stopped and are not yet known to have.

    Args:
        controller: before any failure.
        plan: with its failures.
        believed: (T,) of the controller, which still counts them.
        states: as they were, T rows.
        thrust: (T, r) N, asked of the rotors.
        gimbals: (T, Ñ, 2) rad, asked.
    """
    out = np.array(believed)
    modes = np.full(len(plan.time), controller.mode) if plan.mode is None else plan.mode
    for failure in plan.failures:
        first, known = np.searchsorted(plan.time, [failure.time - 1e-9, failure.detected - 1e-9])
        for k in range(int(first), min(int(known), len(believed))):
            left = controller.without(lost_rotors(plan, float(plan.time[k])))
            at = states[2][k], states[0][k], states[1][k]
            out[k] = sigma_min(left, int(modes[k]), at, plan.rotation[k], thrust[k], gimbals[k])
    return out


def sigma_min(
    controller: Controller,
    mode: int,
    at: tuple[Floats, Floats, Floats],
    target: Floats,
    thrust: Floats,
    gimbals: Floats,
) -> float:
    """Returns the scaled σ_min of J_w (virtual) or Q_trunc (dual) of what the controller has left.

    `at` are joint angles, base attitude and position; other arguments as in `true_sigma_min`, of
    one tick.
    """
    frame = cog_frame(controller, *at)
    m, limit = frame.mounts, controller.gimbals.limit
    angles = joint_order(m, np.array(gimbals))
    if mode != VIRTUAL:
        tilt = level_axes(np.array(target))
        q = truncated(rotor_map(m, frame.rotors, angles), tilt)
        return float(least_singular_value(q, frame.scale[2:], controller.rotors.thrust_max))
    pushes = np.bincount(controller.rotors.apparatus, thrust, minlength=len(limit))
    turns = (limit > 0.0).astype(float)
    weight = np.concatenate([limit, turns, turns])
    return float(least_singular_value(wrench_jacobian(m, pushes, angles), frame.scale, weight))
