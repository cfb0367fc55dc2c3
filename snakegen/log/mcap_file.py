"""Poses and joint states of an MCAP recording, as columns to compare a log with.

Messages are recognised by their fields, whatever their type is called, in JSON or in ROS 2's CDR:

- joints: ``name`` and ``position`` (sensor_msgs/JointState);
- a pose: ``pose`` with ``position`` and ``orientation`` (geometry_msgs/PoseStamped,
  nav_msgs/Odometry, foxglove.PoseInFrame), the root link's, or the CoG's where the frame is called
  ``cog`` or ``com``;
- transforms: ``transforms`` or one ``transform`` to the root link (tf2_msgs/TFMessage).

Times are those of the messages' stamps, else when they were logged, from the first one on.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import LogError

POSE = ("x", "y", "z", "roll", "pitch", "yaw")
BASE = tuple(f"base_{name}" for name in POSE)  # of the root link, where a log's x … are the CoG's
_COG = ("cog", "com")
_MOST = 20_000_000  # numbers


class Column(NamedTuple):
    """A measured signal."""

    time: Floats  # (m,) s
    values: Floats  # (m,)
    topic: str


def read_mcap(path: Path, root: str, topics: Sequence[str] = ()) -> dict[str, Column]:
    """Returns the columns of poses and joints in an MCAP file.

    Args:
        path: of the file.
        root: name of the robot's root link.
        topics: to read; all if empty.

    Raises:
        LogError: no such file, a damaged one, nothing that is read, or two topics that give the
            same column; the package is not installed.
    """
    rows: dict[tuple[str, str], list[tuple[float, float]]] = {}
    skipped: set[str] = set()
    count = 0
    for topic, time, message in _messages(path, topics, skipped):
        try:
            found = _columns(message, root)
        except (AttributeError, KeyError, TypeError, ValueError, IndexError):
            found = {}  # fields of these names, but other contents
        for name, value in found.items():
            rows.setdefault((name, topic), []).append((time, value))
            count += 1
        if count > _MOST:
            raise LogError(f"{path.name} holds more than {_MOST:,} numbers; name its topics.")
    owners: dict[str, str] = {}
    for name, topic in rows:
        if name in owners:
            raise LogError(
                f"{path.name}: both {owners[name]} and {topic} hold {name}; choose with --topic."
            )
        owners[name] = topic
    if not rows:
        other = f"; passed over: {', '.join(sorted(skipped)[:8])}" if skipped else ""
        raise LogError(
            f"{path.name} holds no pose and no joint states in JSON or ROS 2's CDR{other}."
        )
    first = min(row[0][0] for row in rows.values())
    return {name: _column(row, first, topic) for (name, topic), row in rows.items()}


def _column(rows: list[tuple[float, float]], first: float, topic: str) -> Column:
    """Returns rows in order of time, `first` taken for 0."""
    table = np.array(sorted(rows, key=lambda row: row[0]))
    return Column(table[:, 0] - first, table[:, 1], topic)


def _messages(
    path: Path, topics: Sequence[str], skipped: set[str]
) -> Iterator[tuple[str, float, Any]]:
    """Yields topic, time [s] and message; what cannot be decoded goes to `skipped`."""
    try:
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
    except ImportError:
        raise LogError(
            "MCAP files need the package mcap, which is not installed: pip install 'snakegen[mcap]'"
        ) from None
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    try:
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            for schema, channel, message in reader.iter_messages(topics=list(topics) or None):
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(channel.message_encoding, schema)
                    if decoders[channel.id] is None:
                        skipped.add(f"{channel.topic} ({channel.message_encoding})")
                decode = decoders[channel.id]
                if decode is not None:
                    content = decode(message.data)
                    yield channel.topic, _time(content, 1e-9 * message.log_time), content
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror or error}).") from None
    except (McapError, struct.error, ValueError, EOFError, IndexError, KeyError) as error:
        reason = " ".join(str(error).split())[:150] or type(error).__name__
        raise LogError(f"{path} is cut short, damaged or no MCAP file ({reason}).") from None


def _decoder(encoding: str, schema: Any) -> Callable[[bytes], Any] | None:
    if encoding == "json":
        return json.loads
    if encoding != "cdr":
        return None
    try:
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        raise LogError(
            "messages of ROS 2 need the package mcap-ros2-support, which is not installed: "
            "pip install 'snakegen[mcap]'"
        ) from None
    found: Callable[[bytes], Any] | None = DecoderFactory().decoder_for(encoding, schema)
    return found


def _get(message: Any, name: str) -> Any:
    """Returns a field of a decoded message; None where there is none."""
    return message.get(name) if isinstance(message, dict) else getattr(message, name, None)


def _time(message: Any, logged: float) -> float:
    """Returns the stamp [s] of a message, else the time at which it was logged."""
    header = _get(message, "header")
    stamps = [] if header is None else [_get(header, "stamp")]
    for stamp in (*stamps, _get(message, "timestamp"), _first_stamp(message)):
        parts = [_get(stamp, key) for key in ("sec", "nanosec", "nsec")]
        seconds, nano = parts[0], next((p for p in parts[1:] if p is not None), 0)
        if isinstance(seconds, int | float) and (seconds or nano):
            return float(seconds) + 1e-9 * float(nano)
    return logged


def _first_stamp(message: Any) -> Any:
    """Returns the stamp of the first of a message's transforms."""
    listed = _get(message, "transforms")
    return _get(_get(listed[0], "header"), "stamp") if listed else None


def _columns(message: Any, root: str) -> dict[str, float]:
    """Returns the numbers of a message by column; none of one that is of no use."""
    names, angles = _get(message, "name"), _get(message, "position")
    if isinstance(names, list) and angles is not None and len(names) == len(angles):
        return {str(n): float(a) for n, a in zip(names, angles, strict=True)}
    moved = _get(message, "transforms") or ([message] if _get(message, "transform") else [])
    for one in moved:
        if _get(one, "child_frame_id") == root:
            transform = _get(one, "transform")
            return _pose(_get(transform, "translation"), _get(transform, "rotation"), BASE)
    pose = _get(message, "pose")
    pose = _get(pose, "pose") or pose
    if _get(pose, "position") is None or _get(pose, "orientation") is None:
        return {}
    frame = str(_get(message, "child_frame_id") or "").lower()
    return _pose(_get(pose, "position"), _get(pose, "orientation"), POSE if frame in _COG else BASE)


def _pose(place: Any, turn: Any, names: Sequence[str]) -> dict[str, float]:
    """Returns place [m] and roll, pitch, yaw [rad] by column."""
    from scipy.spatial.transform import Rotation

    at = [float(_get(place, axis)) for axis in "xyz"]
    angles = Rotation.from_quat([float(_get(turn, axis)) for axis in "xyzw"]).as_euler("ZYX")
    return dict(zip(names, [*at, *angles[::-1].tolist()], strict=True))
