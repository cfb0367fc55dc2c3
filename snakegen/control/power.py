"""Electric power of rotors, and the battery that gives it."""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot

FIGURE_OF_MERIT = 0.6  # share of the ideal power that becomes thrust (assumed)
AIR = 1.2  # kg/m³, of the power model
JOULES = 3600.0  # a watt-hour


def power_factors(robot: Robot) -> Floats:
    """Returns c (n_rotors,) [W N^-1.5] of the electric power ``P = Σ c T^1.5``.

    Momentum theory's ideal power ``T^1.5 / √(2 ρ A)`` over a figure of merit of 0.6 (assumed); of
    a rotor in the stream of another on its body that of the thrust it would have in still air.
    """
    rotors = [r for a in robot.modules.apparatuses for r in a.rotors]
    area = np.pi * (0.5 * np.array([r.diameter for r in rotors])) ** 2
    share = np.array([r.stream_efficiency for r in rotors])  # T / share in still air
    return np.asarray(1.0 / (FIGURE_OF_MERIT * np.sqrt(2.0 * AIR * area) * share**1.5))


def battery_joules(watt_hours: float) -> float:
    """Returns the energy [J] of a battery of so many Wh; inf for 0, which never empties."""
    return JOULES * watt_hours if watt_hours > 0 else float("inf")
