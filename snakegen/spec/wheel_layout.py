"""Where the passive wheels of a screw drum stand and which way their axles point (HA Figs 2-4).

Drum frame: origin at the drum's centre, x along the link (the drum's axis). A wheel at azimuth γ
has radial direction ``e_r = [0, sin γ, -cos γ]`` (γ = 0 touches the ground), tangent
``e_t = x̂ × e_r`` and axle ``cos α x̂ + sin α e_t``: on the ground [cos α, sin α, 0], as in eq 3.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.errors import SpecError

Floats = NDArray[np.float64]

ROLLERS = ("helix_capsule", "ring_sphere", "ellipsoid", "ball")


@dataclass(frozen=True)
class WheelLayout:
    """m = blades · wheels_per_blade wheels, blade by blade, all of one shape, axle along z."""

    position: Floats  # (m, 3) m, wheel centres in the drum frame
    rotation: Floats  # (m, 3, 3) wheel axes in the drum frame: columns e_r, axle × e_r, axle
    blade: NDArray[np.int64]  # (m,) from 1
    wheel: NDArray[np.int64]  # (m,) place on its blade, from 1
    radius: float  # m, across the axle
    half_length: float  # m, along the axle: capsule's cylinder or ellipsoid's semi-axis; 0: sphere

    @property
    def rpy(self) -> Floats:
        """URDF roll, pitch, yaw of each wheel's frame, (m, 3) [rad]: R = Rz(y) Ry(p) Rx(r)."""
        R = self.rotation
        pitch = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 0, 0], R[:, 1, 0]))
        roll = np.arctan2(R[:, 2, 1], R[:, 2, 2])
        return np.column_stack([roll, pitch, np.arctan2(R[:, 1, 0], R[:, 0, 0])])


def _check(alpha: float, radius: float, wheel_radius: float, blades: int, per_blade: int) -> None:
    """Raises SpecError on a drum that cannot drive or cannot be built."""
    if abs(math.sin(alpha)) < 1e-6:
        raise SpecError(
            f"helix angle {math.degrees(alpha) + 0.0:.4g}°: the screw drives nothing; HA uses ±45°."
        )
    if abs(math.cos(alpha)) < 1e-6:
        raise SpecError(
            f"helix angle {math.degrees(alpha):.4g}°: a drum of cross wheels only slides sideways; "
            "HA uses ±45°."
        )
    if not 0 < wheel_radius < 0.5 * radius:
        raise SpecError(
            f"wheel radius {wheel_radius:g} m does not fit a drum of radius {radius:g} m: "
            "it must be positive and less than half of that, or wheels reach the drum's axis."
        )
    if blades < 1 or per_blade < 1 or blades * per_blade < 3:
        raise SpecError(
            f"{blades} blades of {per_blade} wheels leave gaps of more than 120°: "
            "at least 3 wheels round the drum."
        )


def wheel_layout(
    alpha: float,
    radius: float,
    blades: int = 8,
    wheels_per_blade: int = 4,
    rollers: str = "ring_sphere",
    wheel_radius: float = 0.012,
) -> WheelLayout:
    """Returns the wheels of one drum; hand is the sign of α.

    All m wheels are spread evenly in azimuth, so that the ground always meets one. On a helix
    (`helix_capsule`) wheel k of a blade stands at ``x = R_c γ_k / tan α`` along its blade; the
    other two stand in one ring at x = 0. Centres lie at the radius ``R_c`` at which the mean
    height of the drum's centre over flat ground, as it turns, is `radius`.

    Args:
        alpha: helix angle [rad], positive: left hand.
        radius: r, from the drum's centre to the ground [m].
        blades, wheels_per_blade: their counts (HA: 8 and 4).
        rollers: one of ROLLERS; the body of "ball" has the wheels of "ring_sphere", which only its
            MJCF replaces by one ball.
        wheel_radius: of one wheel across its axle [m].

    Raises:
        SpecError: α = 0 or ±90°, a wheel larger than the drum, too few wheels, unknown rollers.
    """
    if rollers not in ROLLERS:
        raise SpecError(f"rollers '{rollers}' are unknown; one of {', '.join(ROLLERS)}.")
    _check(alpha, radius, wheel_radius, blades, wheels_per_blade)
    m = blades * wheels_per_blade
    index = np.arange(m)
    blade, place = index // wheels_per_blade, index % wheels_per_blade
    step = 2 * np.pi / m
    half_length = _half_length(rollers, alpha, radius, wheel_radius, step)
    centre = _centre_radius(rollers, alpha, radius, wheel_radius, half_length, step)
    offset = (place - (wheels_per_blade - 1) / 2) * step
    azimuth = blade * wheels_per_blade * step + offset
    x = centre * offset / math.tan(alpha) if rollers == "helix_capsule" else np.zeros(m)
    zero = np.zeros(m)
    radial = np.column_stack([zero, np.sin(azimuth), -np.cos(azimuth)])
    tangent = np.column_stack([zero, np.cos(azimuth), np.sin(azimuth)])
    axle = np.column_stack([np.full(m, math.cos(alpha)), math.sin(alpha) * tangent[:, 1:]])
    position = np.column_stack([x, centre * radial[:, 1:]])
    rotation = np.stack([radial, np.cross(axle, radial), axle], axis=-1).reshape(m, 3, 3)
    return WheelLayout(position, rotation, blade + 1, place + 1, wheel_radius, half_length)


def _half_length(
    rollers: str, alpha: float, radius: float, wheel_radius: float, step: float
) -> float:
    """Returns a wheel's half length along its axle [m].

    An ellipsoid of semi-axes b, b, a rolls round without a ripple of second order where
    ``a² = b² + b (r - b)/sin²α``; a capsule reaches half way to the next one on its blade.
    """
    if rollers == "ellipsoid":
        b = wheel_radius
        return math.sqrt(b * b + b * (radius - b) / math.sin(alpha) ** 2)
    if rollers == "helix_capsule":
        return 0.5 * (radius - wheel_radius) * step / abs(math.sin(alpha)) * 0.5
    return 0.0


def _height(
    rollers: str, alpha: float, rho: float, half: float, centre: float, g: Floats
) -> Floats:
    """Returns the drum's height over ground that touches the wheel at azimuth g [m]."""
    tilt = np.sin(g) * math.sin(alpha)
    if rollers == "ellipsoid":
        return centre * np.cos(g) + np.sqrt(rho * rho + (half * half - rho * rho) * tilt**2)
    return centre * np.cos(g) + rho + half * np.abs(tilt)


def _centre_radius(
    rollers: str, alpha: float, radius: float, rho: float, half: float, step: float
) -> float:
    """Returns the radius of the wheels' centres that makes the mean height equal `radius` [m]."""
    g = np.linspace(-step / 2, step / 2, 201)
    centre = radius - rho
    for _ in range(4):
        centre += radius - float(_height(rollers, alpha, rho, half, centre, g).mean())
    return centre
