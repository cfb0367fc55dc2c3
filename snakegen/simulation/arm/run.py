"""A verification run of an arm: motion → MuJoCo by its servos → recording → verdict.

Three torques stand side by side in the log: the servos' (`joint_torque`), the law's of the motion
asked for (`joint_torque_law`) and MuJoCo's inverse dynamics of it (`joint_torque_inverse`); and the
law's of the motion that the servos made, which needs no tracking to be good (`joint_torque_made`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from snakegen import __version__
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, MissionError
from snakegen.inverse_kinematics.friction import friction_of
from snakegen.inverse_kinematics.motion import Motion
from snakegen.inverse_kinematics.torques_along import torques_along
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.loop import move
from snakegen.simulation.arm.metrics import arm_report
from snakegen.simulation.arm.plant import draw_arm, expected_joint_error, expected_tip_error
from snakegen.simulation.arm.record import achieved_torques, arm_channels
from snakegen.simulation.flight.world import World, make_world
from snakegen.simulation.monte_carlo import Spread
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.servo_strength import declared_servos, strength_checks
from snakegen.simulation.recording.worst_place import judged_verdict
from snakegen.simulation.run_settings import ARM_STEP as STEP
from snakegen.simulation.run_settings import RunSettings
from snakegen.statics.joint_torques import finite
from snakegen.statics.tip import Tip, find_tip

LOGGED = 0.002  # s, between rows of the log
GAP = 0.0035  # of a servo's limit: torque that the law of the motion made may leave unexplained
TIP_SIGMAS = 2.0  # expected errors of the tip that a run may have
JOINT_SIGMAS = 5.0  # likewise of the joint that is worst at its worst instant
TRACKED = 0.05  # rad, of an ideal arm, and at most of any
THRESHOLDS: dict[str, dict[str, Any]] = {
    "completed": {"equals": True},
    "finite": {"equals": True},
    "joint_torque_use": {"at_most": 0.99},
    "joint_tracking_max_rad": {"at_most": TRACKED},
    "inverse_gap_share": {"at_most": 1e-9},
}
IDEAL: dict[str, dict[str, Any]] = {"made_gap_share": {"at_most": 1e-6}}
FOLLOWS: dict[str, dict[str, Any]] = {"torque_gap_share": {"at_most": 0.01}}
FEED_FORWARD = {
    "none": "none: the angle alone",
    "speed": "speed: what damping takes",
    "law": "speed and the torque of the model's law",
}


def movable(robot: Robot) -> bool:
    """Tells whether a robot is an arm on a fixed base whose every chain joint has a servo."""
    driven = {s.joint for s in robot.modules.servos}
    return not robot.floating and bool(robot.chain_joints) and set(robot.chain_joints) <= driven


@dataclass(frozen=True)
class ArmOptions:
    """Options of every mission of an arm.

    Attributes:
        gravity: m/s², world
        lead: what servos get in addition to the angle: none, speed, or law (speed and torque)
        friction: static,sliding of every joint in N·m, as in 0.1,0.06; else the servos' own
    """

    gravity: str = "0,0,-9.81"
    lead: str = "law"
    friction: str | None = None


@dataclass(frozen=True, eq=False)
class ArmGoal:
    """What a mission asks of an arm in addition to its motion.

    Attributes:
        tip: the point whose place is logged; the last link's end if absent.
        target: (T,) s → (T, 3) m, where it should be, where that is not simply where the motion
            asked for has it.
        bound: m, between the tip and its target, of an arm that is its model; others may be off by
            twice what default imperfections are expected to do (`expected_tip_error`).
        thresholds: of the verdict, over the defaults; None takes a check out.
        facts: what the mission wants in the log, as JSON.
    """

    tip: Tip | None = None
    target: Callable[[Floats], Floats] | None = None
    bound: float | None = None
    thresholds: Mapping[str, Any] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)


def run_arm(
    robot: Robot,
    motion: Motion,
    mission: str,
    options: ArmOptions,
    settings: RunSettings,
    goal: ArmGoal | None = None,
) -> Recording:
    """Runs `motion` in MuJoCo and returns the judged recording.

    Args:
        robot: an arm, as `movable` says.
        motion: of its chain.
        mission: name.
        options: of the mission, for the log.
        settings: of the run; its seed draws the arm's hardware (`arm_plant.draw_arm`), unless
            `draw` does (`arm_trials`).
        goal: what the mission asks of the tip and of the verdict.

    Raises:
        MissionError: invalid options.
        SnakegenError: as `torques_along`.
    """
    goal, ideal = goal or ArmGoal(), settings.ideal
    try:
        gravity = finite(options.gravity, (3,), "gravity")
        known = friction_of(options.friction, robot, motion.joints)
        rub = known if known.present or options.friction is not None else None
    except AnalysisError as error:
        raise MissionError(str(error)) from None
    world = make_world(robot, timestep=STEP, floor=False)
    world.model.dof_frictionloss[world.qvel[world.chain]] = 0.0  # the loop applies it, once
    q = robot.configuration()
    along = torques_along(robot, q, motion, motion.times(1.0 / STEP), gravity=gravity)
    lead = options.lead
    drawn, trial = draw_trial(world, settings.draw)
    plant = draw_arm(world, rub, settings.seed, ideal=ideal or trial is not None)
    if trial is not None:
        plant = replace(plant, friction=trial.rubbed(plant.friction))
    rub = plant.friction
    moved = move(
        world, along, gravity, plant=plant, lead=lead,
        simulated=None if trial is None else trial.model(world),
        offset=0.0 if trial is None else trial.offset,
        progress=settings.progress,
    )  # fmt: skip
    made = achieved_torques(world, moved, gravity)
    rows = np.arange(0, moved.ticks, round(LOGGED / STEP))
    end = find_tip(robot) if goal.tip is None else goal.tip
    channels = arm_channels(world, along, moved, made, end, goal.target, rows)
    meta = {
        "robot": robot.name,
        "mission": mission,
        "mode": f"servos led by {lead}",
        "feed_forward": FEED_FORWARD[lead],
        "seed": settings.seed,
        "ideal": ideal,
        "version": __version__,
        "weight_n": robot.force_scale,
        "urdf": robot.urdf,
        "urdf_sha256": robot.urdf_hash,
        "rotors": [],
        "limits": {"joint_torque": robot.limits(motion.joints)[2].tolist()},
        "joint_servos": declared_servos(robot, motion.joints),
        "options": {k: v for k, v in vars(options).items() if v is not None},
        "gravity_m_s2": gravity.tolist(),
        "friction_n_m": list(rub.highest),
        "stopped": moved.stopped,
        "planned_s": float(along.time[-1]),
        "facts": dict(goal.facts)
        | {"arm_plant": None if ideal or trial is not None else plant.facts(world)},
    } | ({"drawn": drawn} if drawn else {})
    recording = Recording(along.time[rows], channels, (), meta, arm_report(channels))
    found = metrics(recording) | {"completed": not moved.stopped}
    # Friction holds joints back where they turn round: then only the motion made is comparable.
    bounds: dict[str, Any] = THRESHOLDS | strength_checks(found)
    if ideal:
        bounds |= IDEAL | ({} if rub.present or lead != "law" else FOLLOWS)
    else:  # independent masses add up to about half of what they would all together
        use = np.abs(along.torque()) / np.maximum(meta["limits"]["joint_torque"], 1e-12)
        bounds["made_gap_use"] = {"at_most": GAP + 0.42 * Spread().mass * float(use.max())}
        off = JOINT_SIGMAS * expected_joint_error(world, along)
        bounds["joint_tracking_max_rad"] = {"at_most": min(off, TRACKED)}
    if goal.bound is not None:
        off = 0.0 if ideal else TIP_SIGMAS * expected_tip_error(world, along, end)
        bounds["position_max_m"] = {"at_most": max(goal.bound, off)}
    bounds |= goal.thresholds
    if not ideal and bounds.get("torque_gap_share"):
        del bounds["torque_gap_share"]
    return recording.judged(found, judged_verdict(recording, found, bounds))


def draw_trial(world: World, given: Any) -> tuple[dict[str, float], Any]:
    """Returns what was drawn for a run, in numbers for its log, and the draw; none without."""
    if given is None:
        return {}, None
    from snakegen.simulation.arm.trials import draw

    plant = draw(world, *given)
    moving = world.model.body_mass
    numbers = {
        "mass": float(moving @ plant.mass / moving.sum()),
        "friction_max_Nm": float(plant.friction.max()),
        "stiffness_min": float(plant.stiffness.min()),
        "offset_max_rad": float(np.abs(plant.offset).max()),
    }
    return numbers, plant
