"""Error budget of bodies that tilt to move sideways: what their attitude loop leaves behind."""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.sample_store import slices
from snakegen.control.controller import Controller
from snakegen.kernels.control.types import Law
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.simulation.flight.plan import Plan, gradient
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.trim import integral_rates


def tilt_lags(controller: Controller, plan: Plan) -> tuple[Floats, Floats]:
    """Returns RMS errors of a motion along x and y that the body must tilt for: (2,) m, (2,) rad.

    The tilt ``a / g`` is an error to a reference that stays level. It follows its target by ``τ =
    K_τ,d / K_τ,p``, which is not fed forward: a jerk j leaves ``τ j``, so ``τ j / K_f,p``.
    """
    time, bend = plan.time[plan.trim :], plan.acceleration[plan.trim :]
    if len(time) < 3:
        return np.zeros(2), np.zeros(2)
    force, torque = controller.law.force, controller.law.torque
    late = (torque[2] / torque[0])[[1, 0]] / force[0, :2]  # x by pitch, y by roll
    squares = np.zeros((2, 2))
    for part in slices(len(time)):
        jerk = gradient(bend, time, part)[:, :2]
        squares[0] += np.sum((late * jerk) ** 2, axis=0)
        squares[1] += np.sum((bend[part, :2] / GRAVITY) ** 2, axis=0)
    place, lean = np.sqrt(squares / len(time))
    return place, lean


def air_lags(robot: Robot, controller: Controller, plan: Plan, what: Imperfections) -> Floats:
    """Returns the RMS errors (3,) [m] of a motion that the air on the rotors holds back.

    A flow V along a rotor's axis takes ``T V / 2 v_h`` of its thrust, across it the momentum drag
    ``ṁ V`` is as large: together ``g v / 2 v_h``, ``v_h = √(T / 2 ρ A)`` at hover. What remains is
    that over K_p, high-passed by the integral (``K_p / K_i``).
    """
    from scipy.signal import lfilter

    diameters = [r.diameter for a in robot.modules.apparatuses for r in a.rotors]
    area = 0.25 * np.pi * float(np.sum(np.square(diameters)))
    if what.air_density <= 0.0 or area <= 0.0 or len(plan.time) < 3:
        return np.zeros(3)
    hover = np.sqrt(robot.force_scale / (2.0 * what.air_density * area))
    force, step = controller.law.force, float(plan.time[1] - plan.time[0])
    kept = np.exp(-step * force[1] / force[0])
    squares, past = np.zeros(3), np.zeros((3, 1))
    for part in slices(len(plan.time)):
        wanted = GRAVITY * plan.velocity[part] / (2.0 * hover) / force[0]
        for k in range(3):
            error, past[k] = lfilter([kept[k], -kept[k]], [1.0, -kept[k]], wanted[:, k], zi=past[k])
            squares[k] += float(np.sum(error**2))
    return np.asarray(np.sqrt(squares / max(len(plan.time) - plan.trim, 1)))


def displacement_left(law: Law, trimmed: float, duration: float) -> Floats:
    """Returns what is left, (3,), of a displacement that a trim began with: RMS over the mission.

    ``e^(−σ t) √((1 − e^(−2 σ T)) / 2 σ T)`` with σ of the slowest root of ``s³ + K_d s² + K_p s +
    K_i`` per axis, K_i as while trimming for t s before and as it is for T s of mission.

    Args:
        law: gains.
        trimmed: s, of trim.
        duration: s, of the mission.
    """
    fast = law.force[1] * integral_rates(law)[0]
    out = np.empty(3)
    for k, (p, _, d) in enumerate(law.force.T):
        slow = -float(np.roots([1.0, d, p, fast[k]]).real.max())
        after = max(-float(np.roots([1.0, d, p, law.force[1, k]]).real.max()), 1e-6)
        rest = -np.expm1(-2.0 * after * duration) / (2.0 * after * duration)
        out[k] = np.exp(-max(slow, 0.0) * trimmed) * np.sqrt(rest)
    return out
