"""Whether a run's samples fit into memory, checked before it begins."""

from snakegen.base.memory import refuse_beyond, room
from snakegen.robot.robot import Robot
from snakegen.simulation.run_settings import ARM_STEP

# Peak bytes a tick and degree of freedom of an arm's run, which is held whole, from plan to written
# log: 132 measured of arm6.
BYTES = 400
# Bytes a tick of a flight or drive, which is recorded piece by piece: times, and what planning and
# judging take of a column.
STREAMED = 400


def refuse_too_long(robot: Robot, seconds: float, at_once: int = 1) -> None:
    """Refuses a run whose samples would not fit into memory.

    Args:
        robot: that flies, drives or moves.
        seconds: s, its duration; what is no duration is left to the mission.
        at_once: runs side by side.

    Raises:
        AnalysisError: too long, with what would fit.
    """
    if not seconds > 0:
        return
    rate = (
        float(robot.modules.control.get("attitude_rate", 200.0)) if robot.floating else 1 / ARM_STEP
    )
    freedoms = 6 + len(robot.chain_joints) + len(robot.gimbal_names) + len(robot.modules.screws)
    second = (STREAMED if robot.floating else BYTES * freedoms) * rate * at_once
    fits = int(0.9 * room() / second)  # by the time it is tried less may be free
    side_by_side = f", {at_once} side by side," if at_once > 1 else ""
    refuse_beyond(
        second * seconds,
        f"{robot.name}: a run of {seconds:g} s{side_by_side}",
        f"a duration of {fits} s would fit" if fits > 0 else "a shorter chain would",
    )
