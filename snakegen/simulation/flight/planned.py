"""Plans of `snakegen plan` as references of a flight: the spline of a mission file by ticks."""

from typing import Any

import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats
from snakegen.base.sample_store import in_pieces
from snakegen.errors import MissionError
from snakegen.planning.body import attitude
from snakegen.planning.hover_actuation import HELD
from snakegen.planning.plan_file import PlanFile, read_plan
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.memory_check import refuse_too_long
from snakegen.simulation.flight.plan import Plan, ticks
from snakegen.simulation.flight.postures import driven_joints, place

HOLD = HELD  # s, of hover before and after the motion
SHARE = 0.5  # of the proved clearance that the flight must keep
KIND = "plan"  # of the tracking bounds (`flight_bounds.TABLES`)


def planned_flight(
    robot: Robot, data: dict[str, Any], where: str, rate: float, duration: float | None
) -> Plan:
    """Returns the references of a plan's content: a hover, its motion, a hover.

    Raises:
        MissionError: joints that the robot does not have, or a plan that is too long.
    """
    file = read_plan(data, where)
    names = driven_joints(robot)
    if list(file.names) != names:
        raise MissionError(
            f"{where} is a plan for {file.robot} with joints {', '.join(file.names)}; {robot.name} "
            f"has {', '.join(names)}."
        )
    return flight_of(robot, file, rate, duration)


def flight_of(robot: Robot, file: PlanFile, rate: float, duration: float | None = None) -> Plan:
    """Returns the references of a plan: a hover, its motion, a hover."""
    seconds = 2.0 * HOLD + float(file.path.times[-1]) if duration is None else duration
    refuse_too_long(robot, seconds)
    time = ticks(seconds, rate)
    return follow(
        robot,
        file.path,
        time,
        time - HOLD,
        obstacles=file.solids,
        rate_filter=min(file.rate_filter, 0.25 * rate),
        settling=file.settling,
        **_judged(file),
    )


def follow(robot: Robot, path: Trajectory, time: Floats, at: Floats, **more: Any) -> Plan:
    """Returns references along `path`, at its own times `at` (T,) for the plan's `time` (T,)."""
    first = path.at(at[:1])[0]
    turn = attitude(np.zeros(3), path.heading).T  # from exp(r)'s axes to the link's

    def rows(part: slice) -> tuple[Floats, ...]:
        pose, speed, bend = (path.at(at[part], order) for order in (0, 1, 2))
        spun = [turn @ (pin.Jexp3(r) @ d) for r, d in zip(pose[:, 3:6], speed[:, 3:6], strict=True)]
        turned = np.array([attitude(r, path.heading) for r in pose[:, 3:6]])
        return pose[:, :3], speed[:, :3], bend[:, :3], turned, np.array(spun), pose[:, 6:]

    start = place(robot, first[6:], first[:3], attitude(first[3:6], path.heading))
    position, speed, bend, turned, spun, joints = in_pieces(len(time), rows)
    return Plan(time, position, speed, bend, turned, spun, joints, start, **more)


def _judged(file: PlanFile) -> dict[str, Any]:
    """Returns events, facts and thresholds of a plan's flight."""
    end = float(file.path.times[-1])
    events = [(HOLD, "motion begins"), (HOLD + end, "motion ends")]
    facts: dict[str, Any] = {"planned_motion_s": end, "integral_settling_s": file.settling}
    if file.settling > 0.0:
        events.append((HOLD, f"integrals settle in {file.settling:g} s along the motion"))
    thresholds: dict[str, dict[str, Any] | None] = {}
    proved = file.certificate or {}
    if proved and file.solids:
        facts["certificate"] = proved
        for key, found in proved.items():
            if isinstance(found, dict):
                name = key.rpartition("_")[0].replace("_", " ")
                events.append((HOLD + float(found["time_s"]), f"least {name} of the plan"))
        least = float(proved["clearance_m"]["lower_bound"])
        thresholds["min_obstacle_distance_m"] = {"at_least": round(SHARE * least, 6)}
    return {
        "events": tuple(sorted(events)),
        "facts": facts,
        "thresholds": thresholds,
        "kind": KIND,
    }
