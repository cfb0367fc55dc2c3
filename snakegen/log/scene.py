"""Where everything in a run's picture is: robot, target ghost, rotors, and how far to stand off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snakegen.log import skeleton as sk
from snakegen.log import style
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.signals import stored

Floats = NDArray[np.float64]


class Rotor(NamedTuple):
    """A rotor whose thrust is drawn."""

    column: int  # in the channel `thrust`
    label: str
    link: str
    axis: Floats  # (3,) thrust direction in the link's frame
    position: Floats  # (3,) m, in the link's frame


@dataclass(frozen=True)
class Scene:
    """A run seen from its skeleton: what is drawn where, at the instants `time`."""

    time: Floats  # (F,) s
    skeleton: sk.Skeleton | None
    base: sk.Poses  # of the root link
    angles: dict[str, Floats]  # (F,) per joint
    rotors: tuple[Rotor, ...]
    ghost: Floats  # (F, n, 3) m, the body's line at its target; n = 0 where there is none
    size: float  # m, length of the body
    center: Floats  # (3,) m, middle of everything drawn
    radius: float  # m, around it
    newton: float  # m an arrow is long, per newton


def scene(recording: Recording) -> Scene:
    """Works out where things are; arrays of the drawn instants only."""
    index = style.frames(recording.time)
    time = recording.time[index]
    urdf = recording.meta.get("urdf")
    bones = sk.skeleton(urdf) if urdf and "q" in recording.channels else None
    base: sk.Poses = (np.broadcast_to(np.eye(3), (len(time), 3, 3)), np.zeros((len(time), 3)))
    angles: dict[str, Floats] = {}
    lines = np.empty((len(time), 0, 3))
    if bones is not None:
        labels, q = recording.channel("q").labels, last_finite(recording.held("q", time))
        base, angles = sk.base_poses(labels, q), sk.joint_angles(labels, q)
        lines = bones.body_line(base, angles)
    ghost = _ghost(recording, bones, time, base, angles)
    clouds = [lines.reshape(-1, 3), ghost.reshape(-1, 3)]
    if "position" in recording.channels:
        clouds.append(recording.held("position", time))
    first = lines[0] if lines.shape[1] else np.zeros((1, 3))
    size = float(np.sum(np.linalg.norm(np.diff(first, axis=0), axis=1))) or 1.0
    rotors, newton = _rotors(recording, bones), _newton(recording, size)
    high = np.zeros(3)
    if rotors:  # the arrows stand over the body
        most = max(
            float(np.max(given, where=np.isfinite(given), initial=0.0))
            for _, given in stored(recording, "thrust").pieces()
        )
        high[2] = newton * most
    middle, radius = _sphere([*clouds, clouds[0] + high] if rotors else clouds)
    return Scene(
        time,
        bones,
        base,
        angles,
        rotors,
        ghost,
        size,
        middle,
        max(radius, 0.5 * size),
        newton,
    )


def _sphere(clouds: list[Floats]) -> tuple[Floats, float]:
    """Returns the middle (3,) of points (n, 3) of some clouds, and how far they are from it [m]."""
    finite = [cloud[np.all(np.isfinite(cloud), axis=1)] for cloud in clouds]
    kept = [cloud for cloud in finite if len(cloud)] or [np.zeros((1, 3))]
    low = np.min([cloud.min(axis=0) for cloud in kept], axis=0)
    middle = 0.5 * (low + np.max([cloud.max(axis=0) for cloud in kept], axis=0))
    return middle, max(float(np.linalg.norm(cloud - middle, axis=1).max()) for cloud in kept)


def last_finite(values: Floats) -> Floats:
    """Returns `values` (T, k), each row that is not finite replaced by the last that was.

    A run that diverged is drawn standing where it was last seen.
    """
    good = np.all(np.isfinite(values), axis=1)
    if good.all():
        return values
    if not good.any():
        return np.zeros_like(values)
    row = np.maximum.accumulate(np.where(good, np.arange(len(values)), 0))
    return values[np.maximum(row, np.argmax(good))]


def thrust_use(recording: Recording, thrust: Floats) -> Floats:
    """Returns thrust / limit (0 where the run states no limit)."""
    upper = recording.meta.get("limits", {}).get("thrust_max")
    return np.zeros_like(thrust) if upper is None else thrust / np.asarray(upper, float)


def _rotors(recording: Recording, bones: sk.Skeleton | None) -> tuple[Rotor, ...]:
    """Returns the rotors that the URDF has; without a list, thrusts are named as their links."""
    if bones is None or "thrust" not in recording.channels:
        return ()
    links = {bones.root, *(j.child for j in bones.joints)}
    labels = recording.channel("thrust").labels
    listed = recording.meta.get("rotors") or [{"link": label} for label in labels]
    rotors = []
    for i, (rotor, label) in enumerate(zip(listed, labels, strict=False)):
        if rotor["link"] in links:
            axis = np.asarray(rotor.get("axis", (0.0, 0.0, 1.0)), float)
            place = np.asarray(rotor.get("position", (0.0, 0.0, 0.0)), float)
            rotors.append(Rotor(i, label, rotor["link"], axis, place))
    return tuple(rotors)


def _newton(recording: Recording, size: float) -> float:
    """Returns metres an arrow per newton: the largest thrust is a quarter of the body, ≤ 0.5 m."""
    upper = recording.meta.get("limits", {}).get("thrust_max")
    if upper is None and "thrust" in recording.channels:
        upper = [np.nanmax(given) for _, given in stored(recording, "thrust").pieces()]
    largest = float(np.max(upper)) if upper is not None else recording.meta.get("weight_n", 10.0)
    return min(0.25 * size, 0.5) / max(largest, 1e-9)


def _ghost(
    recording: Recording,
    bones: sk.Skeleton | None,
    time: Floats,
    base: sk.Poses,
    angles: dict[str, Floats],
) -> Floats:
    """Returns the body's line where position, attitude and joints should be.

    The CoG's place in the root link is the one it has now, which is exact while the joints
    follow their commands.
    """
    wanted = {"position", "position_target", "attitude", "attitude_target"}
    if bones is None or not wanted <= recording.channels.keys():
        return np.empty((len(time), 0, 3))
    place = {name: last_finite(recording.held(name, time)) for name in wanted}
    now = sk.rotations_from_xyzw(place["attitude"])
    goal = sk.rotations_from_xyzw(place["attitude_target"])
    turn = goal @ np.swapaxes(now, 1, 2)
    lever = base[1] - place["position"]
    at = place["position_target"] + np.einsum("tij,tj->ti", turn, lever)
    asked = dict(angles)
    if "joint_command" in recording.channels:
        command = recording.channel("joint_command")
        asked.update(zip(command.labels, recording.held("joint_command", time).T, strict=True))
    return bones.body_line((turn @ base[0], at), asked)
