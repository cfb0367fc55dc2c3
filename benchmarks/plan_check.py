"""Certificates of plans against another code path: MuJoCo's bodies, SciPy's margins.

A certificate comes from Pinocchio, coal and a dual search of its own. Here the body is MuJoCo's,
its gimbals where hover turns them, its centre of gravity MuJoCo's own; distances are MuJoCo's.
Margins are minimised by SciPy from random starts over the support function of the wrench set,

    min over (v, ω) of Σ L_j ‖v + ω × p_j‖ - v·w0,   ‖v‖ = 1 (force) or ‖ω‖ = 1 (torque),

whose every value is an upper bound of the margin: a value below the certificate's bound would show
an error in the proof.
"""

from typing import Any

import mujoco
import numpy as np
from scipy.optimize import minimize

from snakegen.analysis.allocation import allocation
from snakegen.planning.body import attitude
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.scene.solids import Solid
from snakegen.simulation.flight.postures import place
from snakegen.simulation.flight.world import World, make_world
from snakegen.simulation.recording.clearance import clearances

RATE = 10_000.0  # Hz
COARSE = 100.0  # Hz, at which every instant's neighbourhood is looked at first
GIMBALS = 10.0  # Hz, at which hover's gimbal angles are worked out; certificates hold at any
SPEED = 2.0  # m/s: no point of a body in these plans is faster (0.3 m/s, 0.3 rad/s, 0.31 rad/s)
INSTANTS, STARTS = 6, 6  # of the margins


def below_bounds(
    robot: Robot,
    path: Trajectory,
    solids: tuple[Solid, ...],
    certificate: dict[str, Any] | None,
    seed: int = 0,
) -> dict[str, float]:
    """Returns how far a sample is below its bound, m, N and N·m; 0 where none is.

    The certificate is that of a plan file. Distances are taken at 10 kHz wherever the samples at
    100 Hz are near enough to the bound for anything in between to be below it.
    """
    proved = certificate or {}
    lower = {k.rpartition("_")[0]: v["lower_bound"] for k, v in proved.items() if k != "intervals"}
    world = make_world(robot, floor=False, obstacles=solids)
    bodies = Bodies(robot, world, path)
    times = np.arange(0.0, path.times[-1], 1.0 / COARSE)
    found = bodies.distances(times)
    reach = SPEED * 0.5 / COARSE
    fine = [times]
    step = np.arange(-0.5, 0.5, COARSE / RATE) / COARSE
    near = (found - lower["clearance"] < reach).any(axis=1)
    values = [found]
    if near.any():
        fine.append(np.clip((times[near, None] + step).ravel(), 0.0, path.times[-1]))
        values.append(bodies.distances(fine[-1]))
    least = np.concatenate(values).min()
    out = {"clearance": max(0.0, lower["clearance"] - float(least))}
    rng = np.random.default_rng(seed)
    when = [proved[k]["time_s"] for k in ("force_margin_N", "torque_margin_Nm")]
    when += rng.uniform(0.0, path.times[-1], INSTANTS - len(when)).tolist()
    for kind in ("force", "torque"):
        bound = lower[f"{kind}_margin"]
        value = min(upper_margin(robot, bodies.posture(t), kind, rng) for t in when)
        out[f"{kind}_margin"] = max(0.0, bound - value)
    return out


class Bodies:
    """MuJoCo's body along a path, gimbals as hover turns them."""

    def __init__(self, robot: Robot, world: World, path: Trajectory) -> None:
        """Works out gimbal angles; between instants they are interpolated."""
        self.robot, self.world, self.path = robot, world, path
        self.grid = np.arange(0.0, path.times[-1] + 1.0 / GIMBALS, 1.0 / GIMBALS)
        rows = []
        for t in self.grid:
            data = mujoco.MjData(world.model)
            world.set_state(data, self.posture(float(t)))
            rows.append(np.array(data.qpos))
        self.rows = np.array(rows)
        free = 7
        self.rows[:, free:] = np.unwrap(self.rows[:, free:], axis=0)

    def posture(self, time: float) -> np.ndarray:
        """Returns q at `time` [s], hovering."""
        pose = self.path.at(time)
        return place(self.robot, pose[6:], pose[:3], attitude(pose[3:6], self.path.heading))

    def distances(self, times: np.ndarray) -> np.ndarray:
        """Returns obstacle distances (m, 1) [m] at `times` [s]; MuJoCo's CoG is the plan's."""
        model, data = self.world.model, mujoco.MjData(self.world.model)
        poses = self.path.at(times)
        at = np.searchsorted(self.grid, times, side="right") - 1
        at = np.clip(at, 0, len(self.grid) - 2)
        share = (times - self.grid[at]) * GIMBALS
        rows = self.rows[at] + share[:, None] * (self.rows[at + 1] - self.rows[at])
        driven = [i for i, n in enumerate(self.robot.joint_names) if n in self._names]
        rows[:, self.world.qpos[driven]] = poses[:, 6:]
        for row, pose in zip(rows, poses, strict=True):
            turn = attitude(pose[3:6], self.path.heading)
            mujoco.mju_mat2Quat(row[3:7], turn.ravel())
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            row[:3] += pose[:3] - data.subtree_com[1]
        return clearances(self.world, rows)[2][:, None]

    @property
    def _names(self) -> list[str]:
        from snakegen.robot.posture import driven_joints

        return driven_joints(self.robot)


def upper_margin(robot: Robot, q: np.ndarray, kind: str, rng: np.random.Generator) -> float:
    """Returns an upper bound of the force [N] or torque [N·m] margin of a posture."""
    a = allocation(robot, q)
    points, limit = a.thrust_points, np.array(robot.gimbals.limit)
    down = np.asarray(a.hover_wrench)
    assert np.linalg.norm(down[3:]) < 1e-9 and abs(np.linalg.norm(down) - a.mass * GRAVITY) < 1e-6

    def value(x: np.ndarray) -> float:
        size = np.linalg.norm(x[:3] if kind == "force" else x[3:])
        pulled = x[:3] + np.cross(x[3:], points)
        return float((limit @ np.linalg.norm(pulled, axis=1) - x @ down) / max(size, 1e-9))

    best = np.inf
    for _ in range(STARTS):
        found: Any = minimize(value, rng.normal(size=6), method="BFGS", options={"gtol": 1e-5})
        found = minimize(value, found.x, method="Nelder-Mead", options={"maxiter": 600})
        best = min(best, float(found.fun))
    return best
