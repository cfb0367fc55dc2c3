"""A drive under load as it stands in the world: a plane that inclines, a pull that grows.

Drives on a slope are simulated in axes of the plane, with gravity inclined; drawn, gravity is down.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import rotation_about
from snakegen.log import style
from snakegen.simulation.recording.recording import Channel, Recording

Floats = NDArray[np.float64]
_POINTS = ("position", "position_target", "contact_point", "contact_force")
_ATTITUDES = ("attitude", "attitude_target")
_UP = np.array([0.0, 0.0, 1.0])
_HALF = (0.6, 0.004)  # m, of the plane's slab: to each side of the start, and of its depth


def _known(recording: Recording, kind: str) -> dict[str, Any] | None:
    """Returns the facts of a load of this kind, None where the run has none."""
    facts = recording.meta.get("facts") or {}
    return facts if facts.get("load_kind") == kind and "load_direction" in facts else None


def _over_time(facts: dict[str, Any], time: Floats) -> Floats:
    return np.interp(time, facts["load_time_s"], facts["load_value"])


def inclination(recording: Recording, time: Floats) -> Floats | None:
    """Returns the rotation (T, 3, 3) of the plane in the world, None for a level one."""
    facts = _known(recording, "slope")
    if facts is None:
        return None
    axis = np.cross(_UP, facts["load_direction"])
    return np.array([rotation_about(axis, angle) for angle in _over_time(facts, time)])


def as_it_stands(recording: Recording) -> Recording:
    """Returns the recording with the body where it is in the world, for drawing alone."""
    if _known(recording, "slope") is None:
        return recording
    channels = dict(recording.channels)
    for name in (*_POINTS, *_ATTITUDES, "q"):
        if name in channels:
            channels[name] = _turned(recording, name, channels[name])
    return replace(recording, channels=channels)


def _turned(recording: Recording, name: str, channel: Channel) -> Channel:
    turn = inclination(recording, recording.times(name))
    if turn is None:
        return channel
    values = np.array(channel.values)
    if name in _POINTS:
        parts = values.reshape(len(values), -1, 3)
        values = np.einsum("tij,tkj->tki", turn, parts).reshape(values.shape)
    elif name in _ATTITUDES:
        values = _after(turn, values)
    else:
        values[:, :3] = np.einsum("tij,tj->ti", turn, values[:, :3])
        values[:, 3:7] = _after(turn, values[:, 3:7])
    return replace(channel, values=values)


def _after(turn: Floats, xyzw: Floats) -> Floats:
    """Returns quaternions xyzw (T, 4) turned by (T, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray((Rotation.from_matrix(turn) * Rotation.from_quat(xyzw)).as_quat())


def plane_corners(recording: Recording, time: Floats) -> Floats | None:
    """Returns the corners (T, 4, 3) [m] of a square of the plane, None for a level one."""
    turn = inclination(recording, time)
    if turn is None:
        return None
    square = _HALF[0] * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    square[:, :2] += _middle(recording)
    return np.einsum("tij,kj->tki", turn, square)


def _middle(recording: Recording) -> Floats:
    """Returns the middle (2,) of the drums' contacts at the start, in axes of the plane."""
    if "contact_point" not in recording.channels:
        return np.zeros(2)
    points = recording.channel("contact_point").values.reshape(len(recording.time), -1, 3)
    with np.errstate(invalid="ignore"):
        touched = points[np.isfinite(points).all(axis=(1, 2))][:1]
    return np.asarray(touched[0].mean(axis=0)[:2] if len(touched) else np.zeros(2))


def log_plane(rec: Any, recording: Recording, time: Floats) -> None:
    """Draws the plane under a drive on a slope; `recording` as simulated."""
    import rerun as rr

    turn = inclination(recording, time)
    if turn is None:
        return
    from scipy.spatial.transform import Rotation

    half = (_HALF[0], _HALF[0], _HALF[1])
    slab = rr.Boxes3D(
        half_sizes=[half],
        centers=[[*_middle(recording), -_HALF[1]]],
        colors=[style.OBSTACLE],
        fill_mode=rr.components.FillMode.Solid,
    )
    rec.log("world/plane", slab, static=True)
    turned = Rotation.from_matrix(turn).as_quat().astype(np.float32)
    columns = [rr.TimeColumn(style.TIMELINE, duration=time)]
    rec.send_columns("world/plane", columns, rr.Transform3D.columns(quaternion=turned))


def pull(recording: Recording, time: Floats, longest: float) -> Floats | None:
    """Returns arrows (T, 3) [m] of the pull on a towed drive, None where it is not towed.

    Args:
        recording: of a drive.
        time: (T,) s.
        longest: m, of the largest pull's arrow.
    """
    facts = _known(recording, "tow")
    if facts is None:
        return None
    most = max(*np.abs(facts["load_value"]), 1e-9)
    return np.outer(longest * _over_time(facts, time) / most, facts["load_direction"])
