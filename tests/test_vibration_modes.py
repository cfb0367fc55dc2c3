"""What damping hears of noisy hinge rates: slow modes, led by what the actuators lag behind."""

import numpy as np
import pytest

from snakegen.kernels.control.vibration_damping import SHARPNESS, swinging
from snakegen.kernels.flight.types import Damper


def one_mode(w, lead):
    """A damper of one mode of two hinges; the rest of it is not asked."""
    rows, none = np.empty((0, 3)), np.empty(0, np.int64)
    shape, pull = np.array([[2.0], [-1.0]]), np.array([[0.4, -0.2]])
    places = (none, rows, rows, np.empty((0, 0), np.int64), none, none)
    return Damper(1.0, *places, shape, pull, np.array([w]), np.zeros((2, 1)), lead)


@pytest.mark.parametrize("lead", [0.0, 0.026])
def test_a_mode_passes_led_and_what_is_slower_or_faster_does_not(lead):
    """At ω the observer's output is the mode itself, ahead by atan ωT and larger by its secant."""
    w, dt = 2.0 * np.pi * 3.4, 0.005
    time = np.arange(0.0, 6.0, dt)
    for times, gain in ((1.0, 1.0), (0.05, None), (20.0, None)):
        damper_, out = one_mode(w, lead), []
        for t in time:
            out.append(swinging(damper_, np.array([2.0, -1.0]) * np.cos(times * w * t), dt))
        out = np.array(out)[800:]
        np.testing.assert_allclose(out[:, 0], -2.0 * out[:, 1])
        if gain is None:
            slow = lead * w / SHARPNESS if times < 1.0 else 0.0
            assert np.abs(out[:, 0]).max() < 2.0 * (0.13 + slow)
            continue
        full = np.sqrt(1.0 + (w * lead) ** 2)
        expected = 2.0 * full * np.cos(w * time[800:] + np.arctan(w * lead))
        np.testing.assert_allclose(out[:, 0], expected, atol=0.1)


def test_noise_of_hinge_rates_is_kept_out():
    """White noise of density S through a band l about ω has the variance S l / 2."""
    w, dt = 2.0 * np.pi * 3.4, 0.005
    rng, damper_ = np.random.default_rng(4), one_mode(w, 0.0)
    out = np.array([swinging(damper_, rng.normal(size=2), dt)[1] for _ in range(40000)])
    raw = 0.4**2 + 0.2**2  # variance of the modal speed as measured
    assert out.var() == pytest.approx(raw * dt * (w / SHARPNESS) / 2.0, rel=0.15)
    assert out.var() < 0.12 * raw
