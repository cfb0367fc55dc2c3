"""Hold a posture by servos and thrust together: vectoring apparatuses on a fixed base.

Apparatuses push as `analyze relief` says. The run passes where servos hold what that leaves to
them, and the tip stays.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen import __version__
from snakegen.analysis import relief
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, MissionError
from snakegen.robot.kinematics import tip_jacobian
from snakegen.robot.posture import configuration_labels
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.hold import (
    Hold,
    Holding,
    HoldPlant,
    hold_still,
    rotor_thrusts,
    servo_share,
)
from snakegen.simulation.arm.plant import draw_arm
from snakegen.simulation.arm.record import tip_positions
from snakegen.simulation.arm.run import draw_trial, movable
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.world import World, make_world
from snakegen.simulation.monte_carlo import Spread
from snakegen.simulation.recording.metrics import metrics as measure
from snakegen.simulation.recording.recording import Recording, channel
from snakegen.simulation.recording.servo_strength import declared_servos, strength_checks
from snakegen.simulation.recording.worst_place import judged_verdict
from snakegen.simulation.run_settings import RunSettings
from snakegen.statics.joint_torques import finite, joint_torques
from snakegen.statics.relieved_posture import (
    AIMED,
    RelievedPosture,
    along_forces,
    relieved_posture,
)
from snakegen.statics.thrust_relief import ThrustMap, thrust_map
from snakegen.statics.tip import Tip, find_tip, tip_pose

STEP = 0.001  # s
CLOSE = 0.01  # of a servo's limit: gimbal servos deflect, which turns thrusts a little
STILL = 0.01  # of the arm's length, that the tip may be off (assumed)
_SIGMAS = 2.5


@dataclass(frozen=True)
class Options:
    """Options of mission `hold`.

    Attributes:
        posture: posture file; straight by default
        thrust: false: rotors stand still, the servos carry the load alone
        tip_force: N, at the end of the last link, world axes
        gravity: m/s², world
        duration: s
    """

    posture: Mapping[str, Any] | None = None
    thrust: bool = True
    tip_force: str = "0,0,0"
    gravity: str = "0,0,-9.81"
    duration: float = 3.0


def applies(robot: Robot) -> bool:
    """An arm with vectoring apparatuses on gimbals, and a servo on every joint of the chain."""
    return movable(robot) and relief.applies(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Holds the posture and returns the judged recording.

    Raises:
        MissionError: loads that servos and thrust cannot hold, gimbals that cannot aim.
    """
    if not options.duration > 0.5:
        raise MissionError(f"duration {options.duration:g} s: more than 0.5 is needed.")
    try:
        force = finite(options.tip_force, (3,), "tip_force")
        gravity = finite(options.gravity, (3,), "gravity")
    except AnalysisError as error:
        raise MissionError(str(error)) from None
    q: Floats = robot.configuration(options.posture)
    tip = find_tip(robot)
    if options.thrust:
        posture = relieved_posture(
            robot, q, gravity, lambda at: _load(robot, at, tip, force, gravity)[0]
        )
        q, forces, best = posture.q, posture.relieved.forces, posture.relieved.value
        _check(robot, posture)
    else:
        forces = np.zeros((len(robot.modules.apparatuses), 3))
        q, best = along_forces(robot, q, forces)[0], None
    reach, (load, wrench) = thrust_map(robot, q), _load(robot, q, tip, force, gravity)
    left = servo_share(reach, forces, load)
    hold = Hold(
        q, rotor_thrusts(robot, forces), left, tip.link, _in_link(robot, tip), force, gravity,
        options.duration,
    )  # fmt: skip
    world = make_world(robot, timestep=STEP, floor=False)
    plant, drawn = _plant(world, settings)
    held = hold_still(world, hold, plant, settings.progress)
    bounds = {"relief_gap_use": CLOSE, "position_held_m": STILL * _length(robot)}
    if not settings.ideal:
        bounds = _expected(robot, q, gravity, reach, forces)
    facts = {
        "relief": best,
        "servo_torque_predicted_n_m": left.tolist(),
        "tip_wrench": wrench,
        "thrust_n": hold.thrust.tolist(),
    }
    return _judged(world, hold, held, settings, facts, bounds, drawn, options)


