"""Lead an arm's whole body into a hole by its servos, folding outside (beyond ZS24)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from snakegen.analysis import tunnel
from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.inverse_kinematics.body_line import Body, off_line
from snakegen.inverse_kinematics.hole import Hole
from snakegen.inverse_kinematics.motion import Motion, Sampled, checked
from snakegen.inverse_kinematics.path_following import chain_of
from snakegen.robot.robot import Robot, from_urdf_text
from snakegen.simulation.arm.metrics import arm_metrics
from snakegen.simulation.arm.run import ArmGoal, ArmOptions, movable, run_arm
from snakegen.simulation.flight.plan import quintic
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings
from snakegen.statics.tip import find_tip


@dataclass(frozen=True)
class Options(ArmOptions):
    """Options of mission `tunnel`.

    Attributes:
        path: table (CSV, Parquet, YAML) of x,y,z [m] from the base origin: the
            hole's centreline, mouth first
        mouth: x,y,z of a straight hole's mouth, m, in place of a path
        inwards: direction of that hole
        depth: m, of that hole
        room: m, that the body's line may be off the centreline
        duration: s, of the way in
        obstacles: scene file (YAML) of what the body must not touch, m from the base
        opening: obstacle of that scene whose opening or bore is the hole
    """

    path: str | None = None
    mouth: str = "1.25,0.08,0.08"
    inwards: str = "1,0,0"
    depth: float = 0.3
    room: float = 0.01
    duration: float = 20.0
    obstacles: str | None = None
    opening: str | None = None


MARGIN = 0.005  # rad, kept from the limits: a spline swings a little beyond the samples
TIP_BOUND = 1e-3  # m, between tip and centreline


def applies(robot: Robot) -> bool:
    """An arm: a fixed base, and a servo on every joint of the chain."""
    return movable(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Solves the way in, then runs it.

    Raises:
        MissionError: a hole that cannot be entered to its end: how deep it gets, and why.
    """
    duration = options.duration
    if not duration > 0:
        raise MissionError(f"duration {duration:g} s: more than 0 is needed.")
    solved = tunnel.analyze(
        robot,
        robot.configuration(),
        path=options.path,
        mouth=options.mouth,
        inwards=options.inwards,
        depth=options.depth,
        room=options.room,
        margin=MARGIN,
        obstacles=options.obstacles or (),
        opening=options.opening,
    )
    if not solved.complete:
        raise MissionError(f"{robot.name}: {solved.why}.")
    entry, hole = solved.entry, solved.hole
    spline = CubicSpline(entry.depth, entry.angles)
    bend, curve = spline.derivative(), spline.derivative(2)

    def at(when: Floats) -> Sampled:
        f, df, ddf = (entry.whole * x for x in quintic(when / duration))
        rate, gain = (df / duration)[:, None], (ddf / duration**2)[:, None]
        return spline(f), bend(f) * rate, curve(f) * rate**2 + bend(f) * gain

    def target(when: Floats) -> Floats:
        return np.array([hole.at(entry.whole * float(quintic(t / duration)[0])) for t in when])

    return run_arm(
        robot,
        checked(robot, Motion("tunnel", solved.joints, duration, at)),
        mission="tunnel",
        options=options,
        settings=settings,
        goal=ArmGoal(
            tip=find_tip(robot),
            target=target,
            bound=TIP_BOUND,
            thresholds={"body_off_max_m": {"at_most": options.room}},
            facts={
                "centreline_m": hole.points.tolist(),
                "room_m": hole.room,
                "planned_body_off_max_m": float(entry.between),
            },
        ),
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns the three torques' gaps, and how far the body was off the centreline as it moved."""
    robot = from_urdf_text(recording.meta["urdf"], None, checked=True)
    facts, names = recording.meta["facts"], recording.channel("joint_angle").labels
    hole = Hole(np.array(facts["centreline_m"]), facts["room_m"])
    body = Body(chain_of(robot, robot.configuration(), find_tip(robot)), 1)
    index = [robot.joint_names.index(n) for n in names]
    target = recording.channel("position_target").values
    off = []
    for k in range(0, len(target), 10):
        full = np.zeros(len(robot.joint_names))
        full[index] = recording.channel("joint_angle").values[k]
        depth = float(hole.nearest(target[k : k + 1])[2][0])
        off.append(off_line(body, body.places(full, np.zeros(3)), hole, depth))
    inside, wall = np.max(off, axis=0)
    kept = {"planned_body_off_max_m": facts["planned_body_off_max_m"]}
    return (
        arm_metrics(recording)
        | {"body_off_max_m": float(inside), "body_in_wall_max_m": float(wall)}
        | kept
    )
