"""From the rows of a drive to its judged recording."""

from typing import Any

import numpy as np

from snakegen import __version__
from snakegen.base.geometry import Floats
from snakegen.base.sample_store import in_pieces
from snakegen.errors import MissionError
from snakegen.robot.losses import NONE
from snakegen.robot.posture import configuration_labels
from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import yaw_joints
from snakegen.screw_drive.kinematics import ScrewGeometry
from snakegen.simulation.drive.plan import DrivePlan, choice, rates
from snakegen.simulation.drive.run import Driven, pitch_joints, run_contact, run_kinematic
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import (
    Channel,
    Event,
    Recording,
    channel,
    held_channel,
)
from snakegen.simulation.recording.servo_strength import declared_servos, strength_checks
from snakegen.simulation.recording.worst_place import judged_verdict
from snakegen.simulation.run_settings import NOMINAL, RunSettings

DRIVE_THRESHOLDS: dict[str, dict[str, Any] | None] = {
    "completed": {"equals": True},
    "finite": {"equals": True},
    "distance_excess_m": {"at_most": 0.02},
    "tilt_max_rad": {"at_most": 0.2, "channel": "wheel_load"},
    "slip_mean_m_s": {"at_most": 0.02},
    "cone_use_mean": {"at_most": 0.9, "channel": "wheel_load"},
    "screw_rate_use": {"at_most": 1.0},
    "screw_torque_use": {"at_most": 0.99, "channel": "screw_torque"},
    "joint_torque_use": {"at_most": 0.99, "channel": "joint_torque"},
}
PASSAGE: dict[str, dict[str, Any] | None] = {"path_share": {"at_least": 1.0}}
"""Of missions that show a passage: what was not reached was not shown."""
FROM_PATH: dict[str, dict[str, Any] | None] = {
    "distance_rmse_m": {"at_most": 0.01},
    "shape_rmse_rad": {"at_most": 0.05},
}
"""Tracking of a drive that starts on its path: judged over the whole run."""
FROM_ASIDE: dict[str, dict[str, Any] | None] = {
    "distance_rmse_settled_m": {"at_most": 0.01},
    "shape_rmse_settled_rad": {"at_most": 0.05},
}
"""Tracking of a drive that starts off its path: judged after HA's start error has decayed."""
PLANTS = ("contact", "kinematic")
ON_PATH = 1e-6  # m, rad: a start that differs from the reference by less is on it
DRAWN = 25.0  # Hz, of the configuration: the eye needs no more, and wheels are many


def drive(
    robot: Robot,
    mission: str,
    plan: DrivePlan,
    *,
    plant: str = "contact",
    settings: RunSettings = NOMINAL,
    rollers: str | None = None,
    more: dict[str, Any] | None = None,
) -> Recording:
    """Drives a plan in one of the two plants and returns the judged recording.

    Args:
        robot: with two drums or more.
        mission: its name, for the log.
        plan: what to do.
        plant: "contact" or "kinematic".
        settings: of the run; the kinematic plant has no noise.
        rollers: contact representation in place of the robot's own.
        more: metrics that this run alone does not show, from a run to compare with.

    Raises:
        MissionError: ground or pitch motion in the kinematic plant, or no such plant.
    """
    if choice(plant, PLANTS, "plant") == "kinematic":
        driven = run_kinematic(robot, plan, settings.progress)
    else:
        driven = run_contact(robot, plan, settings, rollers=rollers)
    nominal = settings.ideal or plant == "kinematic"
    losses = NONE if nominal else robot.modules.losses
    gain = np.broadcast_to(np.asarray(plan.gain, float), plan.start.shape).tolist()
    meta = {
        "mission": mission,
        "seed": settings.seed,
        "mode": "screw drive",
        "drive_plant": plant,
        "rollers": rollers or robot.modules.screws[0].rollers if plant == "contact" else "",
        "ideal": nominal,
        "losses": vars(losses),
        "drawn": {} if settings.draw is None else settings.draw.to_json(),
        "gain_1_s": gain,
        "feedback": plan.feedback,
        "reference_s": plan.reference.duration,
        "stopped": driven.stopped,
        "planned_s": plan.duration,
        "compliance": plan.compliance,
        "facts": plan.facts,
        "obstacles": [vars(b) for b in plan.obstacles],
    }
    return judge(record(driven, meta), plan.thresholds, more)


def judge(
    recording: Recording,
    thresholds: dict[str, dict[str, Any] | None],
    more: dict[str, Any] | None = None,
) -> Recording:
    """Returns the recording with its metrics and verdict; a run cut short does not pass.

    Nor does one that starts off its path and ends before its start error has decayed.
    """
    found = metrics(recording) | (more or {})
    found["completed"] = not recording.meta["stopped"]
    error = recording.channel("state_error").values[0]
    tracking = FROM_PATH if float(np.abs(error).max()) < ON_PATH else FROM_ASIDE
    tracking = {k: v for k, v in tracking.items() if error.size > 3 or "shape" not in k}
    bounds = DRIVE_THRESHOLDS | strength_checks(found) | tracking | thresholds
    return recording.judged(found, judged_verdict(recording, found, bounds))


def beside_open_ground(free: dict[str, Any]) -> dict[str, Any]:
    """Returns the figures of the same drive on open ground, named so.

    Raises:
        MissionError: a drive that touched nothing.
    """
    if "wheel_load_max_n" not in free:
        raise MissionError("the kinematic plant knows flat ground alone; use plant=contact.")
    names = ("distance_rmse_m", "distance_end_m", "screw_torque_max_n_m", "wheel_load_max_n")
    return {f"open_ground_{name}": free[name] for name in (*names, "cone_use_mean")}


