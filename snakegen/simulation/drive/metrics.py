"""The numbers of a drive, from its recording alone; every key says its unit.

HA gives tracking errors as curves; THEORY part B measures them in the plane, after the start error
has decayed: t > 10 s.
"""

from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.simulation.recording.recording import Recording

SETTLED = 10.0  # s
STARTED = 1.0  # s, the wheels find the ground and a start off the path asks for a step of rates


def drive_metrics(recording: Recording, start: float, end: float) -> dict[str, Any]:
    """Returns planar errors, slip, rates, loads and tilt of a drive; nothing of other runs.

    Distances are of the head P in the plane; `shape` of the yaw joints. `error_law_deviation` is
    the largest ``|e(t) − e(0) exp(−K t)|`` (HA eq 8), in the kinematic plant alone.
    """
    if "state_error" not in recording.channels:
        return {}
    time = recording.times("state_error")
    inside = (time >= start) & (time <= end)
    error, late = recording.channel("state_error").values, inside & (time > SETTLED)
    out: dict[str, Any] = {
        "distance_rmse_m": _rms(np.hypot(error[inside, 0], error[inside, 1])),
        "distance_end_m": float(np.hypot(error[inside][-1, 0], error[inside][-1, 1])),
        "heading_rmse_rad": _rms(error[inside, 2]),
        "distance_excess_m": _excess(recording, time, error, inside),
    }
    if recording.meta.get("reference_s"):
        out["path_share"] = min(1.0, end / float(recording.meta["reference_s"]))
    if error.shape[1] > 3:
        out["shape_rmse_rad"] = _rms(error[inside, 3:])
    if late.any():
        out["distance_rmse_settled_m"] = _rms(np.hypot(error[late, 0], error[late, 1]))
        out["heading_rmse_settled_rad"] = _rms(error[late, 2])
        if error.shape[1] > 3:
            out["shape_rmse_settled_rad"] = _rms(error[late, 3:])
    out |= _law(recording, time, error) | _motors(recording, inside) | _ground(recording, inside)
    return out


def _law(recording: Recording, time: Floats, error: Floats) -> dict[str, Any]:
    """Returns how far the closed loop is from eq 8."""
    if recording.meta.get("drive_plant") != "kinematic" or not recording.meta.get("feedback"):
        return {}
    decay = np.exp(-np.outer(time, np.asarray(recording.meta["gain_1_s"], float)))
    gap = np.abs(error - error[0] * decay)
    return {"error_law_deviation": float(gap.max()), "error_law_end": float(gap[-1].max())}


def _excess(recording: Recording, time: Floats, error: Floats, inside: Any) -> float:
    """Returns by how much the distance from the reference exceeds what HA eq 8 leaves of it [m].

    ``max_t |e(t)| - |e(0)| exp(-K t)`` in the plane; without feedback K = 0. It is defined for
    every run, however short.
    """
    gain = np.asarray(recording.meta["gain_1_s"], float)[:2].min()
    rate = gain if recording.meta.get("feedback") else 0.0
    distance = np.hypot(error[:, 0], error[:, 1])
    return float((distance - distance[0] * np.exp(-rate * time))[inside].max())


def _motors(recording: Recording, inside: Any) -> dict[str, Any]:
    """Returns the use of the screw motors."""
    limits = recording.meta.get("limits", {})
    asked = np.abs(recording.channel("screw_rate_command").values[inside])
    slip = np.abs(recording.channel("slip").values[inside])
    out = {
        "screw_rate_max_rad_s": float(asked.max()),
        "screw_rate_use": float(asked.max() / limits["screw_rate"]),
        "slip_mean_m_s": float(slip.mean()),
        "slip_median_m_s": float(np.median(slip)),
        "slip_max_m_s": float(slip.max()),
    }
    if "screw_torque" in recording.channels:
        torque = np.abs(recording.channel("screw_torque").values[inside])
        use = torque / np.asarray(limits["screw_torque"])
        rolling = recording.times("screw_torque")[inside] > STARTED
        out["screw_torque_max_n_m"] = float(torque.max())
        out["screw_torque_start_use"] = float(use.max())
        if rolling.any():
            out["screw_torque_use"] = float(use[rolling].max())
    return out


def _ground(recording: Recording, inside: Any) -> dict[str, Any]:
    """Returns loads, friction use and tilt; only contact has them."""
    if "wheel_load" not in recording.channels:
        return {}
    time = recording.times("wheel_load")
    rolling = inside & (time > STARTED) if (inside & (time > STARTED)).any() else inside
    load = recording.channel("wheel_load").values[rolling]
    use = recording.channel("cone_use").values[rolling]
    x, y = recording.held("attitude", time)[inside, :2].T
    return {
        "tilt_max_rad": float(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)).max()),
        "wheel_load_mean_n": load.mean(axis=0).tolist(),
        "wheel_load_max_n": float(load.max()),
        "airborne_share": (load <= 0).mean(axis=0).tolist(),
        "cone_use_mean": float(use[load > 0].mean()) if (load > 0).any() else None,
        "cone_sliding_share": float((use > 0.98).mean()),
    }


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
