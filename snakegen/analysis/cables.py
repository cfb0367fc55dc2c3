"""Cables: the tensions that hold a posture, and whether a routing can (ZS24 section 2).

Three or more cables a segment; those of far segments run through the near ones and load them too.
The paper prints neither radius nor phase: both are parameters.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.errors import AnalysisError
from snakegen.files import require_suffix
from snakegen.geometry import Floats
from snakegen.kernels.cables import back_substitute, balance, lengths_and_rates
from snakegen.kinetostatics.cabled import HELD_ACCELERATION, HELD_DRIFT, Held, hold_in_mujoco
from snakegen.kinetostatics.law import DOWN, Wrenches, finite, joint_torques
from snakegen.kinetostatics.routing import Routing, route
from snakegen.robot import Robot

__all__ = ["CablesResult", "Routing", "analyze", "applies", "route"]

COMMAND = "cables"
ORDER = 75
EXAMPLE = "arm6 --joint joint3_yaw=0.4 --mjcf arm6_cables.xml"
OPTIONS = {
    "count": [3, "cables a segment, three or more"],
    "radius": [0.03, "m, of the circle of holes"],
    "phase": [0.0, "rad, of the first hole from y towards z"],
    "standoff": [0.02, "m, from a joint to the holes on either side"],
    "sheathed": [False, "cables start at their own joint instead of running through all before"],
    "minimum": [5.0, "N, least tension"],
    "maximum": [None, "N, highest tension; none by default"],
    "wrenches": [None, 'loads, as in "link4=0,0,-5,0,0,0": [force; torque] at a link, world axes'],
    "gravity": ["0,0,-9.81", "m/s², world; 0,0,0 for none"],
    "mjcf": [None, "MJCF to write: the cables as tendons with winches, in place of the servos"],
    "stiffness": [50000.0, "N/m, of a cable with its winch, in that MJCF"],
}


@dataclass(frozen=True)
class CablesResult:
    """Tensions that hold a posture.

    Attributes:
        names: (c,) cables, ``cable{segment}_{number}``.
        tension: (c,) N.
        length: (c,) m, along the holes.
        joints: (n,) chain joints.
        arms: (n, c) m, ``A = -(∂l/∂θ)ᵀ``.
        torque: (n,) N m, wanted of the cables.
        shortage: (n,) N m, what they leave; all zero where the posture is held.
        method: ``back-substitution`` or, where that fails, ``all segments at once``.
        why: one sentence.
        routing: what `route` was given, its keys with units, and whether all of it is assumed;
            empty for a routing of one's own.
        mjcf: the MJCF written, "" if none; `held`: what MuJoCo says of it.
    """

    names: tuple[str, ...]
    tension: Floats
    length: Floats
    joints: tuple[str, ...]
    arms: Floats
    torque: Floats
    shortage: Floats
    method: str
    why: str
    routing: dict[str, Any]
    mjcf: str = ""
    held: Held | None = None

    @property
    def feasible(self) -> bool:
        """Tells whether the cables hold the posture."""
        return bool(_balanced(self.shortage, self.torque))

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people: tensions segment by segment."""
        out = [("routing", _routing_words(self.routing)), ("cables", self.why)]
        parts: dict[str, list[float]] = {}
        for name, t in zip(self.names, self.tension, strict=True):
            parts.setdefault(name.split("_")[0].replace("cable", "segment "), []).append(t)
        out += [(k, " ".join(f"{t:.4g}" for t in ts) + " N") for k, ts in parts.items()]
        if self.held is not None:
            out.append(("mjcf", f"{self.mjcf}: {len(self.names)} tendons, keyframe 'held'"))
            out.append(("in MuJoCo", self._held_words(self.held)))
        return out

    def _held_words(self, held: Held) -> str:
        """Returns what became of the posture in MuJoCo."""
        gap = max(abs(held.torque[n] - t) for n, t in zip(self.joints, self.torque, strict=True))
        good = held.drift <= HELD_DRIFT and held.acceleration <= HELD_ACCELERATION
        return (
            f"{'held' if good else 'NOT held'}: torques {gap:.1e} N·m off, {held.drift:.1e} rad "
            f"of drift in {held.seconds:g} s"
        )

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        return {
            "routing": self.routing or None,
            "feasible": self.feasible,
            "why": self.why,
            "method": self.method,
            "tension_N": dict(zip(self.names, self.tension.tolist(), strict=True)),
            "length_m": dict(zip(self.names, self.length.tolist(), strict=True)),
            "torque_Nm": dict(zip(self.joints, self.torque.tolist(), strict=True)),
            "shortage_Nm": dict(zip(self.joints, self.shortage.tolist(), strict=True)),
            "arms_m": self.arms.tolist(),
        } | (
            {}
            if self.held is None
            else {"mjcf": self.mjcf, "in_mujoco": self._held_json(self.held)}
        )

    def _held_json(self, held: Held) -> dict[str, Any]:
        good = held.drift <= HELD_DRIFT and held.acceleration <= HELD_ACCELERATION
        return {
            "held": good,
            "acceleration_max_rad_s2": held.acceleration,
            "torque_Nm": held.torque,
            "drift_max_rad": held.drift,
            "seconds": held.seconds,
            "tension_end_N": dict(zip(self.names, held.tension.tolist(), strict=True)),
        }


