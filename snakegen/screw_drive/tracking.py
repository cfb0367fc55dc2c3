"""Tracking law of a screw drive (HA eq 7), pure: state and reference in, rates out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.screw_drive.kinematics import ScrewGeometry

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ScrewLaw:
    """``u = B⁻¹ A(w) (ẇ_d - K (w - w_d))``, either part of which may be left out.

    Without feedback nothing is measured, so A is taken at w_d: HA's feedforward (Fig 11). Where a
    rate would exceed its limit the whole input is scaled down, which keeps the direction of
    travel; clipping each screw alone would turn the body.
    """

    geometry: ScrewGeometry
    gain: float | tuple[float, ...]  # K, 1/s: scalar or diagonal (m + 2,)
    feedforward: bool = True
    feedback: bool = True
    screw_rate: float = np.inf  # rad/s
    joint_rate: float = np.inf  # rad/s

    def command(self, w: Floats, w_d: Floats, w_d_dot: Floats) -> Floats:
        """Returns u (n + m - 1,) [rad/s] for the state w, the reference and its rate, (m + 2,)."""
        g, state = self.geometry, w if self.feedback else w_d
        wish = np.zeros_like(w_d)
        if self.feedforward:
            wish = wish + w_d_dot
        if self.feedback:
            wish = wish - np.asarray(self.gain) * (w - w_d)
        screws, joints = g.no_slip(state) @ wish / g.drive(), wish[3:]
        excess = max(
            1.0,
            float(np.abs(screws).max()) / self.screw_rate,
            float(np.abs(joints).max(initial=0.0)) / self.joint_rate,
        )
        return np.concatenate([screws, joints]) / excess