def _load(
    robot: Robot, q: Floats, tip: Tip, force: Floats, gravity: Floats
) -> tuple[Floats, list[float]]:
    """Returns the joints' torques (k,) [N·m] under a force at the tip, and that as a wrench."""
    origin = robot.body_of_link(tip.link)[2]
    lever = tip_pose(robot, q, tip).position
    lever = lever - tip_pose(robot, q, Tip(tip.link, tip.body, origin)).position
    wrench = [*force.tolist(), *np.cross(lever, force).tolist()]
    static = joint_torques(robot, q, wrenches={tip.link: wrench}, gravity=gravity, terms="static")
    index = [robot.joint_names.index(n) for n in robot.chain_joints]
    return np.asarray(static)[index], wrench


def _in_link(robot: Robot, tip: Tip) -> Floats:
    _, turn, origin = robot.body_of_link(tip.link)
    return np.asarray(turn.T @ (tip.point - origin))


def _check(robot: Robot, posture: RelievedPosture) -> None:
    """Raises MissionError where servos and thrust cannot hold it, or gimbals cannot aim."""
    share, off = posture.relieved.value, posture.off
    if share > 1.0:
        raise MissionError(
            f"{robot.name}: servos and thrust cannot hold this; {100 * share:.3g} % of a "
            "servo's torque at best."
        )
    if (off > AIMED).any():
        j = int(np.argmax(off))
        raise MissionError(
            f"the gimbals of {robot.apparatus_names[j]} end {off[j]:.3g} rad from its thrust."
        )


def _plant(world: World, settings: RunSettings) -> tuple[HoldPlant, dict[str, float]]:
    """Returns the hardware of a run, and what was drawn."""
    drawn, trial = draw_trial(world, settings.draw)
    rotors, joints = len(world.rotors), len(world.chain)
    if settings.ideal:
        return HoldPlant(world.model, np.ones(rotors), np.zeros(joints)), drawn
    mismatch = Imperfections.of(world.robot.modules.plant).thrust_mismatch
    rng = np.random.default_rng(settings.seed) if trial is None else settings.draw[1]
    factor = 1.0 + mismatch * rng.standard_normal(rotors)
    if trial is not None:
        return HoldPlant(trial.model(world), factor, trial.offset), drawn
    arm = draw_arm(world, None, settings.seed, ideal=False)
    return HoldPlant(arm.world(world).model, factor, arm.offsets), drawn


def _length(robot: Robot) -> float:
    return float(sum(robot.modules.lengths.values()) or robot.link_length)


def _expected(
    robot: Robot, q: Floats, gravity: Floats, reach: ThrustMap, forces: Floats
) -> dict[str, float]:
    """Returns bounds of what default imperfections do: 2.5 standard deviations, and a little.

    Each body's mass is off on its own, and so are the rotors of an apparatus. Servos yield to what
    that leaves to them; their encoders are off too.
    """
    what, mass = Imperfections(), Spread().mass / np.sqrt(3.0)
    tree, angles, base = robot.tree, robot.angles(q), robot.base_pose(q)[0]
    index = [robot.joint_names.index(n) for n in robot.chain_joints]
    weights = [
        tip_jacobian(tree, base, angles, b, tree.com[b])[2][:3, index].T @ (m * gravity)
        for b, m in enumerate(tree.mass)
    ]
    pushed = (reach.relief * forces.ravel()).reshape(len(index), -1, 3).sum(axis=2)
    rotors = np.array([len(a.rotors) for a in robot.modules.apparatuses])
    spread = np.hypot(
        mass * np.linalg.norm(weights, axis=0),
        what.thrust_mismatch * np.linalg.norm(pushed / np.sqrt(rotors), axis=1),
    )
    servos = {s.joint: s.stiffness for s in robot.modules.servos}
    yielded = spread / np.array([servos[n] for n in robot.chain_joints])
    moved = tip_pose(robot, q, find_tip(robot)).jacobian[:3, index]
    off = float(np.linalg.norm(moved * np.hypot(yielded, what.joint_noise)))
    return {
        "relief_gap_use": CLOSE + _SIGMAS * float(np.max(spread / reach.effort)),
        "position_held_m": 0.1 * STILL * _length(robot) + _SIGMAS * off,
    }


