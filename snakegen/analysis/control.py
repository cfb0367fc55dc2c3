"""Flight control: poles and delay margin of each axis, for every gain set and mode."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.rounding import significant
from snakegen.control.controller import MODES, flight_controller, gain_set
from snakegen.control.gains import Floats
from snakegen.control.poles import Loop, flight_loops
from snakegen.control.switch import mode_refusal
from snakegen.errors import AnalysisError
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot

COMMAND = "control"
ORDER = 80
DEFAULT = "default"  # gains of a robot that names none


@dataclass(frozen=True)
class Control:
    """The loops by (gain set, mode); `own` is the set and the mode that the robot flies.

    Attributes:
        loops: by gain set and mode, six axes each; of the modes that can hold the posture.
        refused: why, by mode that cannot hold it.
        own: gain set and mode in use.
        lag, delay: s, that the loops contain.
        rate_filter: Hz, of the low-pass on measured rates that they contain; 0: none.
    """

    loops: dict[tuple[str, str], tuple[Loop, ...]]
    refused: dict[str, str]
    own: tuple[str, str]
    lag: float
    delay: float
    rate_filter: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; a delay margin above 3 s, or of an axis not flown, is null."""
        found: dict[str, Any] = {}
        for (gains, mode), loops in self.loops.items():
            found.setdefault(gains, {})[mode] = {
                loop.axis: {
                    "poles_per_s": [  # seven digits: near-double roots are known to √ε
                        significant([p.real, p.imag], 7).tolist() for p in loop.poles
                    ],
                    "flown": loop.flown,
                    "stable": loop.stable,
                    "delay_margin_s": float(loop.delay_margin)
                    if loop.flown and np.isfinite(loop.delay_margin)
                    else None,
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
            "uncontrollable": self.refused,
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
        for mode, why in self.refused.items():
            mark = " (flown)" if mode == self.own[1] else ""
            out.append((mode.replace("_", "-") + mark, f"not controllable here: {why}"))
        return out


def _said(loop: Loop) -> str:
    """Returns the slowest or the first unstable pole, and the delay margin of the loop."""
    if not loop.flown:
        return "not controlled: neither gimbals nor the attitude gain act on this axis"
    pole = loop.poles[0]
    text = f"{pole.real:+.3g}"  # digits that count: a pole at −0.00017 is slow, not at rest
    if abs(pole.imag) > 1e-6:
        text += f" ± {abs(pole.imag):.3g}j"
    if not loop.stable:
        return f"pole {text} 1/s: UNSTABLE"
    margin = "above 3 s" if np.isinf(loop.delay_margin) else f"{1e3 * loop.delay_margin:.0f} ms"
    return f"slowest pole {text} 1/s, delay margin {margin}"


def applies(robot: Robot) -> bool:
    """A floating base and rotors."""
    return robot.floating and bool(robot.modules.apparatuses)


def analyze(
    robot: Robot, q: Floats | None = None, delay: float | None = None, lag: float | None = None
) -> Control:
    """Returns the linearised loops of ZN23 eqs 15-28 at hover in the posture q.

    Inertia and allocation cancel the body at hover, so the loops depend on gains, lag, delay and
    on where gimbals can turn a thrust. A mode that cannot hold the posture has none. The plant's
    own sampling is left out. Without gimbals there is dual-rotor mode alone.

    Args:
        robot: with a floating base and rotors.
        q: (nq,) posture; all joints at 0, gimbals up if absent.

    Options:
        delay: s, from sensing to command; the plant's by default
        lag: s, of the motors; the rotors' by default

    Raises:
        AnalysisError: a delay or lag below 0 or not finite.
    """
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    slow = max((r.lag for r in rotors), default=0.0) if lag is None else float(lag)
    late = float(robot.modules.plant.get("delay", 0.0)) if delay is None else float(delay)
    for name, value in (("lag", slow), ("delay", late)):
        if not 0.0 <= value < np.inf:
            raise AnalysisError(f"{name} = {value:g} s: 0 or more is needed.")
    control = robot.modules.control
    names: list[str | None] = [*robot.modules.gain_sets] or [None]
    modes = {m: number for m, number in MODES.items() if robot.gimbal_names or m == "dual_rotor"}
    own = (
        str(control.get("gains", names[0] or DEFAULT)),
        str(control.get("mode", next(iter(modes)))),
    )
    there = hover_gimbals(robot, robot.configuration() if q is None else q)
    angles, (base, _) = robot.angles(there), robot.base_pose(there)
    turns = np.zeros((len(robot.modules.apparatuses), 2))
    for j, bodies in enumerate(zip(robot.gimbals.roll_body, robot.gimbals.pitch_body, strict=True)):
        turns[j] = [angles[b - 1] if b >= 0 else 0.0 for b in bodies]
    found, refused = {}, {}
    for mode, number in modes.items():
        why = mode_refusal(flight_controller(robot, mode=mode), number, angles, base, turns)
        if why:
            refused[mode] = why
    for label in names:
        gains = gain_set(robot, label)
        for mode, number in modes.items():
            if mode not in refused:
                controller = flight_controller(robot, gains, mode=mode)
                loops = flight_loops(controller, gains, number, lag=slow, delay=late, angles=angles)
                found[label or DEFAULT, mode] = loops
    return Control(found, refused, own, slow, late, float(control.get("rate_filter", 0.0)))
