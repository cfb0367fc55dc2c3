"""Error budget of rotor streams: what a changing shape loses to the air that its rotors blow.

A shape that folds over itself puts links, drums and rotors into the streams of other rotors for a
while. That is no imperfection of the hardware, and integrals are slow to make up for it. The jets
are those of `kernels.air`, evaluated here in NumPy at a few postures of a plan.
"""

import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import Floats
from snakegen.control.controller import Controller
from snakegen.kernels.flight.aerodynamics import JET_SPREAD
from snakegen.robot.robot import Robot
from snakegen.robot.rotor_streams import mean_inflow, thrust_kept
from snakegen.simulation.flight.mujoco_arrays import stations
from snakegen.simulation.flight.plan import Plan, farthest
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import place
from snakegen.simulation.flight.world import World, make_world

POSTURES = 30  # looked at along a plan
PASSING = 2.5  # a body that moves through streams over one at rest in them (hybrid4: 2.3 measured)
_FAR = 3.0  # widths from a stream's axis at which it ends


def stream_errors(robot: Robot, controller: Controller, plan: Plan, what: Imperfections) -> Floats:
    """Returns the RMS errors (6,) [m, rad] that streams leave along a plan.

    ``Δa / K_p`` at rest, times `PASSING`; less what the first posture has already, where the plan
    is trimmed there. A shape that stays has 0: what its streams take is taken from the start.
    """
    rows = plan.joints[plan.trim :]
    if what.air_density == 0.0 or not what.downwash or farthest(rows) <= 1e-6:
        return np.zeros(6)
    world = make_world(robot, floor=False)
    picked = rows[np.unique(np.linspace(0, len(rows) - 1, POSTURES).astype(int))]
    lost = np.array([_accelerations(world, joints, what) for joints in picked])
    if plan.trim:
        lost = lost - lost[0]
    gains = np.concatenate([controller.law.force[0], controller.law.torque[0]])
    return np.asarray(PASSING * np.sqrt(np.mean((lost / gains) ** 2, axis=0)))


def _accelerations(world: World, joints: Floats, what: Imperfections) -> Floats:
    """Returns what a level hover loses to streams, (6,) m/s² and rad/s², root axes."""
    robot = world.robot
    q = place(robot, joints, np.array([0.0, 0.0, 2.0]))
    a = allocation(robot, q)
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    thrust = np.linalg.pinv(rows[:, None] * a.dual, rcond=1e-9) @ (rows * a.hover_wrench)
    wrench = stream_wrench(world, q, np.maximum(thrust, 0.0), what)
    return np.concatenate([wrench[:3] / a.mass, np.linalg.solve(a.inertia, wrench[3:])])


def stream_wrench(world: World, q: Floats, thrust: Floats, what: Imperfections) -> Floats:
    """Returns the wrench (6,) about the CoG that streams put on rotors and links, world axes.

    Args:
        world: of the robot.
        q: configuration.
        thrust: (n_rotors,) N.
        what: air density and drag coefficient.
    """
    model, robot = world.model, world.robot
    data, cog = world.posed(q)
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    sites = [model.site(r.label).id for r in rotors]
    origin, axes = data.site_xpos[sites], data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2]
    radius = 0.5 * np.array([r.diameter for r in rotors])
    density = what.air_density

    def flow(points: Floats) -> Floats:
        away = points[None] - origin[:, None]
        down = -np.einsum("rpi,ri->rp", away, axes)
        width = radius[:, None] + JET_SPREAD * np.maximum(down, 0.0)
        aside = (np.sum(away**2, axis=2) - down**2) / width**2
        speed = (
            np.sqrt(2.0 * thrust / (density * np.pi))[:, None]
            / width
            * np.exp(-np.minimum(aside, _FAR**2))
        )
        speed = np.where((down > 0.0) & (aside < _FAR**2), speed, 0.0)
        return np.asarray(-np.einsum("rp,ri->pi", speed, axes))

    away = origin[None] - origin[:, None]
    down = -np.einsum("rpi,ri->rp", away, axes)
    offset = np.sqrt(np.maximum(np.sum(away**2, axis=2) - down**2, 0.0))
    area = np.pi * radius**2
    induced = np.sqrt(thrust / (2.0 * density * area))
    mean = induced[:, None] * mean_inflow(down, offset, radius[:, None], radius[None], JET_SPREAD)
    mean[robot.rotors.body[:, None] == robot.rotors.body] = 0.0  # in the limits already
    blown = -np.einsum("rp,ri->pi", mean, axes)
    through = -np.sum(blown * axes, axis=1)
    inflow = through / np.maximum(induced, 1e-9)
    kept = np.where(inflow >= 0.0, thrust_kept(np.maximum(inflow, 0.0)), 1.0)
    lost = np.where(inflow >= 0.0, 1.0 - kept, np.maximum(0.5 * inflow, -0.25))
    across = np.sqrt(0.5 * density * area * thrust)[:, None] * (blown + through[:, None] * axes)
    force = [-(lost * thrust)[:, None] * axes + across]
    at = [origin]
    bodies, points, rods, areas = stations(world)
    if len(bodies):
        turn = data.xmat[bodies].reshape(-1, 3, 3)
        place_of = data.xpos[bodies] + np.einsum("sij,sj->si", turn, points)
        rod = np.einsum("sij,sj->si", turn, rods)
        met = flow(place_of)
        met = met - np.sum(met * rod, axis=1)[:, None] * rod
        size = np.linalg.norm(met, axis=1)
        force.append((0.5 * density * what.drag_coefficient * areas * size)[:, None] * met)
        at.append(place_of)
    pushes = np.concatenate(force)
    arms = np.concatenate(at) - cog
    return np.concatenate([pushes.sum(axis=0), np.cross(arms, pushes).sum(axis=0)])
