"""Linear response of a hover to a known disturbance: how far its loops let it be displaced.

A disturbance a (acceleration of the CoG, or of the attitude) displaces a loop by
``E/A = X/N``: N is the characteristic polynomial of the closed loop, and X what is left of its
``s²`` term (`control.poles.compliances`). Gains, lag, delay and low-pass are those of the
controller; saturation and the air's damping are not in it.
"""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller
from snakegen.control.gains import Gains
from snakegen.control.gimbal_reach import vectoring_share
from snakegen.control.poles import NDComplex, compliances
from snakegen.kernels.control.types import DUAL
from snakegen.robot.configuration import Configuration
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.simulation.flight.mujoco_arrays import stations
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.world import World, make_world

GAINED, LOST = -0.25, 1.0  # least and most of a thrust that flow through its disc takes
STANDS = 1e-9  # m/s, below which a plan moves through no air


def response(
    robot: Robot, controller: Controller, gains: Gains, plan: Plan, what: Imperfections
) -> Floats:
    """Returns the displacement (T, 6) [m, rad] that a plan's push and wind leave, world axes.

    In dual-rotor mode a body that is turned is carried sideways by its thrust, and leans to come
    back: both are in it.
    """
    push = accelerations(robot, plan, what)
    lag = max((r.lag for a in robot.modules.apparatuses for r in a.rotors), default=0.0)
    loops = compliances(controller, gains, controller.mode, lag=lag, delay=what.delay)
    dt = float(plan.time[1] - plan.time[0])
    out = np.zeros_like(push)
    for i in (3, 4, 5):
        out[:, i] = _driven(loops[i], push[:, i], dt)
    if controller.mode == DUAL:
        push[:, 0] += GRAVITY * out[:, 4]
        push[:, 1] -= GRAVITY * out[:, 3]
    for i in (0, 1, 2):
        out[:, i] = _driven(loops[i], push[:, i], dt)
    if controller.mode == DUAL:
        asked = np.gradient(np.gradient(out[:, :2], dt, axis=0), dt, axis=0) - push[:, :2]
        roll, pitch = leaning_share(controller, gains)
        out[:, 3] -= roll * asked[:, 1] / GRAVITY
        out[:, 4] += pitch * asked[:, 0] / GRAVITY
    return out


def leaning_share(controller: Controller, gains: Gains) -> tuple[float, float]:
    """Returns the shares of a horizontal force that roll and pitch give; gimbals give the rest."""
    left, ahead = vectoring_share(controller)
    both = ((gains.attitude_roll, float(left)), (gains.attitude_pitch, float(ahead)))
    roll, pitch = (k / (k + v) if k + v > 0.0 else 0.0 for k, v in both)
    return float(roll), float(pitch)


def drag_errors(
    robot: Robot, controller: Controller, gains: Gains, plan: Plan, what: Imperfections
) -> Floats:
    """Returns the RMS errors (6,) [m, rad] that air leaves behind a body that moves through it.

    The response to a wind of minus its velocity, at the first posture: no law feeds drag forward.
    """
    speed = plan.velocity[plan.trim :]
    if what.air_density == 0.0 or np.abs(speed).max(initial=0.0) < STANDS:
        return np.zeros(6)
    errors = np.zeros((len(plan.time), 6))
    for k in range(3):
        if np.abs(speed[:, k]).max() >= STANDS:
            wind = np.zeros_like(plan.velocity)
            wind[:, k] = -plan.velocity[:, k]
            alone = replace(plan, wind=wind, disturbance=None)
            errors += response(robot, controller, gains, alone, what)
    return np.asarray(np.sqrt(np.mean(errors[plan.trim :] ** 2, axis=0)))


