"""Feasible-wrench margins of both modes: how much the body resists, where it is weakest, and why."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.analysis.allocation import allocation
from snakegen.geometry import Floats
from snakegen.margins.controller import thrust_controller, vectored_controller
from snakegen.margins.failure import thrust_failures, vectored_failures
from snakegen.margins.thrust import ThrustMargins, thrust_margins
from snakegen.margins.vectored import VectoredMargins, vectored_margins
from snakegen.robot import Robot

COMMAND = "margin"
ORDER = 50
OPTIONS = {
    "tolerance": [1e-3, "relative gap of the certified vectored margins"],
    "failures": [False, "add the table of each rotor and each apparatus lost"],
}


@dataclass(frozen=True)
class Weakest:
    """Where a margin is reached: the direction, and what is at its limit there."""

    value: float
    bounds: tuple[float, float]  # certified lower and upper; equal where the value is exact
    direction: tuple[float, ...]  # (6,) N and N m, root-link axes
    full: tuple[str, ...]  # at their largest thrust
    idle: tuple[str, ...]  # at their smallest


@dataclass(frozen=True)
class Margins:
    """Margins at a posture, by mode and name; `failures` by what is lost, if asked for."""

    vectored: dict[str, Weakest]
    vectored_closed: bool
    dual: dict[str, Weakest]
    controller: dict[str, dict[str, float]]
    failures: tuple[tuple[str, str, float, float, float], ...]
    tolerance: float

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program; force in N, torque in N m, wrench scaled."""

        def one(w: Weakest) -> dict[str, Any]:
            return {
                "value": w.value,
                "bounds": list(w.bounds),
                "worst_direction": list(w.direction),
                "at_upper_limit": list(w.full),
                "at_lower_limit": list(w.idle),
            }

        rows = [
            {"mode": m, "lost": part, "wrench": w, "force_N": f, "torque_Nm": t}
            for m, part, w, f, t in self.failures
        ]
        return {
            "virtual_single_rotor": {k: one(v) for k, v in self.vectored.items()}
            | {"closed": self.vectored_closed, "tolerance": self.tolerance},
            "dual_rotor": {k: one(v) for k, v in self.dual.items()},
            "controller": self.controller,
        } | ({"failures": rows} if rows else {})

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        out = []
        if self.vectored:
            out.append(("virtual-single-rotor", self._summary(self.vectored, self.vectored_closed)))
            out += [("", _why(n, self.vectored[n])) for n in ("force", "torque")]
            out.append(("  paper's allocator", self._controller("virtual_single_rotor")))
        out.append(("dual-rotor (exact)", self._summary(self.dual, True)))
        out.append(("", _why("attitude_altitude", self.dual["attitude_altitude"])))
        out.append(("  paper's allocator", self._controller("dual_rotor")))
        for mode, part, w, f, t in self.failures:
            left = f"wrench {w:.3g}, force {f:.3g} N, torque {t:.3g} N m"
            out.append((f"without {part}", f"{left} ({mode})" if w >= 0 else f"falls: {left}"))
        return out

    def _summary(self, found: dict[str, Weakest], closed: bool) -> str:
        if found["wrench"].value < 0:
            return f"hover is out of reach by {-found['wrench'].value:.3g} (scaled)"
        parts = [
            f"force {found['force'].value:.4g} N",
            f"torque {found['torque'].value:.4g} N m",
            f"wrench {found['wrench'].value:.3g}",
        ]
        if "attitude_altitude" in found:
            parts.append(f"[f_z; τ] {found['attitude_altitude'].value:.3g}")
        return ", ".join(parts) + ("" if closed else "   (bounds did not close)")

    def _controller(self, mode: str) -> str:
        c = self.controller.get(mode)
        if c is None:
            return "not defined"
        return f"force {c['force']:.4g} N, torque {c['torque']:.4g} N m before it saturates"


