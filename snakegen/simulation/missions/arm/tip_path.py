"""An arm's tip along a path: inverse kinematics in closed loop, then the servos."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from snakegen.analysis import reach
from snakegen.errors import MissionError
from snakegen.inverse_kinematics.motion import Motion, Sampled, checked
from snakegen.inverse_kinematics.tip_paths import port_of
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.metrics import arm_metrics
from snakegen.simulation.arm.run import ArmGoal, ArmOptions, movable, run_arm
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings
from snakegen.statics.tip import find_tip


@dataclass(frozen=True)
class Options(ArmOptions):
    """Options of mission `tip_path`.

    Attributes:
        path: table (CSV, Parquet, YAML) of x,y,z [m] from the base origin, a row
            every dt; or as `reach` has it
        radius: m, of the circle
        depth: m, how far the tip goes in through the port
        duration: s, of the way in or once round the circle
        dt: s, between rows of the path
        port: x,y,z,ax,ay,az,radius: an opening that the body must pass
    """

    path: str | None = None
    radius: float = 0.05
    depth: float = 0.2
    duration: float = 10.0
    dt: float = 0.01
    port: str | None = None


MARGIN = 0.005  # rad, kept from the limits: a spline swings a little beyond the samples
PORT_RATE = 0.5  # rad/s, of joints that make room in the port: half of what servos do
TIP_BOUND = 1e-3  # m, between tip and path: ten times what the inverse kinematics leaves


def applies(robot: Robot) -> bool:
    """An arm: a fixed base, and a servo on every joint of the chain."""
    return movable(robot)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Solves the path for the joints, then runs them.

    Raises:
        MissionError: a path that cannot be followed to its end: how far it gets, and why.
    """
    dt = options.dt
    solved = reach.analyze(
        robot,
        robot.configuration(),
        path=options.path,
        radius=options.radius,
        depth=options.depth,
        duration=options.duration,
        margin=MARGIN,
        options=reach.Options(dt, port=port_of(options.port), port_rate=PORT_RATE),
    )
    track = solved.track
    if track is None or not track.complete:
        raise MissionError(f"{robot.name}: {solved.why}.")
    time = dt * np.arange(len(track.angles))
    spline = CubicSpline(time, track.angles)
    rate, bend = spline.derivative(), spline.derivative(2)

    def at(when: np.ndarray[Any, np.dtype[np.float64]]) -> Sampled:
        return np.asarray(spline(when)), np.asarray(rate(when)), np.asarray(bend(when))

    motion = checked(robot, Motion("tip_path", solved.joints, float(time[-1]), at))
    target = CubicSpline(time, solved.path)
    facts = {
        "ik_error_max_m": float(track.error.max()),
        "path_length_m": track.whole,
        "port_clearance_m": track.clearance if np.isfinite(track.clearance) else None,
    }
    return run_arm(
        robot,
        motion,
        mission="tip_path",
        options=options,
        settings=settings,
        goal=ArmGoal(
            tip=find_tip(robot),
            target=lambda when: np.asarray(target(when)),
            # Where the body begins to make room in a port, joints start at once: the servos' torque
            # is then right for the motion made, not at once for the one asked for.
            bound=TIP_BOUND,
            thresholds={
                "port_clearance_m": {"at_least": solved.thickest} if options.port else None,
                "torque_gap_share": None if options.port else {"at_most": 0.01},
            },
            facts=facts,
        ),
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the three torques are apart, and what the inverse kinematics left."""
    facts = recording.meta["facts"]
    kept = ("ik_error_max_m", "port_clearance_m")
    return arm_metrics(recording) | {k: facts[k] for k in kept if facts.get(k) is not None}
