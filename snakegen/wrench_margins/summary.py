"""What a person and a program read of a posture's margins: values, bounds, limits, words."""

from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from snakegen.base.describe_motion import components
from snakegen.wrench_margins.design_steps import DesignSteps
from snakegen.wrench_margins.push_margin import LABELS, PushMargins

OUT_OF_REACH = "hover is out of reach"
_MODES = {"virtual_single_rotor": "virtual-single-rotor", "dual_rotor": "dual-rotor"}
_NAMES = {"attitude_altitude": "lift and torque"}


@dataclass(frozen=True)
class Weakest:
    """Where a margin is reached: the direction, and what is at its limit there."""

    value: float  # the lower bound
    bounds: tuple[float, float]  # certified lower and upper; equal where the value is exact
    direction: tuple[float, ...]  # (6,) N and N·m, root-link axes
    full: tuple[str, ...]  # at their largest thrust
    idle: tuple[str, ...]  # at their smallest


@dataclass(frozen=True)
class JointLimited:
    """Margins with joint torques within their servos' limits, for a disturbance on one link."""

    link: str
    force: tuple[float, float]  # certified bounds, N; NaN where hover itself breaks a limit
    torque: tuple[float, float]  # N·m
    joints: tuple[str, ...]  # at their limit where the force margin is reached


class Obstacles(Protocol):
    """What keeps a posture from hovering, as a page prints it."""

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs."""

    def to_json(self) -> dict[str, Any]:
        """Returns plain data."""


@dataclass(frozen=True)
class Margins:
    """Margins at a posture, by mode and name; `failures` by what is lost, if asked for."""

    vectored: dict[str, Weakest]
    vectored_closed: bool
    dual: dict[str, Weakest]
    controller: dict[str, dict[str, float]]
    joint_limited: dict[str, "JointLimited"]
    guaranteed: dict[str, dict[str, float]]
    failures: tuple[tuple[str, str, float, float, float], ...]
    tolerance: float
    force_scale: float  # N, m g
    torque_scale: float  # N·m, m g times the link length
    push: dict[str, PushMargins]  # by mode
    mode: str  # that the robot flies in
    allocator: str  # `paper` or `constrained`: whose prediction is named
    steps: DesignSteps | None = None  # small changes of the design, if asked for
    obstacles: Obstacles | None = None  # what keeps vectored thrusts from hover

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program, with the units in which to read it."""

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
            "joint_limited": {k: asdict(v) for k, v in self.joint_limited.items()},
            "guaranteed": self.guaranteed,
            "push": {k: v.to_json() for k, v in self.push.items()},
            "prediction": self._prediction(),
            "units": {
                "frame": "forces and torques along the root link's axes, torques about the CoG",
                "force": "N",
                "torque": "N·m",
                "wrench": "1, of [force / force_scale; torque / torque_scale]",
                "attitude_altitude": "1, as wrench, of [force z; torque] alone",
                "worst_direction": "N and N·m; of length 1, where the margin is scaled in its "
                "scaled parts",
                "force_scale_N": self.force_scale,
                "torque_scale_Nm": self.torque_scale,
                "push": "weakest disturbance on the robot, N and N·m, of margin 1: its rotors "
                "answer it with minus that",
            },
        } | (
            ({"failures": rows} if rows else {})
            | ({} if self.steps is None else {"sensitivity": self.steps.to_json()})
            | ({"hover_out_of_reach": self.obstacles.to_json()} if self.obstacles else {})
        )

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        out = []
        if self.vectored:
            out.append(("virtual-single-rotor", self._summary(self.vectored, self.vectored_closed)))
            if self._falls("virtual_single_rotor") and self.obstacles is not None:
                out += self.obstacles.rows()
            told = () if self._falls("virtual_single_rotor") else ("force", "torque")
            out += [("", _why(n, self.vectored[n])) for n in told]
            out += self._pushes("virtual_single_rotor")
        out.append(("dual-rotor (exact)", self._summary(self.dual, True)))
        if not self._falls("dual_rotor"):
            out.append(("", _why("attitude_altitude", self.dual["attitude_altitude"])))
        out.append(("  pseudo-inverse, 6 rows", self._controller("dual_rotor")))
        out += self._joints("dual_rotor")
        out += self._pushes("dual_rotor")
        out += self._predicted()
        for mode, sure in self.guaranteed.items():
            out.append((f"guaranteed, {_MODES[mode]}", _sure(sure)))
        for mode, part, w, f, t in self.failures:
            left = f"force {f:.3g} N, torque {t:.3g} N·m, 6-D {w:.3g} of the weight"
            if w < 0:
                left = f"falls: hover is out of reach by {-w:.3g} of the weight (6-D)"
            out.append((f"without {part}", f"{_MODES[mode]}: {left}"))
        return out if self.steps is None else out + self.steps.rows()

    def _pushes(self, mode: str) -> list[tuple[str, str]]:
        found = self.push.get(mode)
        return [] if found is None or self._falls(mode) else found.rows()

    def _prediction(self) -> dict[str, Any]:
        """Returns the margin of each kind that predicts the limit of a push in the flown mode."""
        found = self.push.get(self.mode)
        if found is None:
            return {}
        out: dict[str, Any] = {"mode": self.mode, "allocator": self.allocator, "link": found.link}
        for kind in found.kinds:
            key, margin = found.prediction(kind, self.allocator)
            out[kind] = margin.to_json() | {"margin": key}
        return out

    def _predicted(self) -> list[tuple[str, str]]:
        found = self.push.get(self.mode)
        if found is None or self._falls(self.mode):
            return []
        out: list[tuple[str, str]] = []
        for kind in found.kinds:
            key, margin = found.prediction(kind, self.allocator)
            how = f"{LABELS[key]}, {_MODES[self.mode]}, on {found.link}"
            label = "" if out else "prediction for push"
            out.append((label, f"{_NAMES.get(kind, kind)} {margin.text(kind)}: {how}"))
        return out

    def _falls(self, mode: str) -> bool:
        found = self.dual if mode == "dual_rotor" else self.vectored
        return bool(found) and found["wrench"].value < 0

    def _joints(self, mode: str) -> list[tuple[str, str]]:
        j = self.joint_limited.get(mode)
        if j is None:
            return []
        if self._falls(mode):
            return [("  within servo limits", OUT_OF_REACH)]
        if not np.isfinite(j.force[1]):
            return [("  within servo limits", "hover itself overloads a joint")]
        at = f"; there {', '.join(j.joints)} at the limit" if j.joints else ""
        text = f"force {j.force[0]:.4g} N, torque {j.torque[0]:.4g} N·m on {j.link}{at}"
        return [("  within servo limits", text)]

    def _summary(self, found: dict[str, Weakest], closed: bool) -> str:
        if found["wrench"].value < 0:
            return f"hover is out of reach by {-found['wrench'].value:.3g} of the weight (6-D)"
        parts = [
            f"force {_range(found['force'], 4)} N",
            f"torque {_range(found['torque'], 4)} N·m",
            f"6-D {_range(found['wrench'], 3)} of the weight",
        ]
        if "attitude_altitude" in found:
            parts.append(f"lift and torque alone {found['attitude_altitude'].value:.3g}")
        return ", ".join(parts) + ("" if closed else f"   ({self._gap(found)})")

    def _gap(self, found: dict[str, Weakest]) -> str:
        """Returns how far the bounds of force and torque are apart, where above the tolerance."""
        wide = []
        for name in ("force", "torque"):
            low, high = found[name].bounds
            if not high - low <= self.tolerance * high:
                wide.append(f"{name} by {1.0 - low / high:.1%}")
        return f"bounds differ: {', '.join(wide)}; the lower ones are certain"

    def _controller(self, mode: str) -> str:
        c = self.controller.get(mode)
        if c is None:
            return "not defined"
        if self._falls(mode) or not np.isfinite([c["force"], c["torque"]]).all():
            return OUT_OF_REACH
        return f"force {c['force']:.4g} N, torque {c['torque']:.4g} N·m before it saturates"


