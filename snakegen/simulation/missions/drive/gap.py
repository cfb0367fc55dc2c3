"""Drive through a duct no wider than the body, its ceiling touching, and compare with open ground.

A snake that undulates needs room beside it; drums do not. Wheels that touch walls and ceiling roll
there too: straight ahead, their no-slip conditions are those of the ground.
"""

from typing import Any

from snakegen.robot.robot import Robot
from snakegen.simulation.drive.plan import COMMON, DrivePlan, can_drive, following, lasting
from snakegen.simulation.drive.record import PASSAGE, beside_open_ground, drive
from snakegen.simulation.obstacles import duct
from snakegen.simulation.recording.recording import Recording

OPTIONS: dict[str, list[Any]] = COMMON | {
    "side": [0.0, "m, room on each side of the drums"],
    "above": [-0.0005, "m, room over the drums; less than 0: the ceiling presses on them"],
    "entry": [0.25, "m ahead of the head, where the duct begins"],
    "length": [1.2, "m, of the duct"],
}


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def fly(
    robot: Robot, *, seed: int, ideal: bool, options: dict[str, Any], progress: Any
) -> Recording:
    """Drives open ground first, then the duct, and returns the judged recording of the latter."""
    o = {k: v[0] for k, v in OPTIONS.items()} | options
    body = sum(robot.modules.lengths.values())
    path = [("line", o["entry"] + o["length"] + body + 0.1)]
    reference = following(robot, path, o["speed"], o["acceleration"])
    width = 2.0 * (robot.modules.screws[0].radius + o["side"])
    height = 2.0 * robot.modules.screws[0].radius + o["above"]
    span = (o["entry"], o["entry"] + o["length"])
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(o, reference.duration + 1.0),
        o["gain"],
        o["feedback"],
        obstacles=duct(span, width, height),
        events=((0.0, f"a duct {width:.3f} m wide and {height:.3f} m high lies ahead"),),
        facts={"width_m": width, "height_m": height},
        thresholds=PASSAGE | {"distance_end_m": {"at_most": 0.01}},
    )
    how: dict[str, Any] = {"plant": o["plant"], "seed": seed, "ideal": ideal}
    open_plan = DrivePlan(reference, plan.start, plan.duration, plan.gain, plan.feedback)
    free = drive(robot, "gap", open_plan, **how).metrics
    return drive(robot, "gap", plan, progress=progress, more=beside_open_ground(free), **how)
