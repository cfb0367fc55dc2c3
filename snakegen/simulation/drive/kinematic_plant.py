"""The kinematic plant of a screw drive: wheels that do not slip, the law asked at every stage.

HA section IV. With a perfect model the closed loop is ``ė = -K e`` exactly (eq 8), so what this
plant proves is the law's consistency; `screw_contact` proves the model.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.sample_store import RowStore
from snakegen.screw_drive.ground_paths import Reference
from snakegen.screw_drive.kinematics import ScrewGeometry, state_rate

Floats = NDArray[np.float64]
Law = Callable[[Floats, Floats, Floats], Floats]


@dataclass(frozen=True)
class DriveRun:
    """Samples of a drive along a reference, one row per time step."""

    time: Floats  # (m,) s
    state: Floats  # (m, n + 2)
    desired: Floats  # (m, n + 2)
    command: Floats  # (m, 2n - 1) rad/s
    slip: Floats  # (m, n) m/s of each drum over the ground; kinematic: along its wheels' axles

    @property
    def error(self) -> Floats:
        """e = w - w_d, (m, n + 2)."""
        return self.state - self.desired

    def position_rmse(self, after: float = 0.0) -> float:
        """Returns the RMS distance of P from its reference for t > `after` [m]."""
        late = self.error[self.time > after, :2]
        return float(np.sqrt((late**2).sum(axis=1).mean()))


def drive_kinematic(
    law: Law,
    reference: Reference,
    geometry: ScrewGeometry,
    start: ArrayLike,
    duration: float,
    dt: float = 0.005,
) -> DriveRun:
    """Integrates the plant by RK4 with the law asked at every stage, from w(0) = `start`.

    Args:
        law: (w, w_d, ẇ_d) → u.
        reference: what to follow.
        geometry: the plant's own.
        start: w(0) (m + 2,), m links.
        duration: [s].
        dt: step [s]; the error law holds to the fourth power of K dt.
    """

    def rate(t: float, w: Floats) -> Floats:
        return state_rate(w, law(w, *reference.at(t)), geometry)[0]

    steps = round(duration / dt)
    w, rows = np.array(start, float), RowStore(steps + 1)
    for k in range(steps + 1):
        t = k * dt
        desired, desired_rate = reference.at(t)
        u = law(w, desired, desired_rate)
        k1, slip = state_rate(w, u, geometry)
        rows.add(time=t, state=w, desired=desired, command=u, slip=slip)
        k2 = rate(t + dt / 2, w + dt / 2 * k1)
        k3 = rate(t + dt / 2, w + dt / 2 * k2)
        k4 = rate(t + dt, w + dt * k3)
        w = w + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return DriveRun(**rows.arrays())
