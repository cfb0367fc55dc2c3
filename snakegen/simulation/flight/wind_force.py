"""Steady wind on a hovering body: drag of its links, and what air does to its rotors."""

import mujoco
import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import Floats
from snakegen.simulation.flight.mujoco_arrays import stations
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.world import World

GAINED, LOST = -0.25, 1.0  # least and most of a thrust that flow through its disc takes


def wind_wrench(world: World, q: Floats, wind: Floats, what: Imperfections) -> Floats:
    """Returns the wrench (6,) about the CoG, world axes, of wind (3,) [m/s] on a level hover.

    Links: ``½ ρ C_d A │v⊥│ v⊥`` at their stations. Rotors: ``−T V / 2v_i`` along, and across
    ``√(ρAT/2) V⊥`` (docs/flights.md), at the thrusts of hover.
    """
    model, robot, rho = world.model, world.robot, what.air_density
    data = mujoco.MjData(model)
    world.set_state(data, q)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    cog = data.subtree_com[model.body(robot.root_link).id]
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
