"""The document inside a flight's log: what was flown, with what plant, and the paper beside it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from snakegen.simulation.flight.bounds.flight_bounds import TABLES
from snakegen.simulation.flight.trim import describe_trim
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.summary import outcome
from snakegen.simulation.recording.vibration_metrics import SHAKING

_UNITS = {
    "thrust_mismatch": "1 (standard deviation)",
    "drive_mismatch": "1 (standard deviation)",
    "position_noise": "m",
    "attitude_bias": "rad",
    "attitude_noise": "rad",
    "gyro_noise": "rad/s",
    "velocity_noise": "m/s",
    "joint_noise": "rad",
    "torque_noise": "N·m",
    "imu_rate": "Hz",
    "delay": "s",
    "air_density": "kg/m³",
    "wind_speed": "m/s",
    "wind_direction": "rad",
    "turbulence": "m/s (standard deviation)",
    "battery_energy": "Wh (0: endless)",
    "voltage_sag": "1 (share lost, full to empty; thrust limits go as its square)",
    "link_stiffness": "N·m/rad (0: rigid)",
    "link_damping": "s",
}
_AXES = ("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]")
_SHOWN = (
    ("energy_j", "energy", "J"),
    ("power_mean_w", "mean power", "W"),
    ("battery_used", "share of the battery used", "1"),
    ("thrust_max_n", "largest thrust", "N"),
    ("thrust_headroom", "thrust headroom", "1"),
    ("saturation_share", "ticks with a rotor at a limit", "1"),
    ("gimbal_angle_limit_share", "ticks with a gimbal at a limit of its angle", "1"),
    ("joint_torque_use", "largest joint torque, share of its limit", "1"),
    ("gimbal_torque_use", "largest gimbal torque, share of its limit", "1"),
    ("roll_moment_use", "largest moment of λ1 − λ2 on a φ servo, share of its limit", "1"),
    ("elastic_rms_rad", "elastic angles about their mean, RMS", "rad"),
    ("modal_energy_mean_j", "mean energy of the elastic modes", "J"),
    ("decay_s", "swung out to a tenth of the energy after", "s"),
    ("swing_j_s", "energy over the seconds after the pluck", "J s"),
    ("sigma_min", "least σ_min on the way", "1"),
    ("wrench_margin_min", "least wrench margin on the way", "1"),
    ("force_margin_min_n", "least force margin on the way", "N"),
    ("torque_margin_min_n_m", "least torque margin on the way", "N·m"),
    ("min_floor_distance_m", "least distance to the floor", "m"),
    ("min_self_distance_m", "least distance to itself", "m"),
    ("min_obstacle_distance_m", "least distance to an obstacle", "m"),
)


def flight_report(recording: Recording) -> str:
    """Returns the markdown of a judged flight; tables of what it has, nothing of what it lacks."""
    meta, found = recording.meta, recording.metrics
    lines = "\n".join(f"- {line}" for line in outcome(meta, found))
    parts = [_head(meta), lines, _checks(recording), _tracking(meta, found), _numbers(found)]
    parts += [_elastic(meta, found), _push(meta, found), _plant(meta)]
    return "\n\n".join(p for p in parts if p)


def _head(meta: dict[str, Any]) -> str:
    lines = [
        f"in {str(meta['mode']).replace('_', '-')} mode",
        f"gains `{meta.get('gains') or 'Table 5'}`",
        f"{meta.get('allocator', 'paper')} allocator",
        "perfect sensors and rotors" if meta["ideal"] else f"seed {meta['seed']}",
    ]
    text = f"## {meta['robot']}: {meta['mission']}\n\n" + ", ".join(lines) + "."
    if "trial" in meta:
        drawn = ", ".join(f"{k} {v:.3g}" for k, v in meta["drawn"].items())
        text += f" Trial {meta['trial']}, drawn: {drawn}."
    options = {k: v for k, v in meta.get("options", {}).items() if v is not None}
    if options:
        text += " Options: " + ", ".join(f"{k} {v}" for k, v in options.items()) + "."
    if meta.get("trim_s"):
        text += f"\n\nTrimmed in hover for {meta['trim_s']:g} s before t = 0; figures begin there."
        if "trim" in meta:
            text += f" At t = 0 the {describe_trim(meta['trim'])}."
    if meta.get("stopped"):
        text += f"\n\n**The run ended early: {meta['stopped']}.**"
    return text


def _checks(recording: Recording) -> str:
    if recording.verdict is None:
        return ""
    sign = {"at_most": "≤", "at_least": "≥", "equals": "="}
    rows = [
        (
            "ok" if c.passed else "**FAIL**",
            c.metric,
            _text(c.value),
            f"{sign[c.kind]} {_text(c.bound)}",
            c.worst.text() if c.worst else "",
        )
        for c in recording.verdict.checks
    ]
    return "### Checks\n\n" + table(("", "check", "value", "bound", "worst at"), rows)


def _tracking(meta: dict[str, Any], found: dict[str, Any]) -> str:
    position, attitude = found.get("position_rmse_m"), found.get("attitude_rmse_rad")
    if not position or not attitude:
        return ""
    name, paper = TABLES.get((meta["mission"], meta["mode"]), ("", ()))
    rows = [("this flight", *(_text(v) for v in [*position, *attitude]))]
    if paper:
        rows.append((f"ZN23 {name}", *(_text(v) for v in paper), *[""] * (6 - len(paper))))
    return "### Tracking error, RMSE\n\n" + table(("", *_AXES), rows)


def _numbers(found: dict[str, Any]) -> str:
    rows = [(label, _text(found[key]), unit) for key, label, unit in _SHOWN if key in found]
    return "### On the way\n\n" + table(("", "value", "unit"), rows) if rows else ""


def _elastic(meta: dict[str, Any], found: dict[str, Any]) -> str:
    """Tells which frequency of bending links matters: where the body's rates shake most."""
    modes = meta.get("modal_frequencies_hz")
    if not modes:
        return ""
    text = "Natural frequencies: " + ", ".join(f"{f:.2f}" for f in modes) + " Hz."
    peak, cutoff = found.get("body_rate_peak_hz"), float(meta.get("rate_filter_hz", 0.0))
    if peak:
        near = min(modes, key=lambda f: abs(f - peak))
        ripple = found["body_rate_ripple_rad_s"]
        text += (
            f" The body's rates shake most at {peak:.1f} Hz ({ripple:.2g} rad/s RMS above "
            f"{SHAKING:g} Hz); the nearest mode is at {near:.2f} Hz."
        )
        if cutoff > 0.0:
            left = 1.0 / np.sqrt(1.0 + (peak / cutoff) ** 4)
            text += f" A low-pass of {cutoff:g} Hz leaves {100 * left:.0f} % of them to the law."
        else:
            text += " There is no low-pass on rates (control.rate_filter)."
    return "### Elastic links\n\n" + text


