"""Error budget: what imperfect rotors, encoders and an IMU's tilt do to a hovering body.

Each source (a rotor's thrust, a joint's offset, the IMU's tilt about an axis) is one column: the
acceleration that it leaves to the integrals, per standard deviation. From the columns follow

- the clamps of the integrals: three standard deviations of the plant's declared imperfections, so
  that a trim ends short of its clamps;
- the tracking error expected of a flight, ``σ / K_p`` and what no sensor shows, for any body and
  any gains: the scale of the bounds in `flight_bounds`.
"""

from dataclasses import dataclass

import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import Floats, skew
from snakegen.base.sample_store import slices
from snakegen.control.controller import Controller
from snakegen.control.frame import cog_frame
from snakegen.control.gain_sets import turned_axes
from snakegen.kernels.control.types import DUAL
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.simulation.flight.bounds.tilt_budget import air_lags, displacement_left, tilt_lags
from snakegen.simulation.flight.plan import Plan, farthest, gradient
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import place
from snakegen.simulation.flight.trim import SETTLING, integral_rates

SIGMAS = 3.0  # standard deviations that clamps allow for
POSTURES = 7  # looked at along a plan
INSTANTS = 20  # likewise, where integrals settle along it
_STEP = 1e-5  # rad, of the differences by joint angles


@dataclass(frozen=True, eq=False)
class Sources:
    """Columns of one posture, s sources, each times its standard deviation.

    Attributes:
        acceleration: (6, s) m/s² (world axes) and rad/s² (CoG axes), left to the integrals.
        unseen: (6, s) m (world axes) and rad (CoG axes): errors that no sensor shows.
    """

    acceleration: Floats
    unseen: Floats


def sources(
    robot: Robot,
    controller: Controller,
    joints: Floats,
    what: Imperfections,
    rotation: Floats | None = None,
) -> Sources:
    """Returns the sources of error of a hover with the given joints (k,) [rad].

    `rotation` (3, 3) is the root's attitude, level if absent: what turns takes an IMU's tilt along.
    """
    q = place(robot, joints, np.array([0.0, 0.0, 2.0]), rotation)
    base, origin = robot.base_pose(q)
    angles = robot.angles(q)
    a = allocation(robot, q)
    frame = cog_frame(controller, angles, base, origin)
    into = frame.axes.T @ base  # from the root's axes into the CoG frame's
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    thrust = np.linalg.pinv(rows[:, None] * a.dual, rcond=1e-9) @ (rows * a.hover_wrench)
    turn = np.linalg.inv(a.inertia)

    def accelerations(wrench: Floats) -> Floats:
        return np.vstack([base @ wrench[:3] / a.mass, into @ turn @ wrench[3:]])

    mismatch = what.thrust_mismatch * what.thrust_scale * (a.dual * thrust)
    offsets, places = np.zeros((6, len(angles))), np.zeros((3, len(angles)))
    if what.joint_noise > 0.0:
        for i, name in enumerate(robot.joint_names):
            moved = _moved(robot, q, name)
            offsets[:, i] = (allocation(robot, moved).dual - a.dual) @ thrust / _STEP
            places[:, i] = (_cog(robot, moved) - _cog(robot, q)) / _STEP
    tilt = what.attitude_bias * np.vstack([GRAVITY * skew(np.array([0, 0, 1.0])), np.zeros((3, 3))])
    tilt[:3] = tilt[:3] @ frame.axes
    lever = what.attitude_bias * skew(frame.cog - origin) @ frame.axes
    n = mismatch.shape[1]
    unequal = accelerations(mismatch)
    leaning = np.zeros((6, n))
    if controller.mode == DUAL:  # the body leans against the sideways force of unequal rotors
        leaning[3:] = frame.axes.T @ skew(np.array([0, 0, 1.0])) @ unequal[:3] / GRAVITY
    return Sources(
        np.hstack([unequal, what.joint_noise * accelerations(offsets), tilt]),
        np.hstack(
            [
                leaning,
                np.vstack([what.joint_noise * places, np.zeros_like(places)]),
                np.vstack([lever, what.attitude_bias * np.eye(3)]),
            ]
        ),
    )


