"""Numbers of what bends in a run, from its recording alone."""

from typing import Any

import numpy as np

from snakegen.verify.recording import Recording


def vibration_metrics(recording: Recording, start: float, end: float) -> dict[str, Any]:
    """Returns the RMS of all elastic angles about their mean and the modes' mean energy.

    ``elastic_rms_rad`` is ``√ mean_t Σ_e (η − η̄)²``; both are absent where nothing bends.
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
    return out
