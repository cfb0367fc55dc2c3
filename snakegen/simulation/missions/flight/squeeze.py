"""Squeeze through an opening narrower than the robot (ZN23 Fig 10).

The body rises through the opening of the shipped ceiling, link by link, as `snakegen plan` plans
it. With `doorway`, `gap` or `speed`, or a body that is not planned for (dual-rotor mode, limited
gimbals), it turns slim and flies straight through a doorway with a lintel, whose opening is
measured from the slim body.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import MissionError, PlanError
from snakegen.planning.body import check_robot
from snakegen.planning.motion_search import search
from snakegen.robot.robot import Robot
from snakegen.scene.schema import read_scene
from snakegen.simulation.flight.plan import Box, Plan, holding, knots_for, through, ticks
from snakegen.simulation.flight.planned import flight_of
from snakegen.simulation.flight.postures import bent, driven_joints, extent, place, slim
from snakegen.simulation.flight.trim import TrimOption
from snakegen.spec.loading import templates_folder


@dataclass(frozen=True)
class Options(TrimOption):
    """Options of mission `squeeze`.

    Attributes:
        doorway: fly slim through a doorway, not link by link through a ceiling
        gap: m, room on each side of the slim body in the doorway; 0.12 by default
        speed: m/s, mean, through the doorway; 0.4 by default
        rate_limit: rad/s, fastest joint
    """

    doorway: bool = False
    gap: float | None = None
    speed: float | None = None
    rate_limit: float = 0.31


_GAP, _SPEED = 0.12, 0.4  # m, m/s
_MINUTES = 10.0  # of the search at most; it takes some 10 s


_SETTLE = 2.0  # s, of hover between the parts
_WALL = 0.05  # m, half its thickness
_WIDE = 1.2  # m, half width of the wall: wide enough to meet, narrow enough to see past


def applies(robot: Robot) -> bool:
    """A floating base, rotors and at least two driven joints."""
    return robot.floating and bool(robot.modules.apparatuses) and len(driven_joints(robot)) > 1


def plan(robot: Robot, rate: float, options: Options) -> Plan:
    """Returns the plan: fold from the resting to the slim body, pass the wall, unfold.

    Raises:
        MissionError: the opening would be wider than the resting body, or options not positive.
    """
    given = options.gap is not None or options.speed is not None
    if not (options.doorway or given) and plannable(robot):
        return _through_ceiling(robot, rate, options.rate_limit)
    gap = _GAP if options.gap is None else options.gap
    speed = _SPEED if options.speed is None else options.speed
    for name, value in (("gap", gap), ("speed", speed), ("rate_limit", options.rate_limit)):
        if not value > 0:
            raise MissionError(f"{name} {value:g}: more than 0 is needed.")
    wide, narrow = bent(robot), slim(robot)
    big, small = extent(robot, wide), extent(robot, narrow)
    opening = 2.0 * (gap + float(np.abs(small[:, 1]).max()))
    span = float(big[1, 1] - big[0, 1])
    if opening >= span:
        raise MissionError(
            f"the opening of {opening:.2f} m would be wider than {robot.name} ({span:.2f} m); "
            "a smaller gap is needed."
        )
    height = 0.4 + float(max(-small[0, 2], -big[0, 2]))
    lintel = height + float(small[1, 2]) + gap
    start, end = _run_up(big, small, gap)
    fold = knots_for(np.array([wide, narrow]), options.rate_limit, start=_SETTLE)
    go = float(fold[1]) + _SETTLE
    through_at = go + (end - start) / speed
    unfold = knots_for(np.array([narrow, wide]), options.rate_limit, start=through_at + _SETTLE)
    time = ticks(float(unfold[1]) + _SETTLE, rate)
    joints, _, _ = through(time, [*fold, *unfold], np.array([wide, narrow, narrow, wide]))
    way = np.array([[start, 0.0, height], [end, 0.0, height]])
    position, velocity, acceleration = through(time, [go, through_at], way)
    return holding(
        time,
        joints,
        place(robot, wide, way[0]),
        way[0],
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        obstacles=_wall(opening, lintel),
        events=(
            (float(fold[0]), "fold"),
            (go, f"through an opening of {opening:.2f} m, {span:.2f} m wide before"),
            (float(unfold[0]), "unfold"),
        ),
        facts={"opening_m": opening, "span_m": span, "lintel_m": lintel},
        thresholds={"min_obstacle_distance_m": {"at_least": 0.01}},
    )


def plannable(robot: Robot) -> bool:
    """Tells whether motions of `robot` can be certified."""
    try:
        check_robot(robot)
    except PlanError:
        return False
    return True


def _through_ceiling(robot: Robot, rate: float, rate_limit: float) -> Plan:
    """Returns the flight of a plan through the shipped ceiling.

    Raises:
        PlanError: no motion for this body could be certified.
    """
    scene = read_scene(templates_folder() / "scenes" / "ceiling.yaml")
    scene = replace(scene, demands=replace(scene.demands, joint_rate=rate_limit))
    motion = search(robot, scene, minutes=_MINUTES)
    unmet = motion.unmet(scene.demands)
    if unmet:
        raise PlanError(f"no certified way through the ceiling: {'; '.join(unmet)}.")
    plan = flight_of(robot, motion.file(scene), rate)
    low, high = body_extent(robot)
    opening = float(max(scene.openings[0].size))
    return replace(plan, facts=plan.facts | {"opening_m": opening, "span_m": max(high - low)})


def body_extent(robot: Robot) -> tuple[Floats, Floats]:
    """Returns the least and greatest x and y (2,) [m] of the resting body."""
    found = extent(robot, bent(robot))
    return found[0, :2], found[1, :2]


def _run_up(big: Floats, small: Floats, gap: float) -> tuple[float, float]:
    """Returns CoG x before and behind the wall [m], so that both bodies stand clear of it."""
    ahead = max(float(big[1, 0]), float(small[1, 0]))
    behind = max(-float(big[0, 0]), -float(small[0, 0]))
    return -(ahead + _WALL + gap + 0.1), behind + _WALL + gap + 0.1


def _wall(opening: float, lintel: float) -> tuple[Box, ...]:
    """Returns two posts and the lintel over them; floor to well above the robot."""
    half = 0.25 * (2.0 * _WIDE - opening)
    middle, top = 0.5 * opening + half, lintel + 0.3
    return (
        Box("post_left", (0.0, middle, 0.5 * top), (_WALL, half, 0.5 * top)),
        Box("post_right", (0.0, -middle, 0.5 * top), (_WALL, half, 0.5 * top)),
        Box("lintel", (0.0, 0.0, 0.5 * (lintel + top)), (_WALL, 0.5 * opening, 0.15)),
    )


def metrics(recording: Any) -> dict[str, Any]:
    """Returns the opening and how much wider the resting body is."""
    facts = recording.meta["facts"]
    return {
        "opening_m": facts["opening_m"],
        "span_over_opening": facts["span_m"] / facts["opening_m"],
    }
