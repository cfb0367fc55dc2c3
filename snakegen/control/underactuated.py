"""Dual-rotor allocation and the horizontal law of under-actuated models (eqs 20-28)."""

from typing import Any

import numpy as np

from snakegen.control.controller import Controller, ControlRefused
from snakegen.control.dual_allocation import (
    allocate_dual,
    horizontal,
    level_axes,
    rotor_map,
    tilted_target,
    truncated,
    truncated_wrench,
    vectored_gimbals,
)
from snakegen.control.frame import CogFrame
from snakegen.control.fully_actuated import Allocation
from snakegen.control.gains import Floats
from snakegen.control.lost_motion import frame_loss
from snakegen.kernels.allocation.compliance import yielding_thrusts
from snakegen.kernels.allocation.mode_blending import DUAL_SIGMA_MIN
from snakegen.kernels.allocation.types import RotorBounds
from snakegen.kernels.dynamics.joint_loads import no_loads
from snakegen.robot.gimbal_geometry import joint_order


def attitude_for(controller: Controller, frame: CogFrame, force: Any, target: Any) -> Floats:
    """Returns the attitude (3, 3) that makes the horizontal part of a force: eqs 23-24.

    ``roll = roll_t + k_φ (f_x sinψ - f_y cosψ)/(m g)``, ``pitch = pitch_t + k_θ (f_x cosψ + f_y
    sinψ)/(m g)``, in ``Rz(ψ) Ry(pitch) Rx(roll)``.

    Args:
        controller: k_φ, k_θ and the tilt limit.
        frame: the posture (for ψ and m g).
        force: (3,) N, world.
        target: (3, 3) attitude wanted; its tilt is kept as the level one.
    """
    law = controller.law
    ahead, left = horizontal(np.array(force, float), frame.axes)
    weight = frame.mass * law.gravity
    return np.asarray(
        tilted_target(ahead, left, np.array(target, float), weight, law.attitude, law.tilt_limit)
    )


def gimbals_for(
    controller: Controller, frame: CogFrame, force: Any, target: Any, last: Any = None
) -> Floats:
    """Returns gimbals (Ñ, 2) [rad] along ``[k_θi f'_x, k_φi f'_y, m g]``: eqs 25-28.

    The direction holds in the CoG frame when it stands as `target` leans; arguments as in
    `attitude_for`, `last` (Ñ, 2) rad are the gimbals to stay near.
    """
    law, m = controller.law, frame.mounts
    turns = np.zeros((controller.apparatuses, 2)) if last is None else np.array(last, float)
    ahead, left = horizontal(np.array(force, float), frame.axes)
    angles = vectored_gimbals(
        m,
        ahead,
        left,
        level_axes(np.array(target, float)),
        frame.mass * law.gravity,
        law.vectoring,
        joint_order(m, law.gimbal_lower),
        joint_order(m, law.gimbal_upper),
        joint_order(m, turns),
    )
    return np.asarray(joint_order(m, angles))


def allocate(
    controller: Controller,
    frame: CogFrame,
    wrench: Any,
    gimbals: Any,
    target: Any = None,
    *,
    force: bool = False,
) -> Allocation:
    """Returns rotor thrusts that give ``[f_z; τ]`` of `wrench` at held gimbals: eqs 20-22.

    Args:
        controller: limits and options.
        frame: the posture.
        wrench: (6,) wanted, axes of the frame.
        gimbals: (Ñ, 2) rad.
        target: (3, 3) target attitude, whose tilt defines z; level if not given.
        force: True answers below the σ_min threshold too.

    Raises:
        ControlRefused: the scaled σ_min(Q_trunc) is below 1e-3: attitude and altitude are lost.
    """
    m, rotors, law = frame.mounts, controller.rotors, controller.law
    tilt = level_axes(np.eye(3) if target is None else np.array(target, float))
    turns = np.array(gimbals, float)
    full = rotor_map(m, frame.rotors, joint_order(m, turns))
    q, wanted = truncated(full, tilt), truncated_wrench(np.array(wrench, float), tilt)
    least, most = rotors.thrust_min, rotors.thrust_max
    if law.constrained:
        angles, give = joint_order(m, turns), joint_order(m, law.gimbal_give)
        bounds = RotorBounds(least, most, law.constrained, no_loads(q.shape[1]))
        thrust, stands, sigma = yielding_thrusts(
            m, frame.rotors, angles, give, tilt, wanted, frame.scale[2:], bounds
        )
        full = rotor_map(m, frame.rotors, stands)
        q = truncated(full, tilt)
    else:
        thrust, sigma = allocate_dual(q, wanted, frame.scale[2:], most)
    if sigma < DUAL_SIGMA_MIN and not force:
        why = frame_loss(full, rotors, frame.scale, tilt)
        raise ControlRefused(
            f"dual-rotor mode cannot hold this posture: scaled σ_min of [f_z; τ] is {sigma:.2g}; "
            f"{why or 'it changes with the thrust'}."
        )
    missed = float(np.linalg.norm(q @ thrust - wanted))
    return Allocation(thrust, turns, full @ thrust, float(sigma), 0, missed)
