"""Many runs of an arm's mission over what is not known well: pass rate, its interval, the worst.

The command stays that of the nominal robot; masses, inertias, joint friction, servo stiffness and
the offsets of joint sensors are drawn for each run. A run passes if it ends, servos stay within
their torque, and the tip stays within a share of the arm's length of where it should be.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.inverse_kinematics.friction import Friction
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.world import World
from snakegen.simulation.missions import mission
from snakegen.simulation.missions.options import checked_options
from snakegen.simulation.monte_carlo import MonteCarlo, Spread, Trial
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings
from snakegen.simulation.trial_loop import run_trials

TIP_SHARE = 0.01  # of the arm's length, that the tip may be off (assumed)
TORQUE_USE = 0.99


@dataclass(frozen=True)
class ArmSpread:
    """Half ranges of uniform draws, relative unless a unit is given."""

    mass: float = 0.05  # each body's, its inertia with it
    inertia: float = 0.10  # each body's, in addition to its mass
    friction: float = Spread.friction  # of each joint: 0 … this share of its servo's torque, added
    stiffness: float = 0.10  # of each servo (assumed)
    offset_rad: float = 0.00175  # standard deviation of each joint sensor (plant.joint_noise)

    @staticmethod
    def of(robot: Robot) -> "ArmSpread":
        """Returns the ranges of a robot: plant.uncertainty and plant.joint_noise of its spec."""
        known = Spread.of(robot.modules.uncertainty)
        offset = float(robot.modules.plant.get("joint_noise", ArmSpread.offset_rad))
        return ArmSpread(known.mass, known.inertia, known.friction, offset_rad=offset)


@dataclass(frozen=True, eq=False)
class ArmDraw:
    """What one run draws.

    Attributes:
        mass, inertia: (bodies,) factors.
        friction: (k,) N·m, added to that of each joint.
        stiffness: (k,) factors of the servos.
        offset: (k,) rad, of the joint sensors.
    """

    mass: Floats
    inertia: Floats
    friction: Floats
    stiffness: Floats
    offset: Floats

    def model(self, world: World) -> mujoco.MjModel:
        """Returns the simulated model: the world's off its nominal values."""
        model = copy.copy(world.model)
        model.body_mass *= self.mass
        model.body_inertia *= (self.mass * self.inertia)[:, None]
        model.actuator_gainprm[world.servos, 0] *= self.stiffness
        model.actuator_biasprm[world.servos, 1] *= self.stiffness
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model

    def rubbed(self, friction: Friction) -> Friction:
        """Returns the joints' friction with what was drawn on top."""
        return Friction(friction.static + self.friction, friction.sliding + self.friction)


def draw(world: World, spread: ArmSpread, rng: np.random.Generator) -> ArmDraw:
    """Draws a run; a seed gives the same draw on every machine."""
    bodies, joints = world.model.nbody, len(world.chain)
    names = [world.robot.joint_names[k] for k in world.chain]
    effort = world.robot.limits(names)[2]
    return ArmDraw(
        1.0 + spread.mass * rng.uniform(-1.0, 1.0, bodies),
        1.0 + spread.inertia * rng.uniform(-1.0, 1.0, bodies),
        spread.friction * effort * rng.uniform(0.0, 1.0, joints),
        1.0 + spread.stiffness * rng.uniform(-1.0, 1.0, joints),
        spread.offset_rad * rng.normal(size=joints),
    )


def arm_trials(
    robot: Robot,
    name: str,
    count: int,
    *,
    seed: int = 0,
    options: dict[str, Any] | None = None,
    spread: ArmSpread | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> tuple[MonteCarlo, Recording]:
    """Runs a mission of an arm `count` times; returns the outcome and the worst recording.

    Args:
        robot: an arm.
        name: of the mission.
        count: of runs.
        seed: of the draws; run k draws from [seed, k].
        options: of the mission.
        spread: what is drawn; the robot's own ranges if absent.
        progress: called with runs done and runs in all.

    Raises:
        MissionError: fewer than one run.
        KeyboardInterrupt: interrupted before the first was finished.
    """
    module = mission(name, robot)
    chosen = checked_options(name, module.Options, options or {})
    spread = ArmSpread.of(robot) if spread is None else spread
    length = sum(robot.modules.lengths.values()) or robot.link_length

    def fly(rng: np.random.Generator) -> Recording:
        out: Recording = module.fly(robot, chosen, RunSettings(seed, draw=(spread, rng)))
        return out

    def judge(recording: Recording, number: int) -> Trial:
        return _judged(recording, number, TIP_SHARE * length)

    return run_trials(fly, judge, count, seed=seed, spread=spread, progress=progress)


def _judged(recording: Recording, number: int, allowed: float) -> Trial:
    """Returns the trial of a run: passed if it ended, within torque, the tip within `allowed` m."""
    tip, goal = (recording.channel(n).values for n in ("position", "position_target"))
    off = float(np.linalg.norm(tip - goal, axis=1).max())
    angle, asked = (recording.channel(n).values for n in ("joint_angle", "joint_command"))
    torque = np.abs(recording.channel("joint_torque").values)
    use = float(np.max(torque / np.array(recording.meta["limits"]["joint_torque"])))
    stopped = str(recording.meta["stopped"])
    checks = {
        "completed": not stopped,
        "finite": bool(np.isfinite(tip).all()),
        "joint_torque_use": use <= TORQUE_USE,
        "position_max_m": off <= allowed,
    }
    failed = tuple(name for name, good in checks.items() if not good)
    metrics = {
        "position_max_m": off,
        "position_allowed_m": allowed,
        "joint_error_max_rad": float(np.abs(angle - asked).max()),
        "joint_torque_use": use,
        "duration_s": float(recording.time[-1]),
    }
    drawn = dict(recording.meta["drawn"])
    return Trial(number, drawn, metrics, not failed, not failed, stopped, failed)