def applies(robot: Robot) -> bool:
    """An arm: a chain on a fixed base."""
    return not robot.floating and len(robot.chain_joints) > 0


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    routing: Routing | None = None,
    torque: ArrayLike | None = None,
    wrenches: Wrenches = None,
    gravity: ArrayLike = DOWN,
    minimum: float = 5.0,
    maximum: float | str | None = None,
    count: int = 3,
    radius: float = 0.03,
    phase: float = 0.0,
    standoff: float = 0.02,
    sheathed: bool = False,
    mjcf: str | Path | None = None,
    stiffness: float = 5e4,
) -> CablesResult:
    """Returns the least cable tensions that give the joints the torques that a posture needs.

    Args:
        robot: an arm.
        q: (nq,) posture.
        routing: from `route`; made from `count` … `sheathed` if absent.
        torque: (n,) N m of the chain joints; the static ones of gravity and `wrenches` if absent.
        wrenches, gravity: as in `joint_torques`.
        minimum, maximum: N, tension limits.
        count, radius, phase, standoff, sheathed: as in `route`; sheathed is not coupled.
        mjcf: file to write with the cables as tendons; MuJoCo is then asked whether they hold.
        stiffness: N/m, of a cable with its winch, in that file.

    Raises:
        AnalysisError: not an arm, wrong shapes, NaN, minimum above maximum; an MJCF asked for
            where the cables do not hold the posture, or for loads that it does not have.
    """
    if not applies(robot):
        raise AnalysisError(f"{robot.name} is not an arm on a fixed base: cables are for those.")
    if mjcf is not None:
        require_suffix(mjcf, ".xml")
    most = _most(maximum)
    if not 0 <= minimum <= most or not np.isfinite(minimum):
        raise AnalysisError(f"tensions {minimum:g} … {most:g} N are no range above 0.")
    q = robot.check_q(q)
    how: dict[str, Any] = {}
    if routing is None:
        sizes: dict[str, Any] = {
            "count": count,
            "radius": radius,
            "phase": phase,
            "standoff": standoff,
            "coupled": not sheathed,
        }
        routing, how = route(robot, **sizes), _routing_said(sizes)
    names = [n for group in routing.segments for n in group]
    index = np.array([robot.body_of_joint(n) - 1 for n in names], int)
    if torque is None:
        static = joint_torques(robot, q, wrenches=wrenches, gravity=gravity, terms="static")
        wanted = np.asarray(static[index])
    else:
        wanted = finite(torque, (len(index),), "torque")
    base = robot.base_pose(q)[0]
    length, rates = lengths_and_rates(robot.tree, base, robot.angles(q), routing.holes)
    arms = -rates[:, index].T
    ends = np.cumsum([len(g) for g in routing.segments])
    rows = [np.arange(e - len(g), e) for e, g in zip(ends, routing.segments, strict=True)]
    method = "back-substitution"
    t, short = back_substitute(arms, wanted, rows, list(routing.columns), minimum, most)
    if not _balanced(short, wanted) and routing.coupled:
        # Least tensions beyond may be the wrong ones for the segments before: ask all at once.
        together, left = balance(arms, wanted, minimum, most)
        if np.sum(np.abs(left)) < np.sum(np.abs(short)):
            t, short, method = together, left, "all segments at once"
    result = CablesResult(
        routing.names, t, length, tuple(names), arms, wanted, short, method,
        _why(names, short, wanted, t, routing.names, most), how,
    )  # fmt: skip
    if mjcf is None:
        return result
    if wrenches or torque is not None:
        raise AnalysisError("an MJCF has no loads of its own: ask for it without wrenches, torque.")
    if not result.feasible:
        raise AnalysisError(f"{robot.name}: {result.why}; no MJCF of that was written.")
    held = hold_in_mujoco(
        Path(mjcf), robot, q, routing, t, length, most, finite(gravity, (3,), "gravity"),
        stiffness,
    )  # fmt: skip
    return replace(result, mjcf=str(mjcf), held=held)


