"""An arm's tip along a path: inverse kinematics in closed loop, then the servos."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from snakegen.analysis import reach
from snakegen.errors import MissionError
from snakegen.inverse_kinematics.motion import Motion, Sampled, checked
from snakegen.inverse_kinematics.tip_paths import port_of
from snakegen.robot.robot import Robot
from snakegen.simulation.arm.run import arm_metrics, movable, run_arm, with_defaults
from snakegen.simulation.recording.recording import Recording
from snakegen.statics.tip import find_tip

OPTIONS = {
    "path": [None, "CSV of x,y,z [m] from the base origin, a row every dt; or as `reach` has it"],
    "radius": [0.05, "m, of the circle"],
    "depth": [0.2, "m, how far the tip goes in through the port"],
    "duration": [10.0, "s, of the way in or once round the circle"],
    "dt": [0.01, "s, between rows of the path"],
    "port": [None, "x,y,z,ax,ay,az,radius: an opening that the body must pass"],
    "gravity": ["0,0,-9.81", "m/s², world"],
    "lead": ["law", "what servos get beside the angle: none, speed, or law (speed and torque)"],
    "friction": [
        None,
        "static,sliding of every joint in N m, as in 0.1,0.06; else the servos' own",
    ],
}
MARGIN = 0.005  # rad, kept from the limits: a spline swings a little beyond the samples
PORT_RATE = 0.5  # rad/s, of joints that make room in the port: half of what servos do
TIP_BOUND = 1e-3  # m, between tip and path: ten times what the inverse kinematics leaves


def applies(robot: Robot) -> bool:
    """An arm: a fixed base, and a servo on every joint of the chain."""
    return movable(robot)


def fly(
    robot: Robot,
    *,
    seed: int = 0,
    ideal: bool = False,
    options: dict[str, Any] | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> Recording:
    """Solves the path for the joints, then runs them.

    Raises:
        MissionError: a path that cannot be followed to its end: how far it gets, and why.
    """
    given = with_defaults(OPTIONS, options)
    dt = float(given["dt"])
    solved = reach.analyze(
        robot,
        robot.configuration(),
        path=given["path"],
        radius=float(given["radius"]),
        depth=float(given["depth"]),
        duration=float(given["duration"]),
        margin=MARGIN,
        options=reach.Options(dt, port=port_of(given["port"]), port_rate=PORT_RATE),
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
        seed=seed,
        ideal=ideal,
        options=given,
        tip=find_tip(robot),
        tip_target=lambda when: np.asarray(target(when)),
        # Where the body begins to make room in a port, joints start at once: the servos' torque
        # is then right for the motion made, not at once for the one asked for.
        tip_bound=TIP_BOUND,
        thresholds={
            "port_clearance_m": {"at_least": 0.0} if given["port"] else None,
            "torque_gap_share": None if given["port"] else {"at_most": 0.01},
        },
        facts=facts,
        progress=progress,
    )


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns how far the three torques are apart, and what the inverse kinematics left."""
    facts = recording.meta["facts"]
    kept = ("ik_error_max_m", "port_clearance_m")
    return arm_metrics(recording) | {k: facts[k] for k in kept if facts.get(k) is not None}