def record(driven: Driven, meta: dict[str, Any]) -> Recording:
    """Returns the recording of a drive."""
    robot, g, rows = driven.robot, driven.geometry, driven.rows
    time, base = np.array(rows["time"]), rows["base"]
    names = _Names(robot)
    at = [robot.joint_names.index(n) for n in names.joints]
    channels = _pose(rows, g)
    slow = np.arange(0, len(time), max(1, round(1.0 / (DRAWN * (time[1] - time[0])))))
    q = configurations(robot, base[slow], rows["joints"][slow])
    channels["q"] = channel("q", q, names.q, time=time[slow])
    angle = in_pieces(len(time), lambda part: (rows["joints"][part][:, at],))[0]
    channels["joint_angle"] = held_channel("joint_angle", angle, names.joints)
    channels["screw_rate"] = held_channel("screw_rate", rows["rate"], names.screws)
    channels["screw_rate_command"] = held_channel(
        "screw_rate_command",
        rows["command"][:, : g.units],
        names.screws,
        unit="rad/s",
        group="screw rate command",
        meaning="commanded rate of each screw",
    )
    channels["slip"] = held_channel("slip", rows["slip"], names.screws)
    error = in_pieces(len(time), lambda part: (rows["state"][part] - rows["desired"][part],))[0]
    labels = ["x", "y", "heading", *(n.removesuffix("_yaw") for n in yaw_joints(robot))]
    channels["state_error"] = held_channel(
        "state_error",
        error,
        labels,
        unit="m, rad",
        group="state error",
        meaning="e = w − w_d of HA eq 8",
    )
    channels |= _contact(rows, names)
    events = tuple(Event(*e) for e in sorted(driven.events))
    return Recording(time, channels, events, _meta(robot, names, meta))


def _pose(rows: dict[str, Floats], g: ScrewGeometry) -> dict[str, Channel]:
    """Returns the head's place and heading, and where they should be."""
    desired, base = rows["desired"], rows["base"]

    def targets(part: slice) -> tuple[Floats, Floats]:
        wanted = desired[part]
        goal, turn = np.zeros((len(wanted), 3)), np.zeros((len(wanted), 4))
        goal[:, :2], goal[:, 2] = wanted[:, :2], g.r
        turn[:, 2], turn[:, 3] = np.sin(wanted[:, 2] / 2), np.cos(wanted[:, 2] / 2)
        return goal, turn

    goal, turn = in_pieces(len(desired), targets)
    return {
        "position": held_channel("position", base[:, :3]),
        "position_target": held_channel("position_target", goal),
        "attitude": held_channel("attitude", base[:, 3:], meaning="root link, quaternion xyzw"),
        "attitude_target": held_channel("attitude_target", turn),
    }


def _contact(rows: dict[str, Floats], names: "_Names") -> dict[str, Channel]:
    """Returns what only contact has: torques, loads, friction use, forces of the ground."""
    if "load" not in rows:
        return {}
    out = {
        "joint_torque": held_channel("joint_torque", rows["torque"], names.joints),
        "joint_command": held_channel("joint_command", rows["asked"], names.joints),
        "joint_rate": held_channel("joint_rate", rows["joint_rate"], names.joints),
        "servo_deflection": held_channel("servo_deflection", rows["deflection"], names.joints),
    }
    spatial = [f"{s}_{axis}" for s in names.screws for axis in "xyz"]
    for name, row, labels, unit, group, meaning in (
        ("screw_torque", "screw_torque", names.screws, "N·m", "screw torque", "of each motor"),
        ("wheel_load", "load", names.screws, "N", "contact", "normal force on each drum"),
        ("cone_use", "cone_use", names.screws, "1", "friction use", "tangential / (μ normal)"),
        ("contact_point", "contact_point", spatial, "m", "contact point", "mean of each drum"),
        ("contact_force", "contact_force", spatial, "N", "contact force", "ground on each drum"),
    ):
        about = {"unit": unit, "group": group, "meaning": meaning}
        out[name] = held_channel(name, rows[row], labels, **about)
    return out


class _Names:
    """Labels of the channels."""

    def __init__(self, robot: Robot) -> None:
        self.screws = [s.joint for s in robot.modules.screws]
        driven = {*yaw_joints(robot), *pitch_joints(robot)}
        self.joints = [n for n in robot.chain_joints if n in driven]
        self.q = configuration_labels(robot)


def configurations(robot: Robot, base: Floats, joints: Floats) -> Floats:
    """Returns q (T, nq) in Pinocchio's order from base poses (T, 7) and joint angles (T, n−1)."""
    out = np.zeros((len(base), robot.model.nq))
    out[:, :7] = base
    for i, name in enumerate(robot.joint_names):
        joint = robot.model.joints[robot.model.getJointId(name)]
        angle = joints[:, i]
        if joint.nq == 2:
            out[:, joint.idx_q], out[:, joint.idx_q + 1] = np.cos(angle), np.sin(angle)
        else:
            out[:, joint.idx_q] = angle
    return out


def _meta(robot: Robot, names: _Names, meta: dict[str, Any]) -> dict[str, Any]:
    """Returns what the log says about the run in addition to its signals."""
    efforts = robot.limits(names.joints)[2]
    softer = dict.fromkeys(pitch_joints(robot), float(meta["compliance"]))
    return {
        "robot": robot.name,
        "version": __version__,
        "weight_n": robot.force_scale,
        "urdf": robot.urdf,
        "urdf_sha256": robot.urdf_hash,
        "limits": {
            "joint_torque": efforts.tolist(),
            "screw_torque": [s.torque for s in robot.modules.screws],
            "screw_rate": rates(robot)[0],
        },
        "joint_servos": declared_servos(robot, names.joints, softer),
        "screw_gain": [s.gain for s in robot.modules.screws],
    } | meta
