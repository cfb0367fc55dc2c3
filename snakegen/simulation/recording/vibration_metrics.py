"""Numbers of what bends in a run, and of what it does to the body's rates, from its recording."""

from typing import Any

import numpy as np

from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.row_statistics import RunningMean
from snakegen.simulation.recording.signals import Signal, is_finite, stored

SHAKING = 5.0  # Hz, from which on a body's rate is no manoeuvre


def vibration_metrics(recording: Recording, start: float, end: float) -> dict[str, Any]:
    """Returns the RMS of all elastic angles about their mean and the modes' mean energy.

    ``elastic_rms_rad`` is ``√ mean_t Σ_e (η − η̄)²``; both are absent where nothing bends. Where
    links bend (their modes stand in meta), `shaking` is added.
    """
    out: dict[str, Any] = {}
    if "elastic_angle" in recording.channels:
        angles = stored(recording, "elastic_angle")
        middle = _mean(angles, start, end)
        if middle is not None:
            off = Signal(
                angles.time, lambda part: (angles.rows(part) - middle) ** 2, angles.release
            )
            out["elastic_rms_rad"] = float(np.sqrt(np.sum(_mean(off, start, end))))
    if "modal_energy" in recording.channels:
        energy = _mean(stored(recording, "modal_energy"), start, end)
        if energy is not None:
            out["modal_energy_mean_j"] = float(energy.sum())
    if "modal_frequencies_hz" in recording.meta and "angular_velocity" in recording.channels:
        out |= shaking(recording, start, end)
    return out


def _mean(signal: Signal, start: float, end: float) -> Any:
    """Returns the mean (k,) of a signal from `start` to `end` [s]; None without rows."""
    mean = RunningMean()
    for _, values in signal.pieces(start, end):
        mean.add(values)
    return mean.value()


def shaking(recording: Recording, start: float, end: float) -> dict[str, Any]:
    """Returns where the body's rates shake most, ``body_rate_peak_hz``, and how much.

    ``body_rate_ripple_rad_s`` is the RMS of all three rates together above 5 Hz, of their spectrum
    (Hann); what is faster than half the tick's rate appears mirrored below it, as it does to the
    controller.
    """
    time = recording.times("angular_velocity")
    inside = (time >= start) & (time <= end)
    count = int(inside.sum())
    if count < 8 or not is_finite(recording, "angular_velocity"):
        return {}
    window, power = np.hanning(count), np.zeros(count // 2 + 1)
    for axis in range(3):  # one by one: a long run's spectra are large
        rate = recording.channel("angular_velocity").values[inside, axis]
        power += np.abs(np.fft.rfft((rate - rate.mean()) * window)) ** 2
        recording.release()
    power *= 2.0 / (count * np.sum(window**2))
    frequency = np.fft.rfftfreq(count, float(time[1] - time[0]))
    power[frequency < SHAKING] = 0.0
    if not power.any():
        return {}
    return {
        "body_rate_peak_hz": float(frequency[np.argmax(power)]),
        "body_rate_ripple_rad_s": float(np.sqrt(power.sum())),
    }