def accelerations(robot: Robot, plan: Plan, what: Imperfections) -> Floats:
    """Returns what push and wind accelerate, (T, 6) m/s² and rad/s², world axes, level hover."""
    q, count = plan.start, len(plan.time)
    a, (base, origin) = allocation(robot, q), robot.base_pose(q)
    cog = origin + base @ a.cog
    wrench = np.zeros((count, 6))
    if plan.disturbance is not None:
        wrench += plan.disturbance
        if not plan.disturbance_at_cog:
            at = Configuration(robot, q).link_pose(plan.disturbance_link or robot.root_link)[1]
            wrench[:, 3:] += np.cross(at - cog, plan.disturbance[:, :3])
    if plan.wind is not None and what.air_density > 0.0:
        wrench += _blown(make_world(robot, floor=False), q, plan.wind, what)
    turn = np.linalg.inv(base @ a.inertia @ base.T)
    return np.hstack([wrench[:, :3] / a.mass, wrench[:, 3:] @ turn.T])


def _blown(world: World, q: Floats, wind: Floats, what: Imperfections) -> Floats:
    """Returns the wrench (T, 6) of wind (T, 3) along one line, from a table of its speeds."""
    peak = wind[int(np.argmax(np.linalg.norm(wind, axis=1)))]
    top = float(np.linalg.norm(peak))
    if top == 0.0:
        return np.zeros((len(wind), 6))
    along = wind @ peak / top
    table = np.linspace(-top, top, 9)
    found = np.array([wind_wrench(world, q, v / top * peak, what) for v in table])
    return np.array([np.interp(along, table, column) for column in found.T]).T


def _driven(loop: tuple[NDComplex, NDComplex] | None, push: Floats, dt: float) -> Floats:
    """Returns the displacement of one axis under accelerations (T,), held over each tick."""
    if loop is None:
        return np.zeros_like(push)
    poles, parts = loop
    out = np.zeros(len(push), complex)
    for p, r in zip(poles, parts, strict=True):
        grown = np.exp(p * dt)
        out += lfilter([0.0, r * (grown - 1.0) / p], [1.0, -grown], push)
    return np.asarray(out.real)


def wind_wrench(world: World, q: Floats, wind: Floats, what: Imperfections) -> Floats:
    """Returns the wrench (6,) about the CoG, world axes, of wind (3,) [m/s] on a level hover.

    Links: ``½ ρ C_d A │v⊥│ v⊥`` at their stations. Rotors: ``−T V / 2v_i`` along, and across
    ``√(ρAT/2) V⊥`` (docs/flights.md), at the thrusts of hover.
    """
    model, robot, rho = world.model, world.robot, what.air_density
    data, cog = world.posed(q)
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    sites = [model.site(r.label).id for r in rotors]
    axes = data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2]
    area = np.pi * (0.5 * np.array([r.diameter for r in rotors])) ** 2
    a = allocation(robot, q)
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    thrust = np.linalg.pinv(rows[:, None] * a.dual, rcond=1e-9) @ (rows * a.hover_wrench)
    thrust = np.maximum(thrust, 0.0)
    through = -axes @ wind
    wake = np.sqrt(2.0 * thrust / (rho * area)) + 1e-9
    lost = np.clip(through / wake, GAINED, LOST)
    across = wind + through[:, None] * axes
    force = [
        -(lost * thrust)[:, None] * axes + np.sqrt(0.5 * rho * area * thrust)[:, None] * across
    ]
    at = [data.site_xpos[sites]]
    bodies, points, rods, areas = stations(world)
    if len(bodies):
        turn = data.xmat[bodies].reshape(-1, 3, 3)
        rod = np.einsum("sij,sj->si", turn, rods)
        met = wind - (rod @ wind)[:, None] * rod
        size = np.linalg.norm(met, axis=1)
        force.append((0.5 * rho * what.drag_coefficient * areas * size)[:, None] * met)
        at.append(data.xpos[bodies] + np.einsum("sij,sj->si", turn, points))
    pushes, arms = np.concatenate(force), np.concatenate(at) - cog
    return np.concatenate([pushes.sum(axis=0), np.cross(arms, pushes).sum(axis=0)])
