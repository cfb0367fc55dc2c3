"""Strength of servos, read off a run: the gain that each shows over its declared one.

A position servo gives ``τ = k (u − q) − d q̇``, a velocity servo ``τ = g (u − q̇)``. Least squares
over a run give k and g: 1 as declared, 0.5 of a servo at half strength, whatever loads it. Samples
at the torque limit show no gain and are left out. Tracking does not show a weak servo: a law that
feeds errors back makes up for it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot
from snakegen.simulation.recording.recording import Recording

STRONG = 0.8  # of the declared gain, that a servo must show: twice the ±10 % of declared stiffness
_FREE = 0.99  # of its limit: a torque below shows a servo's gain
_IDLE = 1e-4  # of its limit: RMS torque of a servo that bears nothing, whose gain nothing shows


def servo_strength(recording: Recording) -> dict[str, Any]:
    """Returns the least strength of joint and screw servos that bear anything; else nothing.

    ``joint_servo_strength`` and ``screw_servo_strength``: 1 as declared.
    """
    found = {"joint": joint_strength(recording), "screw": screw_strength(recording)}
    out = {}
    for name, share in found.items():
        if share is not None and np.isfinite(share).any():
            out[f"{name}_servo_strength"] = float(np.nanmin(share))
    return out


def strength_checks(metrics: Mapping[str, Any]) -> dict[str, dict[str, Any] | None]:
    """Returns the checks of strengths that a run shows; idle servos show none."""
    names = ("joint_servo_strength", "screw_servo_strength")
    return {name: {"at_least": STRONG} for name in names if name in metrics}


def joint_strength(recording: Recording) -> Floats | None:
    """Returns k over the declared stiffness (k,) of joint servos, nan of idle ones; None: no run.

    ``k = Σ δ (τ + d q̇) / Σ δ²``, δ = u − q the channel `servo_deflection`.
    """
    known = recording.meta.get("joint_servos")
    if known is None or "servo_deflection" not in recording.channels:
        return None
    time, gap = recording.times("servo_deflection"), recording.channel("servo_deflection").values
    torque, rate = (recording.held(name, time) for name in ("joint_torque", "joint_rate"))
    spring = torque + np.asarray(known["damping"], float) * rate
    stiffness = np.asarray(known["stiffness"], float)
    limit = recording.meta["limits"]["joint_torque"]
    gap = np.where(_free(torque, limit), gap, 0.0)
    share = _ratio((gap * spring).sum(axis=0), (gap * gap).sum(axis=0) * stiffness)
    return np.where(_idle(torque, limit), np.nan, share)


def screw_strength(recording: Recording) -> Floats | None:
    """Returns g over the declared gain (n,) of screws, nan of idle ones; None: no such run.

    A drum may turn by a constant factor more than its command says: ``τ = g (u − q̇) + c u``, of
    which least squares find g and c.
    """
    gain = recording.meta.get("screw_gain")
    if gain is None or "screw_torque" not in recording.channels:
        return None
    # a row's torque and rate are those of the last step before it, of the command before it
    torque = recording.channel("screw_torque").values[1:]
    asked = recording.channel("screw_rate_command").values[:-1]
    droop = asked - recording.channel("screw_rate").values[1:]
    limit = recording.meta["limits"]["screw_torque"]
    free, share = _free(torque, limit), np.full(torque.shape[1], np.nan)
    for j in range(len(share)):
        columns = np.column_stack([droop[:, j], asked[:, j]])[free[:, j]]
        if len(columns) >= 2:
            shown = np.linalg.lstsq(columns, torque[free[:, j], j], rcond=None)[0][0]
            share[j] = shown / gain[j]
    return np.where(_idle(torque, limit), np.nan, share)


def declared_servos(
    robot: Robot, joints: Sequence[str], softer: Mapping[str, float] | None = None
) -> dict[str, list[float]]:
    """Returns stiffness [N·m/rad] and damping [N·m·s/rad] of the servos of joints, for meta.

    Args:
        robot: whose spec declares them.
        joints: names.
        softer: factors by which a run divides the stiffness of some.
    """
    known = {s.joint: s for s in robot.modules.servos}
    factor = softer or {}
    return {
        "stiffness": [known[n].stiffness / factor.get(n, 1.0) for n in joints],
        "damping": [known[n].damping for n in joints],
    }


def _ratio(above: Floats, below: Floats) -> Floats:
    return np.divide(above, below, out=np.full(len(above), np.nan), where=below > 0.0)


def _free(torque: Floats, limit: Any) -> Any:
    return np.abs(torque) < _FREE * np.asarray(limit, float)


def _idle(torque: Floats, limit: Any) -> Any:
    return np.sqrt(np.mean(torque**2, axis=0)) < _IDLE * np.asarray(limit, float)
