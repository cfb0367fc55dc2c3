"""The numbers of a run, from its recording alone; every key says its unit.

A metric is absent where its channel is absent, and None where it is undefined (a value that is
not finite), so that a check on it fails. Position errors are target − actual in world axes;
attitude errors are the rotation vector of ``Rᵀ R_target`` in the body's axes, which for the few
hundredths of a radian of ZN23 Tables 4 and 6 is their roll, pitch and yaw error.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.simulation.drive.metrics import drive_metrics
from snakegen.simulation.recording.clearance_metrics import clearance_metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.row_statistics import (
    RunningMean,
    cut,
    extreme,
    largest_mean,
    peak,
)
from snakegen.simulation.recording.servo_strength import servo_strength
from snakegen.simulation.recording.signals import (
    MAY_BE_UNDEFINED,
    Signal,
    at_limit,
    gimbals_at_limit,
    held_limit,
    is_finite,
    stored,
    tracking_error,
)
from snakegen.simulation.recording.vibration_metrics import vibration_metrics

SETTLED = 10.0  # s, after which drives are measured (HA's start error has then decayed)


def metrics(recording: Recording) -> dict[str, Any]:
    """Returns the metrics of a run inside ``meta["metrics_window_s"]`` (default: all of it).

    Returns:
        JSON-able dict; among others ``position_rmse_m`` and ``attitude_rmse_rad`` (three numbers
        each), ``position_max_m``, ``saturation_share`` (share of the ticks on which any rotor is
        at a limit), ``thrust_headroom`` (smallest 1 − λ/λ_max), ``joint_torque_use`` and
        ``gimbal_torque_use`` (largest |τ|/limit), ``min_floor_distance_m`` (after take-off),
        ``took_off``, ``floor_contact_after_takeoff_s``, ``sigma_min``, ``energy_j`` (∫ P dt).

    Raises:
        LogError: a limit in ``meta`` whose length does not fit its channel.
    """
    start, end = _window(recording)
    out: dict[str, Any] = {"duration_s": float(end - start), "finite": _all_finite(recording)}
    flight = (_tracking, _thrusts, _torques, clearance_metrics, _minima, _energy)
    for part in (*flight, vibration_metrics, drive_metrics):
        out.update(part(recording, start, end))
    out.update(servo_strength(recording))
    out.update(_of_mission(recording))
    return {key: _plain(value) for key, value in out.items()}


def _tracking(recording: Recording, start: float, end: float) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name, unit in (("position", "m"), ("attitude", "rad")):
        if not {name, f"{name}_target"} <= recording.channels.keys():
            continue
        squares, settled, peaks, last = RunningMean(), RunningMean(), [], None
        for time, error in tracking_error(recording, name).pieces(start, end):
            squares.add(error**2)
            settled.add(error[time > SETTLED] ** 2)
            peaks.append(np.linalg.norm(error, axis=1).max())
            last = error[-1]
        out[f"{name}_rmse_{unit}"] = rms = squares.root()
        out[f"{name}_rmse_norm_{unit}"] = None if rms is None else np.linalg.norm(rms)
        out[f"{name}_max_{unit}"] = extreme(np.array(peaks), np.max)
        out[f"{name}_end_{unit}"] = last
        if settled.count:
            out[f"{name}_rmse_settled_{unit}"] = settled.root()
    for name in ("joint", "gimbal"):
        if {f"{name}_angle", f"{name}_command"} <= recording.channels.keys():
            angle = recording.channel(f"{name}_angle").values
            axis = recording.times(f"{name}_angle")

            def gap(
                part: slice, name: str = name, angle: Floats = angle, axis: Floats = axis
            ) -> Floats:
                return np.abs(recording.held(f"{name}_command", axis[part], part) - angle[part])

            out[f"{name}_tracking_max_rad"] = peak(
                Signal(axis, gap, recording.release).pieces(start, end), np.max
            )
    return out


def _thrusts(recording: Recording, start: float, end: float) -> dict[str, Any]:
    if "thrust" not in recording.channels:
        return {}
    thrust = stored(recording, "thrust")
    width = recording.channel("thrust").values.shape[1]
    out: dict[str, Any] = {"thrust_max_n": peak(thrust.pieces(start, end), np.max)}
    upper, limited = held_limit(recording, "thrust_max", width), at_limit(recording)
    if upper is None or limited is None:
        return out
    name = "thrust_command" if "thrust_command" in recording.channels else "thrust"
    asked = stored(recording, name).pieces(start, end)
    finite, busy = all(np.all(np.isfinite(values)) for _, values in asked), RunningMean()
    for _, full in limited.pieces(start, end):
        busy.add(np.any(full > 0.0, axis=1))
    out["saturation_share"] = busy.value() if finite else None
    turned = gimbals_at_limit(recording)
    if turned is not None:
        out["gimbal_angle_limit_share"] = largest_mean(turned.pieces(start, end))
    left = ((time, 1.0 - values / upper) for time, values in thrust.pieces(start, end))
    out["thrust_headroom"] = peak(left, np.min)
    return out


def _torques(recording: Recording, start: float, end: float) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name in ("joint_torque", "gimbal_torque", "roll_moment"):
        if name not in recording.channels:
            continue
        width = recording.channel(name).values.shape[1]
        if width == 0:
            continue
        peaks, uses, full = [], [], RunningMean()
        limit = held_limit(recording, name, width)
        for _, values in stored(recording, name).pieces(start, end):
            torque = np.abs(values)
            peaks.append(torque.max())
            if limit is not None:
                uses.append((torque / limit).max())
                full.add(torque >= 0.99 * limit)
        out[f"{name}_max_n_m"] = extreme(np.array(peaks), np.max)
        if limit is not None:
            out[f"{name}_use"] = extreme(np.array(uses), np.max)
            share = full.value()  # of ticks, the busiest servo
            out[f"{name}_limit_share"] = None if share is None else extreme(share, np.max)
    return out


def _minima(recording: Recording, start: float, end: float) -> dict[str, Any]:
    keys = {
        "sigma_min": "sigma_min",
        "wrench_margin": "wrench_margin_min",
        "force_margin": "force_margin_min_n",
        "torque_margin": "torque_margin_min_n_m",
    }
    out: dict[str, Any] = {}
    for name, key in keys.items():
        if name not in recording.channels:
            continue
        # NaN is how a margin says "not defined here"; the rest still has a smallest value.
        # Where hover itself is out of reach no further force or torque can be carried.
        limited = name in ("force_margin", "torque_margin") and "wrench_margin" in recording
        least = []
        for time, values in stored(recording, name).pieces(start, end):
            if limited:
                reach = recording.held("wrench_margin", time)
                values = np.where(np.isnan(values) & (reach < 0.0), 0.0, values)
            defined = values[~np.isnan(values)]
            least += [defined.min()] if defined.size else []
        out[key] = extreme(np.array(least), np.min)
    return out


def _energy(recording: Recording, start: float, end: float) -> dict[str, Any]:
    out: dict[str, Any] = {}
    if "battery_used" in recording.channels:
        used = cut(recording, "battery_used", start, end)
        out["battery_used"] = used[-1, 0] - used[0, 0] if used.size else None  # as energy_j does
        empty = np.flatnonzero(recording.channel("battery_used").values[:, 0] >= 1.0)
        if empty.size:
            out["battery_empty_s"] = recording.times("battery_used")[empty[0]]
    if "power" not in recording.channels:
        return out
    energy, first, ends = 0.0, None, None
    for time, values in stored(recording, "power").pieces(start, end):
        power = values.sum(axis=1)
        if ends is None:
            first = time[0]
        else:  # from the piece before
            energy += 0.5 * (time[0] - ends[0]) * (ends[1] + power[0])
        energy += float(np.trapezoid(power, time))
        ends = time[-1], power[-1]
    if ends is None or ends[0] == first:
        return out
    return out | {"energy_j": energy, "power_mean_w": energy / (ends[0] - first)}


def _of_mission(recording: Recording) -> dict[str, Any]:
    """Returns the numbers that the run's mission adds; none for a log of another version's."""
    from snakegen.simulation.missions import missions, module_of

    name = str(recording.meta.get("mission", ""))
    if name not in missions() or "facts" not in recording.meta:
        return {}
    module = module_of(name)
    return dict(module.metrics(recording)) if hasattr(module, "metrics") else {}


def _window(recording: Recording) -> tuple[float, float]:
    window = recording.meta.get("metrics_window_s")
    if window is None:
        return float(recording.time[0]), float(recording.time[-1])
    return float(window[0]), float(window[1])


def _all_finite(recording: Recording) -> bool:
    return all(
        is_finite(recording, name) for name in recording.channels if name not in MAY_BE_UNDEFINED
    )


def _plain(value: Any) -> Any:
    """Returns Python numbers and lists; None for a number that is not finite."""
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.ndarray | list):
        return [_plain(v) for v in value]
    number = float(value)
    return number if np.isfinite(number) else None
