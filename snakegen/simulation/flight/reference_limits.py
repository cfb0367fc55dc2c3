"""Refuses plans whose motion of the whole body takes more thrust or joint torque than there is.

Joint rates are checked beside (`before.check_references`). Here each sampled instant of a plan is
held against rigid-body dynamics: the wrench ``[m (a + g ẑ); I α + ω × I ω]`` against the thrust
limits, and what turning at ω alone does to the joints (centrifugal torque) against their efforts.
"""

import numpy as np
import pinocchio as pin

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.base.geometry import Floats
from snakegen.base.sample_store import in_pieces
from snakegen.control.controller import Controller
from snakegen.errors import MissionError
from snakegen.kernels.control.types import DUAL
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.simulation.flight.plan import Plan, gradient, is_constant
from snakegen.simulation.flight.postures import driven_joints, place

SAMPLES = 20  # instants looked at, besides the fastest and the most accelerated
_STILL = 1e-6  # m/s², rad/s², rad/s: below, a plan does not move the body as a whole


def check_motion(robot: Robot, controller: Controller, plan: Plan) -> None:
    """Refuses a plan that accelerates or turns the body beyond what thrust and joints can do.

    The pseudo-inverse allocator is held to its own answer within the limits, the constrained one
    to the sum of all thrusts.

    Raises:
        MissionError: the first such instant, with what it takes and what there is.
    """
    if all(is_constant(rows) and not np.any(rows[0]) for rows in (plan.acceleration, plan.angular)):
        return
    turned = _angular_acceleration(plan)
    motions = (plan.acceleration, plan.angular, turned)
    sizes = in_pieces(
        len(plan.time), lambda part: tuple(np.linalg.norm(x[part], axis=1) for x in motions)
    )
    if max(size.max() for size in sizes) < _STILL:
        return
    even = np.linspace(0, len(plan.time) - 1, SAMPLES).astype(int)
    for k in np.unique(np.concatenate([even, [int(np.argmax(size)) for size in sizes]])):
        q = place(robot, plan.joints[k], np.zeros(3))
        a = allocation(robot, q)
        when = f"at {plan.time[k]:.2f} s"
        _check_joints(robot, q, a, plan.rotation[k], plan.angular[k], when)
        push = a.mass * (plan.acceleration[k] + np.array([0.0, 0.0, GRAVITY]))
        spin = plan.angular[k]
        torque = a.inertia @ turned[k] + np.cross(spin, a.inertia @ spin)
        motion = (
            f"accelerates the body at {np.linalg.norm(plan.acceleration[k]):.3g} m/s² and turns it "
            f"at {np.linalg.norm(spin):.3g} rad/s and {np.linalg.norm(turned[k]):.3g} rad/s² {when}"
        )
        most = float(robot.rotors.thrust_max.sum())
        if np.linalg.norm(push) > most:
            raise MissionError(
                f"the mission {motion}: that takes {np.linalg.norm(push):.1f} N of thrust, all "
                f"rotors together have {most:.1f} N: leave the motion more time."
            )
        if controller.law.constrained:
            continue
        along = np.array([0.0, 0.0, np.linalg.norm(push)])
        force = along if controller.mode == DUAL else plan.rotation[k].T @ push
        use = _use(robot, a, controller.mode, np.concatenate([force, torque]))
        hover = _use(robot, a, controller.mode, a.hover_wrench)
        if use > max(1.0, hover) * (1.0 + 1e-9):
            raise MissionError(
                f"the mission {motion}: that takes {100 * use:.0f} % of a rotor's largest thrust: "
                "leave the motion more time."
            )


def _angular_acceleration(plan: Plan) -> Floats:
    """Returns (T, 3) rad/s², the CoG frame's axes."""
    count = len(plan.time)
    if count < 3:
        return np.zeros_like(plan.angular)

    def rows(part: slice) -> tuple[Floats]:
        out = gradient(plan.angular, plan.time, part)
        at = np.arange(part.start, part.stop)
        out[(at == 0) | (at == count - 1)] = 0.0  # a plan may begin and end in motion
        return (out,)

    return in_pieces(count, rows)[0]


def _use(robot: Robot, a: Allocation, mode: int, wrench: Floats) -> float:
    """Returns the largest share of its limit that an actuator of the least-norm answer takes."""
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    if mode == DUAL or not robot.gimbal_names:
        limit = np.array(robot.rotors.thrust_max)
        scaled = rows[:, None] * a.dual * limit
        return float(np.abs(np.linalg.pinv(scaled, rcond=1e-9) @ (rows * wrench)).max())
    forces = np.linalg.pinv(rows[:, None] * a.force, rcond=1e-9) @ (rows * wrench)
    return float((np.linalg.norm(forces.reshape(-1, 3), axis=1) / robot.gimbals.limit).max())


def _check_joints(
    robot: Robot, q: Floats, a: Allocation, rotation: Floats, angular: Floats, when: str
) -> None:
    """Refuses a turn whose centrifugal torque is beyond a joint's effort.

    Raises:
        MissionError: that joint.
    """
    speed = float(np.linalg.norm(angular))
    names = driven_joints(robot)
    if speed < _STILL or not names:
        return
    base, origin = robot.base_pose(q)
    v = np.zeros(robot.model.nv)
    # CoG at the world's origin, so the base's own is at `origin`; body axes of the root are `base`
    spin = base @ angular
    v[:3], v[3:6] = base.T @ np.cross(spin, origin), base.T @ spin
    data, still = robot.model.createData(), np.zeros(robot.model.nv)
    at = [robot.model.joints[robot.model.getJointId(n)].idx_v for n in names]
    torque = pin.rnea(robot.model, data, q, v, still) - pin.rnea(robot.model, data, q, still, still)
    effort = robot.limits(names)[2]
    use = np.abs(torque[at]) / np.where(effort > 0.0, effort, np.inf)
    i = int(np.argmax(use))
    if use[i] > 1.0:
        raise MissionError(
            f"the mission turns the body at {speed:.3g} rad/s {when}: holding its shape then takes "
            f"{abs(torque[at][i]):.3g} N·m at {names[i]}, whose servo has {effort[i]:g}: leave the "
            "turn more time (angles are in radians)."
        )