def _routing_said(sizes: dict[str, Any]) -> dict[str, Any]:
    """Returns a routing's sizes, and whether nobody gave any: the robot's file names no cables."""
    return {
        "assumed": sizes == route.__kwdefaults__,
        "cables_per_segment": sizes["count"],
        "radius_m": sizes["radius"],
        "phase_rad": sizes["phase"],
        "standoff_m": sizes["standoff"],
        "sheathed": not sizes["coupled"],
    }


def _routing_words(routing: dict[str, Any]) -> str:
    """Returns the routing for people: ``assumed routing: 3 a segment at 30 mm …``."""
    if not routing:
        return "as given"
    said = "assumed routing: " if routing["assumed"] else ""
    run = "sheathed up to their segment" if routing["sheathed"] else "through the segments before"
    return (
        f"{said}{routing['cables_per_segment']} a segment at {1e3 * routing['radius_m']:g} mm, "
        f"holes {1e3 * routing['standoff_m']:g} mm either side of a joint, {run}"
    )


def _most(maximum: float | str | None) -> float:
    """Returns the highest tension [N], which the command line gives as text."""
    try:
        most = np.inf if maximum is None else float(maximum)
    except ValueError:
        most = np.nan
    if np.isnan(most):
        raise AnalysisError(f"maximum: '{maximum}' is no tension in N.")
    return most


def _balanced(shortage: Floats, torque: Floats) -> bool:
    """Tells whether what is left is the solver's rounding only."""
    return bool(np.max(np.abs(shortage)) <= 1e-7 * max(1.0, float(np.max(np.abs(torque)))))


def _why(
    joints: list[str],
    shortage: Floats,
    torque: Floats,
    tension: Floats,
    cables: tuple[str, ...],
    maximum: float,
) -> str:
    """Returns one sentence: the highest tension, or the joint that lacks most and by how much."""
    if _balanced(shortage, torque):
        i = int(np.argmax(tension))
        return f"held; the highest tension is {tension[i]:.4g} N in {cables[i]}"
    i = int(np.argmax(np.abs(shortage)))
    others = int(np.sum(np.abs(shortage) > 1e-7)) - 1
    cap = f" within {maximum:g} N" if np.isfinite(maximum) else ""
    more = f" ({others} more joints lack some)" if others else ""
    return (
        f"not held{cap}: {joints[i]} needs {torque[i]:.4g} N·m and lacks "
        f"{abs(shortage[i]):.4g} N·m{more}"
    )
