"""Flight control: poles and delay margin of each axis, for every gain set and mode."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.control.controller import MODES, flight_controller
from snakegen.control.gains import Floats, gains_from
from snakegen.control.poles import Loop, flight_loops
from snakegen.robot import Robot
from snakegen.rounding import significant

COMMAND = "control"
ORDER = 80
OPTIONS = {
    "delay": [None, "s, from sensing to command; the plant's by default"],
    "lag": [None, "s, of the motors; the rotors' by default"],
}


@dataclass(frozen=True)
class Control:
    """The loops by (gain set, mode); `own` is the set and the mode that the robot flies.

    Attributes:
        loops: by gain set and mode, six axes each.
        own: gain set and mode in use.
        lag, delay: s, that the loops contain.
        rate_filter: Hz, of the low-pass on measured rates that they contain; 0: none.
    """

    loops: dict[tuple[str, str], tuple[Loop, ...]]
    own: tuple[str, str]
    lag: float
    delay: float
    rate_filter: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; a delay margin without end is null."""
        found: dict[str, Any] = {}
        for (gains, mode), loops in self.loops.items():
            found.setdefault(gains, {})[mode] = {
                loop.axis: {
                    "poles_per_s": [  # seven digits: near-double roots are known to √ε
                        significant([p.real, p.imag], 7).tolist() for p in loop.poles
                    ],
                    "stable": loop.stable,
                    "delay_margin_s": None
                    if np.isinf(loop.delay_margin)
                    else float(loop.delay_margin),
                }
                for loop in loops
            }
        return {
            "lag_s": self.lag,
            "delay_s": self.delay,
            "rate_filter_hz": self.rate_filter,
            "gains": self.own[0],
            "mode": self.own[1],
            "loops": found,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people: slowest pole and delay margin of each axis."""
        out = [("motor lag, delay", f"{1e3 * self.lag:.0f} ms, {1e3 * self.delay:.0f} ms")]
        if self.rate_filter > 0.0:
            out.append(("low-pass on rates", f"{self.rate_filter:g} Hz"))
        for (gains, mode), loops in self.loops.items():
            mark = " (flown)" if (gains, mode) == self.own else ""
            out.append((f"gains {gains}{mark}", mode.replace("_", "-")))
            out += [(f"  {loop.axis}", _said(loop)) for loop in loops]
        return out


def _said(loop: Loop) -> str:
    """Returns the slowest or the first unstable pole, and what delay the loop bears."""
    pole = loop.poles[0]
    text = f"{pole.real:+.3g}"  # digits that count: a pole at −0.00017 is slow, not at rest
    if abs(pole.imag) > 1e-6:
        text += f" ± {abs(pole.imag):.3g}j"
    if not loop.stable:
        return f"pole {text} 1/s: UNSTABLE"
    margin = "any delay" if np.isinf(loop.delay_margin) else f"{1e3 * loop.delay_margin:.0f} ms"
    return f"slowest pole {text} 1/s, bears {margin} more"


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def analyze(
    robot: Robot, q: Floats | None = None, delay: float | None = None, lag: float | None = None
) -> Control:
    """Returns the linearised loops of ZN23 eqs 15-28 at hover, whatever the posture q.

    Inertia and allocation cancel the body at hover, so the loops depend on gains, lag and delay
    alone. The plant's own sampling is left out. Without gimbals there is dual-rotor mode alone.
    """
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    slow = max((r.lag for r in rotors), default=0.0) if lag is None else float(lag)
    late = float(robot.modules.plant.get("delay", 0.0)) if delay is None else float(delay)
    control = robot.modules.control
    sets: dict[str, Any] = dict(robot.modules.gain_sets) or {"table 5": {}}
    modes = {m: number for m, number in MODES.items() if robot.gimbal_names or m == "dual_rotor"}
    own = (str(control.get("gains", next(iter(sets)))), str(control.get("mode", next(iter(modes)))))
    found = {}
    for name, values in sets.items():
        gains = gains_from(values)
        for mode, number in modes.items():
            controller = flight_controller(robot, gains, mode=mode)
            found[name, mode] = flight_loops(controller, gains, number, lag=slow, delay=late)
    return Control(found, own, slow, late, float(control.get("rate_filter", 0.0)))