def postures(plan: Plan) -> list[tuple[Floats, Floats]]:
    """Returns joints (k,) and attitude (3, 3) of a few instants of a plan, its first one first."""
    rows, turns = plan.joints[plan.trim :], plan.rotation[plan.trim :]
    moves = sum(farthest(values) for values in (rows, turns))
    at = np.linspace(0, len(rows) - 1, POSTURES).astype(int) if moves > 1e-6 else [0]
    return [(rows[k], turns[k]) for k in at]


def integral_limits(
    robot: Robot, controller: Controller, plan: Plan, what: Imperfections
) -> tuple[Floats, Floats]:
    """Returns clamps (3,) [m s] and (3,) [rad s] that hold what the imperfections ask for.

    Three standard deviations at the worst posture of the plan, over K_i; never less than the gain
    set's own clamps.
    """
    law = controller.law
    spread = np.max(
        [
            np.linalg.norm(sources(robot, controller, joints, what, turn).acceleration, axis=1)
            for joints, turn in postures(plan)
        ],
        axis=0,
    )
    out = []
    for gain, least, wanted in (
        (law.force[1], law.force_integral_limit, spread[:3]),
        (law.torque[1], law.torque_integral_limit, spread[3:]),
    ):
        needed = np.where(gain > 0.0, SIGMAS * wanted / np.where(gain > 0.0, gain, 1.0), 0.0)
        out.append(np.maximum(least, needed))
    return out[0], out[1]


def expected_errors(
    robot: Robot, controller: Controller, plan: Plan, what: Imperfections
) -> Floats:
    """Returns the RMS errors (6,) [m, rad] expected of a plan: one standard deviation over draws.

    ``√(Σ (f Δa/K_p)² + unseen²)`` over sources, RMS over postures. Δa is what has changed since
    the trim, and what a short one leaves (all of it without one); f = √(K_p / 2 K_i T), at most 1,
    what an integral leaves of a constant acceleration over T s. In dual-rotor mode thrusts lean
    with the body: its attitude error e_R accelerates it sideways by g e_R, and what that moved
    before a trim ends comes back as slowly as the position loop does (`displacement_left`). Motion
    adds its lag (`lags`); noise that dithers within a run is not in it.
    """
    if plan.settling > 0.0:
        squares = [np.sum(e**2, axis=1) for e in moving_errors(robot, controller, plan, what)]
        return np.asarray(np.sqrt(np.mean(squares, axis=0) + _lags(robot, controller, plan, what)))
    law = controller.law
    found = [sources(robot, controller, joints, what, turn) for joints, turn in postures(plan)]
    gains = np.concatenate([law.force[0], law.torque[0]])
    integral = np.concatenate([law.force[1], law.torque[1]])
    duration = float(plan.time[-1] - plan.time[plan.trim]) or 1.0
    with np.errstate(divide="ignore"):
        left = np.minimum(1.0, np.sqrt(gains / (2.0 * integral * duration)))
    trimmed = float(plan.time[plan.trim] - plan.time[0]) if plan.trim else 0.0
    known = (1.0 - np.exp(-trimmed / SETTLING)) * found[0].acceleration
    lean = (
        GRAVITY * skew(np.array([0.0, 0.0, 1.0])) if controller.mode == DUAL else np.zeros((3, 3))
    )
    late = displacement_left(law, trimmed, duration) if trimmed else np.zeros(3)
    first = lean @ (found[0].acceleration[3:] / gains[3:, None]) / gains[:3, None]
    squares = []
    for s in found:
        error = (1.0 / gains)[:, None] * (s.acceleration - known)
        error *= left[:, None]
        error[:3] += lean @ error[3:] / gains[:3, None]
        squares.append(np.sum(error**2 + s.unseen**2, axis=1))
        squares[-1][:3] += np.sum((late[:, None] * first) ** 2, axis=1)
    return np.asarray(np.sqrt(np.mean(squares, axis=0) + _lags(robot, controller, plan, what)))


def _lags(robot: Robot, controller: Controller, plan: Plan, what: Imperfections) -> Floats:
    """Returns the squares (6,) of `lags` and, where the body tilts to move, `tilt_lags`."""
    rate = float(robot.modules.control.get("position_rate", 40.0))
    behind = lags(controller, plan, what, rate)
    tilts = ~np.array(turned_axes(robot))
    late, leaning = tilt_lags(controller, plan)
    behind[:2] += late * tilts
    behind[[4, 3]] += leaning * tilts
    if not robot.gimbal_names:  # factors of the others were fitted to flights with it
        behind[:3] += air_lags(robot, controller, plan, what)
    return np.asarray(behind**2)