def _why(name: str, weakest: Weakest) -> str:
    """Returns in words where a margin is weakest and what stops it there."""
    if not np.isfinite(weakest.direction).all():
        return f"{name}: not defined"
    f, t = weakest.direction[:3], weakest.direction[3:]
    parts = []
    if name in ("force", "wrench", "attitude_altitude") and np.any(f):
        parts.append("force {:+.2f} {:+.2f} {:+.2f}".format(*f))
    if name != "force" and np.any(t):
        parts.append("torque {:+.2f} {:+.2f} {:+.2f}".format(*t))
    where = f"{name} weakest along {', '.join(parts)}"
    if not weakest.full and not weakest.idle:
        return f"{where}: no thrust acts that way"
    full = f"at full thrust: {' '.join(weakest.full)}" if weakest.full else ""
    idle = f"at least thrust: {' '.join(weakest.idle)}" if weakest.idle else ""
    return f"{where}; " + "; ".join(p for p in (full, idle) if p)


def applies(robot: Robot) -> bool:
    """A robot with rotors and a free base."""
    return bool(robot.modules.apparatuses) and robot.floating


def analyze(robot: Robot, q: Floats, tolerance: float = 1e-3, failures: bool = False) -> Margins:
    """Returns the margins of THEORY A4 at q for both modes.

    Vectored: gimbals free, each apparatus force in a ball at its point of the posture's gimbal
    angles. Dual-rotor: gimbals held at q's angles, exact.
    """
    a = allocation(robot, q)
    rotors, limit = robot.rotors, robot.gimbals.limit
    scale = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    low, high = rotors.thrust_min, rotors.thrust_max
    dual = thrust_margins(a.dual, low, high, a.hover_wrench, **scale)
    names = [r.link for m in robot.modules.apparatuses for r in m.rotors]
    units = [f"apparatus {j + 1}" for j in range(limit.size)]
    controller = {
        "dual_rotor": _slices(thrust_controller(a.dual, low, high, a.hover_wrench, **scale))
    }
    vectored: dict[str, Weakest] = {}
    closed = False
    if robot.gimbal_names:
        v = vectored_margins(a.thrust_points, limit, a.hover_wrench, tolerance=tolerance, **scale)
        closed = bool(v.closed)
        vectored = {n: _weakest(v, n, units) for n in ("wrench", "force", "torque")}
        controller["virtual_single_rotor"] = _slices(
            vectored_controller(
                a.thrust_points, limit, a.hover_wrench, weights=np.ones(limit.size), **scale
            )
        )
    return Margins(
        vectored,
        closed,
        {n: _weakest(dual, n, names) for n in ("wrench", "force", "torque", "attitude_altitude")},
        controller,
        _failures(robot, a, names, units, tolerance, scale) if failures else (),
        tolerance,
    )


def _weakest(found: ThrustMargins | VectoredMargins, name: str, labels: list[str]) -> Weakest:
    value = float(getattr(found, name))
    bounds = (value, value)
    if isinstance(found, VectoredMargins):
        low, high = getattr(found, f"{name}_bounds")
        bounds = (float(low), float(high))
    full, idle = found.saturated(name)
    if isinstance(found, VectoredMargins):
        idle = []  # an apparatus with room is at no limit
    return Weakest(
        value,
        bounds,
        tuple(float(x) for x in found.worst(name)),
        tuple(labels[i] for i in full),
        tuple(labels[i] for i in idle),
    )


def _slices(found: Any) -> dict[str, float]:
    return {"force": float(found.force), "torque": float(found.torque)}


def _failures(
    robot: Robot,
    a: Any,
    names: list[str],
    units: list[str],
    tolerance: float,
    scale: dict[str, float],
) -> tuple[tuple[str, str, float, float, float], ...]:
    """Returns (mode, what is lost, wrench, force, torque) for each rotor and apparatus lost."""
    rotors = robot.rotors
    dual = thrust_failures(
        a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench, rotors.apparatus, **scale
    )
    out = []
    for row in dual:
        m = row.margins
        label = names[row.index] if row.part == "rotor" else units[row.index]
        out.append(("dual_rotor", label, float(m.wrench), float(m.force), float(m.torque)))
    if robot.gimbal_names:
        for row in vectored_failures(
            a.thrust_points, robot.gimbals.limit, a.hover_wrench, tolerance=tolerance, **scale
        ):
            m = row.margins
            out.append(
                (
                    "virtual_single_rotor",
                    units[row.index],
                    float(m.wrench),
                    float(m.force),
                    float(m.torque),
                )
            )
    return tuple(out)
