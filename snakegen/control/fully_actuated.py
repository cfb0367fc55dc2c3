"""Virtual-single-rotor allocation: a full wrench to thrusts and gimbal angles (eqs 29-47)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.control.controller import Controller, ControlRefused
from snakegen.control.frame import CogFrame
from snakegen.control.gains import Floats
from snakegen.control.vectored_allocation import least_answer, wrench_of
from snakegen.kernels.allocation.mode_blending import allocate_virtual
from snakegen.kernels.allocation.types import Iteration, Limits, Task
from snakegen.kernels.dynamics.joint_loads import no_loads
from snakegen.robot.gimbal_geometry import joint_order


@dataclass(frozen=True, eq=False)
class Allocation:
    """Thrusts and gimbals for a wrench.

    Attributes:
        thrust: N; (Ñ,) an apparatus in virtual-single-rotor mode, (n_rotors,) in dual-rotor mode.
        gimbals: (Ñ, 2) rad, roll and pitch.
        given: (6,) wrench they make.
        sigma_min: scaled, of J_w or of Q_trunc.
        iterations: Newton steps taken (0 in dual-rotor mode).
        residual: ‖wanted - given‖ when they ended, before limits [N and N·m].
    """

    thrust: Floats
    gimbals: Floats
    given: Floats
    sigma_min: float
    iterations: int
    residual: float


def allocate(
    controller: Controller, frame: CogFrame, wrench: Any, last: Any = None, *, force: bool = False
) -> Allocation:
    """Returns thrusts and gimbals that give `wrench`: `sweeps` of eq 36, then Newton, eqs 40-47.

    Args:
        controller: gains, limits and options.
        frame: the posture.
        wrench: (6,) wanted, axes of the frame.
        last: (Ñ, 2) rad, gimbals of the tick before; 0 at a cold start.
        force: True answers below the σ_min threshold too.

    Raises:
        ControlRefused: the scaled σ_min(J_w) is below the law's threshold.
    """
    law, n = controller.law, controller.apparatuses
    m = frame.mounts
    turns = np.zeros((n, 2)) if last is None else np.array(last, float)
    low, high = joint_order(m, law.gimbal_lower), joint_order(m, law.gimbal_upper)
    limit, wanted, start = controller.gimbals.limit, np.array(wrench, float), joint_order(m, turns)
    steps_of = (law.sweeps, law.newton, law.residual)
    thrust, angles, sigma, steps, size = least_answer(
        m, limit, wanted, frame.scale, start, (low, high), *steps_of
    )
    past = np.any(thrust > limit) or np.any(angles < low) or np.any(angles > high)
    if law.constrained and (past or size > law.residual):
        rest = (no_loads(3 * n), np.zeros((2, n, 3)), np.ones(2))
        task, limits = Task(wanted, frame.scale), Limits(limit, low, high)
        thrust, angles, sigma, steps, size, _, _ = allocate_virtual(
            m, task, limits, start, Iteration(*steps_of), law.constrained, *rest
        )
    if sigma < law.sigma_min and not force:
        raise ControlRefused(
            f"this posture is too close to singular: scaled σ_min(J_w) = {sigma:.2g} is below "
            f"{law.sigma_min:g}; bend the body more, or fly it in dual-rotor mode."
        )
    given = wrench_of(m, thrust, angles)
    return Allocation(thrust, joint_order(m, angles), given, float(sigma), int(steps), float(size))
