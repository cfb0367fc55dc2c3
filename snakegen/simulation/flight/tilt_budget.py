"""Error budget of bodies that tilt to move sideways: what their attitude loop leaves behind."""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.sample_store import slices
from snakegen.control.controller import Controller
from snakegen.kernels.control.types import Law
from snakegen.robot.robot import GRAVITY
from snakegen.simulation.flight.plan import Plan, gradient
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