def moving_errors(
    robot: Robot, controller: Controller, plan: Plan, what: Imperfections
) -> list[Floats]:
    """Returns the tracking errors (6, 2 s) along a plan whose integrals settle in time.

    ``K_p e + K_i ∫e = a``: the error is a's high-pass over K_p, ``e' + e/τ = a'/K_p`` with
    ``τ = K_p/K_i``; between the instants that are looked at, a changes evenly. What the trim leaves
    is 0.
    """
    law = controller.law
    rows = np.linspace(plan.trim, len(plan.time) - 1, INSTANTS).astype(int)
    found = [sources(robot, controller, plan.joints[k], what, plan.rotation[k]) for k in rows]
    gains = np.concatenate([law.force[0], law.torque[0]])
    integral = np.concatenate([law.force[1], law.torque[1]])
    integral = integral * integral_rates(law, plan.settling).ravel()
    error, out = np.zeros_like(found[0].acceleration), []
    for k, s in enumerate(found):
        if k:
            step = float(plan.time[rows[k]] - plan.time[rows[k - 1]])
            decay = step * integral / gains
            kept = np.exp(-decay)
            gained = np.where(decay > 1e-9, (1.0 - kept) / np.maximum(decay, 1e-9), 1.0)
            change = (s.acceleration - found[k - 1].acceleration) / gains[:, None]
            error = kept[:, None] * error + gained[:, None] * change
        out.append(np.hstack([error, s.unseen]))
    return out


def position_peak(robot: Robot, controller: Controller, plan: Plan, what: Imperfections) -> float:
    """Returns the largest expected position error along a plan over its RMS, 1 or more.

    Errors of a plan whose integrals settle come and go with its motion; others stay: 1.
    """
    if plan.settling <= 0.0:
        return 1.0
    norms = [np.sum(e[:3] ** 2) for e in moving_errors(robot, controller, plan, what)]
    return max(1.0, float(np.sqrt(np.max(norms) / np.mean(norms))))


def lags(controller: Controller, plan: Plan, what: Imperfections, rate: float) -> Floats:
    """Returns the RMS errors (6,) [m, rad] that the motion of a plan leaves behind it.

    Position and velocity are known late, by the delay and half a sample of motion capture, T:
    ``T √(v² + (a K_d/K_p)²)``; angular acceleration is not fed forward: ``α / K_p``.

    Args:
        controller: its gains.
        plan: the references; those before the mission's start do not count.
        what: the delay.
        rate: Hz, of motion capture.
    """
    law, late = controller.law, what.delay + 0.5 / rate
    time, spin, speed, bend = (
        rows[plan.trim :] for rows in (plan.time, plan.angular, plan.velocity, plan.acceleration)
    )
    if len(time) < 3:
        return np.zeros(6)
    force, torque = law.force, law.torque
    squares = np.zeros(6)
    for part in slices(len(time)):
        turned = gradient(spin, time, part)
        moved = late * np.hypot(speed[part], bend[part] * force[2] / force[0])
        squares += np.sum(np.hstack([moved, turned / torque[0]]) ** 2, axis=0)
    return np.asarray(np.sqrt(squares / len(time)))


def _moved(robot: Robot, q: Floats, name: str) -> Floats:
    """Returns q with one joint turned by a small step."""
    joint = robot.model.joints[robot.model.getJointId(name)]
    out = np.array(q)
    if joint.nq == 2:
        c, s = out[joint.idx_q], out[joint.idx_q + 1]
        angle = np.arctan2(s, c) + _STEP
        out[joint.idx_q], out[joint.idx_q + 1] = np.cos(angle), np.sin(angle)
    else:
        out[joint.idx_q] += _STEP
    return out


def _cog(robot: Robot, q: Floats) -> Floats:
    base, origin = robot.base_pose(q)
    return np.asarray(
        centre_of_gravity(robot.tree, *forward(robot.tree, base, origin, robot.angles(q)))[1]
    )
