"""Tracking law of a screw drive (HA eq 7), pure: state and reference in, rates out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.analysis.screw_drive import wheel_rates

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ScrewLaw:
    """``u = B⁻¹ A(w) (ẇ_d - K (w - w_d))``, either part of which may be left out.

    Without feedback nothing is measured, so A is taken at w_d: HA's feedforward (Fig 11). Where a
    rate would exceed its limit the whole input is scaled down, which keeps the direction of
    travel; clipping each screw alone would turn the body.
    """

    alpha: tuple[float, ...]  # (n,) rad
    r: float  # m
    L0: float  # m
    L1: float  # m
    L2: float  # m
    gain: float | tuple[float, ...]  # K, 1/s: scalar or diagonal (n + 2,)
    feedforward: bool = True
    feedback: bool = True
    screw_rate: float = np.inf  # rad/s
    joint_rate: float = np.inf  # rad/s

    def command(self, w: Floats, w_d: Floats, w_d_dot: Floats) -> Floats:
        """Returns u (2n - 1,) [rad/s] for the state w, the reference w_d and its rate, (n + 2,)."""
        rate = w_d_dot if self.feedforward else np.zeros_like(w_d)
        state = w if self.feedback else w_d
        u = wheel_rates(state, w_d, rate, self.gain, self.alpha, self.r, self.L0, self.L1, self.L2)
        n = len(self.alpha)
        excess = max(
            1.0,
            float(np.abs(u[:n]).max()) / self.screw_rate,
            float(np.abs(u[n:]).max()) / self.joint_rate,
        )
        return u / excess