def _judged(
    world: World,
    hold: Hold,
    held: Holding,
    settings: RunSettings,
    facts: dict[str, Any],
    most: dict[str, float],
    drawn: dict[str, float],
    options: Options,
) -> Recording:
    robot, time = world.robot, held.time
    names = [robot.joint_names[k] for k in world.chain]
    angles = held.qpos[:, world.qpos]
    asked = np.tile(robot.angles(hold.q), (len(time), 1))
    tip, links = find_tip(robot), [r.link for a in robot.modules.apparatuses for r in a.rotors]
    law = np.tile(hold.torque, (len(time), 1))
    channels = {
        "position": channel("position", tip_positions(robot, angles, tip), meaning="the tip"),
        "position_target": channel("position_target", tip_positions(robot, asked, tip)),
        "q": channel("q", world.configurations(held.qpos), configuration_labels(robot)),
        "joint_angle": channel("joint_angle", angles[:, world.chain], names),
        "joint_command": channel("joint_command", asked[:, world.chain], names),
        "joint_torque": channel("joint_torque", held.torque, names),
        "joint_rate": channel("joint_rate", held.rate, names),
        "servo_deflection": channel("servo_deflection", held.deflection, names),
        "joint_torque_law": channel(
            "joint_torque_law", law, names, unit="N·m", group="joint torque by the law",
            meaning="what `analyze relief` leaves to the servos",
        ),
        "thrust": channel("thrust", held.thrust, links),
    }  # fmt: skip
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    meta = {
        "robot": robot.name,
        "mission": "hold",
        "mode": "servos and thrust" if options.thrust else "servos alone",
        "seed": settings.seed,
        "ideal": settings.ideal,
        "version": __version__,
        "weight_n": robot.force_scale,
        "urdf": robot.urdf,
        "urdf_sha256": robot.urdf_hash,
        "rotors": [{"link": r.link, "axis": list(r.axis)} for r in rotors],
        "limits": {
            "joint_torque": robot.limits(names)[2].tolist(),
            "thrust_max": [r.thrust_max for r in rotors],
        },
        "joint_servos": declared_servos(robot, names),
        "gravity_m_s2": hold.gravity.tolist(),
        "stopped": held.stopped,
        "planned_s": hold.duration,
        "facts": facts,
    } | ({"drawn": drawn} if drawn else {})
    recording = Recording(time, channels, (), meta)
    found = measure(recording) | metrics(recording) | {"completed": not held.stopped}
    bounds: dict[str, Any] = {
        "completed": {"equals": True},
        "finite": {"equals": True},
        "joint_torque_use": {"at_most": 0.99},
    } | {name: {"at_most": value} for name, value in most.items()}
    bounds |= strength_checks(found)
    return recording.judged(found, judged_verdict(recording, found, bounds))


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the run's last half is from the prediction.

    Of the servos' torques, as a share of their limits, the mean of the joint where it is most; of
    the tip the farthest. The start is a step of load, since masses and thrusts are not as believed.
    """
    late = recording.time >= 0.5 * recording.time[-1]
    servo, law = (
        recording.channel(n).values[late].mean(axis=0) for n in ("joint_torque", "joint_torque_law")
    )
    limit = np.maximum(np.asarray(recording.meta["limits"]["joint_torque"], float), 1e-12)
    tip, goal = (recording.channel(n).values[late] for n in ("position", "position_target"))
    return {
        "relief_gap_use": float(np.max(np.abs(servo - law) / limit)),
        "position_held_m": float(np.linalg.norm(tip - goal, axis=1).max()),
    }
