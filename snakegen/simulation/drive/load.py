"""A screw drive under a rising load: a plane that is inclined, or a pull, until it lets go.

The drive holds its place by HA eq 7. It has let go when its head leaves it for good: faster than
2 mm/s from then on, until it is 50 mm away or rolls over.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.robot import GRAVITY
from snakegen.screw_drive.traction_limits import Held, gravity_on
from snakegen.simulation.recording.recording import Recording

AWAY = 0.05  # m, of the head from its place: the run ends
ROLLED = 0.35  # rad, of the root link: the run ends
MOVING = 0.002  # m/s: the head leaves its place
_WINDOW = 0.3  # s, over which that speed is taken
_HELD = 1.0  # s, that it is slower at least where it is held: a slide sticks at times
_REST, _KNEE, _QUICK = 1.0, 0.6, 3.0  # s at rest; share of the prediction reached after `_QUICK`
AGREE = 0.1  # share by which the measured limit may fall short of the figure, or exceed its bound


@dataclass(frozen=True, eq=False)
class GroundLoad:
    """What rises: ``value(t)`` of a slope [rad] or a pull [N] along a direction of the plane.

    Attributes:
        kind: "slope" or "tow".
        direction: (3,) in the plane.
        time, value: knots of the ramp [s; rad or N].
        link, point: where a pull acts; point (3,) m in the link's axes.
    """

    kind: str
    direction: Floats
    time: tuple[float, ...]
    value: tuple[float, ...]
    link: str = ""
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Returns gravity (3,) [m/s²] and pull (3,) [N] at time t [s], axes of the plane."""
        now = float(np.interp(t, self.time, self.value))
        if self.kind == "slope":
            return gravity_on(now, self.direction), np.zeros(3)
        return np.array([0.0, 0.0, -GRAVITY]), now * self.direction


def ramp(figure: float, until: float, slow: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Returns knots of a ramp: rest, quickly to 0.6 of the figure, then to `until` in `slow` s."""
    time = (0.0, _REST, _QUICK, _QUICK + slow)
    return time, (0.0, 0.0, _KNEE * figure, until * figure)


def load_facts(load: GroundLoad, held: Held) -> dict[str, Any]:
    """Returns what the log keeps of a load and its prediction, as JSON."""
    return {
        "load_kind": load.kind,
        "load_direction": [float(x) for x in load.direction],
        "load_time_s": list(load.time),
        "load_value": list(load.value),
        "predicted": held.value,
        "predicted_upper": held.upper if math.isfinite(held.upper) else None,
        "predicted_limits": list(held.at.limits),
    }


def load_metrics(recording: Recording) -> dict[str, Any]:
    """Returns at which load a drive let go, and that over the prediction.

    ``lost`` [rad or N] is None where it held to the end of the ramp: `ratio` is then the largest
    load over the prediction. ``bound_ratio`` is over the bound that no sharing of loads exceeds.
    """
    facts, time = recording.meta["facts"], recording.times("state_error")
    error = recording.channel("state_error").values
    away = np.hypot(error[:, 0], error[:, 1])
    x, y = recording.held("attitude", time[-1:])[0, :2]
    tilt = math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
    reached = lambda t: float(np.interp(t, facts["load_time_s"], facts["load_value"]))  # noqa: E731
    gone = bool(away[-1] > AWAY or tilt > ROLLED)
    last = float(time[-1])
    if gone:
        step = float(time[1] - time[0])
        back = max(1, round(_WINDOW / step))
        speed = np.zeros(len(time))
        speed[back:] = (away[back:] - away[:-back]) / (back * step)
        last = float(time[_last_rest(speed < MOVING, round(_HELD / step))])
    found: dict[str, Any] = {
        "lost": reached(last) if gone else None,
        "lost_s": last if gone else None,
        "ratio": reached(last) / facts["predicted"],
    }
    if facts["predicted_upper"]:
        found["bound_ratio"] = reached(last) / facts["predicted_upper"]
    return found


def _last_rest(slow: Any, least: int) -> int:
    """Returns the last tick of the last rest of `least` ticks or more; 0 where there is none."""
    run, last = 0, 0
    for k, rests in enumerate(slow):
        run = run + 1 if rests else 0
        last = k if run >= least else last
    return last


def load_thresholds(held: Held) -> dict[str, dict[str, Any] | None]:
    """Returns the checks of a run that ends by being lost: tracking is not what it shows."""
    ignored = (
        "distance_excess_m", "distance_rmse_m", "shape_rmse_rad", "tilt_max_rad",
        "slip_mean_m_s", "cone_use_mean", "screw_rate_use", "screw_torque_use",
    )  # fmt: skip
    out: dict[str, dict[str, Any] | None] = dict.fromkeys(ignored)
    out["ratio"] = {"at_least": 1.0 - AGREE}
    if math.isfinite(held.upper):
        out["bound_ratio"] = {"at_most": 1.0 + AGREE}
    return out
