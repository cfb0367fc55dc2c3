"""Drive round a square with heading and shape held, sideways too (HA section V, Fig 11)."""

from typing import Any

from snakegen.robot.robot import Robot
from snakegen.screw_drive.geometry import yaw_joints
from snakegen.screw_drive.ground_paths import square
from snakegen.simulation.drive.plan import COMMON, DrivePlan, can_drive, lasting, time_law
from snakegen.simulation.drive.record import drive
from snakegen.simulation.recording.recording import Recording

OPTIONS: dict[str, list[Any]] = COMMON | {
    "side": [1.2, "m"],
    "speed": [0.2, "m/s"],
}


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(
    robot: Robot, *, seed: int, ideal: bool, options: dict[str, Any], progress: Any
) -> Recording:
    """Drives the mission and returns the judged recording; position is fed back, shape is not."""
    o = {k: v[0] for k, v in OPTIONS.items()} | options
    law = time_law(o["side"], o["speed"], o["acceleration"])
    joints = len(yaw_joints(robot))
    reference = square(o["side"], law.speed, law.acceleration, joints)
    k = float(o["gain"])
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(o, reference.duration + 1.0),
        (k, k, k, *[0.0] * joints),
        o["feedback"],
        events=tuple((i * law.duration, f"corner {i}") for i in range(1, 5)),
        thresholds={"distance_rmse_m": {"at_most": 0.012}},
    )
    how = {"plant": o["plant"], "seed": seed, "ideal": ideal, "progress": progress}
    return drive(robot, "square", plan, **how)
