"""Ties a world, a plan and a plant to the arrays of the compiled flight loop."""

import ctypes
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.power import battery_joules, power_factors
from snakegen.control.servos import bounded_joints
from snakegen.errors import SnakegenError
from snakegen.kernels.flight.types import Memory, Plant, Simulator, Wiring
from snakegen.simulation.flight.elastic import tip_name
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.postures import turning_rates
from snakegen.simulation.flight.world import World

_STATIONS = 3  # points of a link at which it meets the air


@cache
def step_addresses() -> tuple[int, int]:
    """Returns the addresses of MuJoCo's ``mj_step1`` and ``mj_step2(const mjModel*, mjData*)``.

    Together they are ``mj_step``, but for its Runge-Kutta integrator, which no world here uses.

    Raises:
        SnakegenError: the package's library is not where its Python part is.
    """
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco*.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            library = ctypes.CDLL(str(path))
            halves = (library.mj_step1, library.mj_step2)
            begin, finish = (ctypes.cast(half, ctypes.c_void_p).value for half in halves)
            if begin is not None and finish is not None:
                return begin, finish
    raise SnakegenError(f"MuJoCo's library is not in {folder}; install the mujoco package anew.")


def simulator(world: World, data: mujoco.MjData) -> Simulator:
    """Returns views of `data`, which must outlive them, as must the world's model."""
    root = world.model.body(world.robot.root_link).id
    return Simulator(
        *step_addresses(),
        world.model._address,
        data._address,
        data.qpos,
        data.qvel,
        data.act,
        data.ctrl,
        data.actuator_force,
        np.zeros((world.model.nbody, 6)),
        data.qfrc_applied,
        data.cdof,
        data.xpos,
        data.xmat,
        data.xipos,
        data.cvel,
        data.subtree_com[root],
        data.site_xpos,
        data.site_xmat,
        data.sensordata,
    )


def wiring(world: World, plan: Plan) -> Wiring:
    """Returns where the loop finds the robot's quantities."""
    model, robot = world.model, world.robot
    sites = [model.site(r.label).id for a in robot.modules.apparatuses for r in a.rotors]
    bodies, points, axes, areas = stations(world)
    return Wiring(
        world.qpos,
        world.qvel,
        np.array(model.body_parentid, np.int64),
        np.array(model.dof_bodyid, np.int64),
        world.rotors,
        world.activation,
        np.array(model.body_weldid[model.site_bodyid[sites]], np.int64),  # fewer bodies to push
        np.array(sites, np.int64),
        world.gimbals,
        world.servos,
        np.array([model.actuator(n).id for n in bounded_joints(robot)], np.int64),
        int(model.body(plan.disturbance_link or robot.root_link).id),
        int(plan.disturbance_at_cog),
        bodies,
        points,
        axes,
        areas,
    )


def stations(world: World) -> tuple[np.ndarray, Floats, Floats, Floats]:
    """Returns body, place (s, 3), rod axis (s, 3) and side area (s,) [m²] of links' stations.

    Each cylinder that represents a link is met at three points, the middles of its thirds.
    """
    model = world.model
    names = [n for link in world.robot.modules.lengths for n in (link, tip_name(link))]
    found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, n) for n in names]
    links = {b for b in found if b > 0}
    bodies, points, axes, areas = [], [], [], []
    for g in range(model.ngeom):
        if model.geom_type[g] != mujoco.mjtGeom.mjGEOM_CYLINDER:
            continue
        if not model.geom_contype[g] or model.geom_bodyid[g] not in links:
            continue
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[g])
        radius, half = model.geom_size[g][:2]
        axis = turn.reshape(3, 3)[:, 2]
        for k in range(_STATIONS):
            share = (2 * k + 1) / _STATIONS - 1.0
            bodies.append(model.geom_bodyid[g])
            points.append(model.geom_pos[g] + share * half * axis)
            axes.append(axis)
            areas.append(2.0 * radius * 2.0 * half / _STATIONS)
    return (
        np.array(bodies, np.int64),
        np.array(points, float).reshape(-1, 3),
        np.array(axes, float).reshape(-1, 3),
        np.array(areas, float),
    )


def plant(world: World, plan: Plan, what: Imperfections, dt: float, position_rate: float) -> Plant:
    """Returns the constants of the simulated hardware for ticks of `dt` s."""
    robot, step = world.robot, float(world.model.opt.timestep)
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    turns = np.full(world.gimbal_joints.shape, np.inf)
    has = world.gimbal_joints >= 0
    turns[has] = speed_limits(world, world.gimbal_joints[has])
    joints = speed_limits(world, world.chain)
    if not what.servo_speed:
        turns[:], joints[:] = np.inf, np.inf
    spin = np.array([(r.spin or -np.sign(r.drag_ratio)) * r.inertia * r.speed for r in rotors])
    floor = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_GEOM, "floor") >= 0
    return Plant(
        max(1, round(dt / step)),
        step,
        max(1, round(1.0 / (position_rate * dt))),
        max(1, round(1.0 / (what.imu_rate * step))) if what.imu_rate else 1,
        *_delay_ticks(what.delay / dt),
        turns * dt,
        joints * dt,
        np.array(robot.rotors.thrust_max),
        spin * float(what.gyroscopic),
        power_factors(robot),
        battery_joules(what.battery_energy),
        float(what.voltage_sag),
        float(what.air_density),
        0.5 * np.array([r.diameter for r in rotors]),
        float(what.drag_coefficient),
        int(bool(what.ground_effect) and floor),
        int(bool(what.downwash)),
        np.array(robot.rotors.body),
        float(plan.give_up),
    )


def _delay_ticks(ticks: float) -> tuple[int, float]:
    """Returns whole ticks and what is left of one, [0, 1): within 1e-9 of a tick it is whole."""
    whole = int(np.floor(ticks + 1e-9))
    left = ticks - whole
    return whole, float(left) if left > 1e-9 else 0.0


def speed_limits(world: World, joints: np.ndarray) -> Floats:
    """Returns the URDF's velocity limits [rad/s] of joints, indices into the tree's angles."""
    return turning_rates(world.robot, [world.robot.joint_names[i] for i in joints])


def memory(world: World, gimbals: Floats, joints: Floats, delay: int, hinges: int = 0) -> Memory:
    """Returns the loop's memory before the first tick, `hinges` of them damped."""
    n, rotors, loaded = len(world.qpos), len(world.rotors), len(bounded_joints(world.robot))
    return Memory(
        np.array(gimbals, float),
        np.array(joints, float),
        np.zeros(12),
        np.zeros(6),
        np.zeros((delay + 2, 18 + 2 * n + hinges + loaded)),
        np.zeros(18 + 2 * n + hinges + loaded),
        np.zeros(rotors),
        np.zeros((world.model.nbody, 6)),
        np.zeros(1),
    )
