"""Numbers of what bends in a run, and of what it does to the body's rates, from its recording."""

from typing import Any

import numpy as np

from snakegen.simulation.recording.recording import Recording

SHAKING = 5.0  # Hz, from which on a body's rate is no manoeuvre


def vibration_metrics(recording: Recording, start: float, end: float) -> dict[str, Any]:
    """Returns the RMS of all elastic angles about their mean and the modes' mean energy.

    ``elastic_rms_rad`` is ``√ mean_t Σ_e (η − η̄)²``; both are absent where nothing bends. Where
    links bend (their modes stand in meta), `shaking` is added.
    """
    out: dict[str, Any] = {}
    for name, key in (
        ("elastic_angle", "elastic_rms_rad"),
        ("modal_energy", "modal_energy_mean_j"),
    ):
        if name not in recording.channels:
            continue
        time = recording.times(name)
        values = recording.channel(name).values[(time >= start) & (time <= end)]
        if not len(values):
            continue
        if name == "elastic_angle":
            off = values - values.mean(axis=0)
            out[key] = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
        else:
            out[key] = float(values.sum(axis=1).mean())
    if "modal_frequencies_hz" in recording.meta and "angular_velocity" in recording.channels:
        out |= shaking(recording, start, end)
    return out


def shaking(recording: Recording, start: float, end: float) -> dict[str, Any]:
    """Returns where the body's rates shake most, ``body_rate_peak_hz``, and how much.

    ``body_rate_ripple_rad_s`` is the RMS of all three rates together above 5 Hz, of their spectrum
    (Hann); what is faster than half the tick's rate appears mirrored below it, as it does to the
    controller.
    """
    time = recording.times("angular_velocity")
    inside = (time >= start) & (time <= end)
    rate, count = recording.channel("angular_velocity").values[inside], int(inside.sum())
    if count < 8 or not np.all(np.isfinite(rate)):
        return {}
    window = np.hanning(count)[:, None]
    spectrum = np.fft.rfft((rate - rate.mean(axis=0)) * window, axis=0)
    power = 2.0 * np.sum(np.abs(spectrum) ** 2, axis=1) / (count * np.sum(window**2))
    frequency = np.fft.rfftfreq(count, float(time[1] - time[0]))
    power[frequency < SHAKING] = 0.0
    if not power.any():
        return {}
    return {
        "body_rate_peak_hz": float(frequency[np.argmax(power)]),
        "body_rate_ripple_rad_s": float(np.sqrt(power.sum())),
    }
