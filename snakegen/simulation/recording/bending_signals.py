"""Signals of what bends in a run: deflections of hinges, and the energy of the lowest modes."""

from typing import NamedTuple

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.simulation.flight.elastic import elastic_modes, stiffnesses
from snakegen.simulation.flight.vibration import Hinges, hinges
from snakegen.simulation.flight.world import World
from snakegen.simulation.recording.recording import Channel, channel

MODES = 6  # lowest ones, whose energy is recorded
PERIODS = 2.0  # of a mode, over which its slow part is taken


class RecordedModes(NamedTuple):
    """The lowest modes of the hinges on a free body, gimbals held: k modes of e hinges."""

    hinges: Hinges
    frequency: Floats  # (k,) Hz
    pull: Floats  # (e, k): angles of hinges to ω² times those of modes


def recorded_modes(world: World, qpos: Floats) -> RecordedModes:
    """Returns the modes whose energy is recorded, at a configuration (nq,) of MuJoCo."""
    found = hinges(world)
    frequency, shape = elastic_modes(world.model, qpos, found.dof)
    count = min(MODES, len(frequency))
    pull = stiffnesses(world.model)[found.dof, None] * shape[:, :count]
    return RecordedModes(found, frequency[:count], pull)


def bending(
    modes: RecordedModes, qpos: Floats, qvel: Floats, command: Floats, before: Floats, dt: float
) -> tuple[Floats, Floats, Floats]:
    """Returns the deflection (T, e) of every hinge, and angles and rates (T, k) of its modes.

    A servo's deflection is its angle less the one asked for.

    Args:
        modes: recorded.
        qpos, qvel: rows (T, ·) of states.
        command: (T, s) rad, asked of the servos that shape the body.
        before: (s,) asked before the first row.
        dt: s, between two rows.
    """
    found = modes.hinges
    angle, rate = qpos[:, found.qpos], qvel[:, found.dof]
    asked = np.diff(command, axis=0, prepend=before[None]) / dt
    for e in np.flatnonzero(found.servo >= 0):
        angle[:, e] -= command[:, found.servo[e]]
        rate[:, e] -= asked[:, found.servo[e]]
    square = (2.0 * np.pi * modes.frequency) ** 2
    return angle, angle @ modes.pull / square, rate @ modes.pull / square


def modal_energy(
    modes: RecordedModes, place: Floats, speed: Floats, dt: float, part: slice
) -> Floats:
    """Returns the energy (n, k) [J] of each mode in some rows.

    That of mode i is ``½ (ȧ² + ω² a²)``, ``a = φᵀ K η / ω²`` with ``φᵀ M φ = 1``, less the mean of
    a over two periods around each instant: what bends slowly, as thrusts change, does not vibrate.

    Args:
        modes: recorded.
        place, speed: (T, k) of `bending`.
        dt: s, between two rows.
        part: the rows.
    """
    swing = np.array(place[part])
    for i, frequency in enumerate(modes.frequency):
        width = round(PERIODS / (frequency * dt))
        first = max(part.start - max(width // 2, 1), 0)
        around = place[first : part.stop + max(width // 2, 1), i]
        mean = running_mean(around, width)
        swing[:, i] -= mean[part.start - first :][: len(swing)]
    square = (2.0 * np.pi * modes.frequency) ** 2
    return np.asarray(0.5 * (speed[part] ** 2 + square * swing**2))


def angle_channel(modes: RecordedModes, angle: Floats) -> Channel:
    """Returns the channel of every hinge's deflection (T, e)."""
    return channel("elastic_angle", angle, modes.hinges.names)


def energy_channel(modes: RecordedModes, energy: Floats) -> Channel:
    """Returns the channel of each mode's energy (T, k)."""
    labels = [f"mode {i + 1}, {f:.1f} Hz" for i, f in enumerate(modes.frequency)]
    return channel("modal_energy", energy, labels)


def elastic_channels(
    world: World, qpos: Floats, qvel: Floats, command: Floats, dt: float
) -> dict[str, Channel]:
    """Returns the channels of what bends in a whole run, its modes those at the first row.

    Args:
        world: flown in.
        qpos, qvel: rows (T, ·) of states.
        command: (T, k) rad, asked of the servos that shape the body.
        dt: s, between two rows.
    """
    modes = recorded_modes(world, qpos[0])
    angle, place, speed = bending(modes, qpos, qvel, command, command[0], dt)
    energy = modal_energy(modes, place, speed, dt, slice(0, len(place)))
    return {
        "elastic_angle": angle_channel(modes, angle),
        "modal_energy": energy_channel(modes, energy),
    }


def running_mean(values: Floats, width: int) -> Floats:
    """Returns the mean (T,) over about `width` rows around each row, over fewer at the ends."""
    half = max(width // 2, 1)
    total = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(values))
    return np.asarray((total[high] - total[low]) / (high - low))