def _push(meta: dict[str, Any], found: dict[str, Any]) -> str:
    forecast = meta.get("facts", {}).get("forecast")
    if not forecast:
        return ""
    rows = [
        ("predicted limit", _text(found.get("predicted_wrench"))),
        ("measured limit", _text(found.get("lost_wrench"))),
        ("measured ÷ predicted (rigid body)", _text(found.get("ratio"))),
        ("… of the deflected body", _text(found.get("loaded_ratio"))),
        ("… with the rotors' thrust factors known", _text(found.get("informed_ratio"))),
        ("an actuator first at its limit, over the prediction", _text(found.get("limit_ratio"))),
        ("predicted to be at its limit", ", ".join(forecast["stopped"])),
        ("acting on", str(forecast["link"])),
    ]
    return "### Push: [force N; torque N·m] about the CoG\n\n" + table(("", ""), rows)


def _plant(meta: dict[str, Any]) -> str:
    rows = [(k, _text(v), _UNITS.get(k, "")) for k, v in meta.get("plant", {}).items()]
    return "### Plant\n\n" + table(("", "value", "unit"), rows) if rows else ""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Returns a markdown table."""
    lines: list[Sequence[str]] = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, list | tuple):
        return " ".join(_text(v) for v in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return f"{value:.4g}"
