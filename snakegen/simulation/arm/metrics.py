"""The numbers of an arm's run, from its recording alone, and its table of peaks."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.simulation.recording.recording import Channel, Recording


def arm_metrics(recording: Recording) -> dict[str, Any]:
    """Returns the numbers of an arm's run, from its log alone.

    ``torque_gap_share``: the servos' torque and friction against the law of the motion asked for,
    largest over joints and time, as a share of each joint's peak; ``made_gap_share`` against the
    law of the motion made; ``inverse_gap_share``: MuJoCo's inverse dynamics against the law.
    ``made_gap_use`` is the second gap as a share of each servo's limit.
    ``friction_gap_n_m``: the servos' torque against the law without friction, ``_turning`` within
    50 ms of a joint's turning round, ``_moving`` when it is faster than half its top speed.
    """
    law = recording.channel("joint_torque_law").values
    servo = recording.channel("joint_torque").values
    rubbed = servo + recording.channel("joint_friction").values
    peak = np.maximum(np.abs(law).max(axis=0), 1e-12)
    peak = np.where(peak > 1e-9 * peak.max(), peak, np.inf)  # an unloaded joint
    ways = {
        "torque_gap_share": rubbed - law,
        "made_gap_share": rubbed - recording.channel("joint_torque_made").values,
        "inverse_gap_share": recording.channel("joint_torque_inverse").values - law,
    }
    out: dict[str, Any] = {k: float(np.max(np.abs(v) / peak)) for k, v in ways.items()}
    limit = np.maximum(np.asarray(recording.meta["limits"]["joint_torque"], float), 1e-12)
    out["made_gap_use"] = float(np.max(np.abs(ways["made_gap_share"]) / limit))
    time = recording.time
    out["joint_torque_rms_n_m"] = np.sqrt(np.trapezoid(servo**2, time, axis=0) / np.ptp(time))
    power = recording.channel("joint_power").values
    out["joint_power_max_w"] = float(np.max(np.abs(power)))
    if recording.meta.get("friction_n_m", [0.0])[0] > 0:
        rate = recording.channel("joint_rate").values
        turning = _near_turning(time, rate, 0.05)
        moving = np.abs(rate) > 0.5 * np.abs(rate).max(axis=0)
        gap = np.abs(servo - law)
        for name, where in (("turning", turning), ("moving", moving)):
            out[f"friction_gap_{name}_n_m"] = float(np.max(gap[where])) if where.any() else None
    return out


def arm_report(channels: Mapping[str, Channel]) -> str:
    """Returns peaks of the servos' and the law's torques side by side, as Markdown."""
    law, servo = (channels[n].values for n in ("joint_torque_law", "joint_torque"))
    lines = ["| joint | law, peak N·m | servo, peak N·m | RMS N·m | apart, share of peak |"]
    lines.append("|---|---|---|---|---|")
    for j, name in enumerate(channels["joint_torque"].labels):
        a, b = np.abs(law[:, j]).max(), np.abs(servo[:, j]).max()
        gap = np.abs(servo[:, j] - law[:, j]).max() / max(a, 1e-12)
        rms = float(np.sqrt(np.mean(servo[:, j] ** 2)))
        lines.append(f"| {name} | {a:.4g} | {b:.4g} | {rms:.4g} | {100 * gap:.2g} % |")
    return "\n".join(lines)


def _near_turning(time: Floats, rate: Floats, span: float) -> Any:
    """Returns (T, k) booleans: within `span` s of a change of sign of a joint's rate."""
    turned = np.zeros(rate.shape, bool)
    for j in range(rate.shape[1]):
        for k in np.flatnonzero(np.diff(np.sign(rate[:, j])) != 0):
            turned[np.abs(time - time[k]) <= span, j] = True
    return turned