def _sure(found: dict[str, float]) -> str:
    """Returns guaranteed margins in words; hover itself may be out of reach with these errors."""
    units = {"force": " N", "torque": " N·m"}
    parts = [
        f"{_NAMES.get(k, k)} {v:.3g}{units.get(k, '')}"
        for k, v in found.items()
        if np.isfinite(v) and not (k == "wrench" and v < 0.0)
    ]
    if np.isfinite(found["force"]):
        return ", ".join(parts)
    by = f" by {-found['wrench']:.3g} of the weight (6-D)" if found.get("wrench", 0.0) < 0.0 else ""
    return ", ".join([f"{OUT_OF_REACH}{by} with these errors", *parts])


def _range(weakest: Weakest, digits: int) -> str:
    """Returns a margin's lower bound, and the upper one where they print differently."""
    low, high = (f"{x:.{digits}g}" for x in weakest.bounds)
    return low if low == high else f"{low} … {high}"


def _why(name: str, weakest: Weakest) -> str:
    """Returns in words where a margin is weakest and what stops it there."""
    if not np.isfinite(weakest.direction).all():
        return f"{name}: not defined"
    f, t = weakest.direction[:3], weakest.direction[3:]
    unit = ("", "") if name in ("force", "torque") else (" N", " N·m")
    parts = []
    if name in ("force", "wrench", "attitude_altitude") and np.any(f):
        parts.append(f"{'' if name == 'force' else 'force '}{components(f)}{unit[0]}")
    if name != "force" and np.any(t):
        parts.append(f"{'' if name == 'torque' else 'torque '}{components(t)}{unit[1]}")
    what = {"wrench": "6-D margin"} | _NAMES
    where = f"{what.get(name, name)} weakest along {', '.join(parts)}"
    if not weakest.full and not weakest.idle:
        return f"{where}: no thrust acts that way alone"
    full = f"at full thrust: {', '.join(weakest.full)}" if weakest.full else ""
    idle = f"at least thrust: {', '.join(weakest.idle)}" if weakest.idle else ""
    return f"{where}; " + "; ".join(p for p in (full, idle) if p)
