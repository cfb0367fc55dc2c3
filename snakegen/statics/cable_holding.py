"""Which tensions hold a posture: balanced loads and a stiffness that has no negative eigenvalue."""

from dataclasses import dataclass

import numpy as np

from snakegen.base.describe_motion import canonical_basis
from snakegen.base.geometry import Floats
from snakegen.robot.robot import Robot
from snakegen.statics.cable_stiffness import CableGeometry, PointLoad, load_stiffness

_CUTS = 400  # of the stability program
_LEAST = 1e-6  # of the largest eigenvalue: below, a posture counts as free to move
_ALIKE = 1e-9  # of the largest eigenvalue: closer ones are one eigenvalue


@dataclass(frozen=True)
class Stiffness:
    """Stiffness of joints that cables hold, by their tension: ``K(t) = E + L + Σ t_c G_c``.

    Attributes:
        arms: (k, c) m, torque over the tension at the winch.
        elastic: (k, k) N·m/rad, of cables and winches, all cables taut.
        loads: (k, k) N·m/rad, of weight and loads.
        tension: (c, k, k) m, of a tension of 1 N in each cable.
        cable: (c,) N/m, of each cable with its winch.
    """

    arms: Floats
    elastic: Floats
    loads: Floats
    tension: Floats
    cable: Floats

    def matrix(self, tension: Floats) -> Floats:
        """Returns K (k, k) [N·m/rad] at `tension` (c,) N; a slack cable adds no elasticity."""
        slack = tension <= 0.0
        elastic = self.elastic
        if np.any(slack):
            a = self.arms[:, slack]
            elastic = elastic - (a * self.cable[slack]) @ a.T
        bent = np.tensordot(tension, self.tension, axes=1)
        return np.asarray(elastic + self.loads + 0.5 * (bent + bent.T))

    def softest(self, tension: Floats) -> tuple[float, Floats]:
        """Returns the least eigenvalue of K [N·m/rad] and its unit direction (k,).

        Of an eigenvalue that several directions share, the one nearest to a joint's axis.
        """
        values, vectors = np.linalg.eigh(self.matrix(tension))
        shared = values - values[0] <= _ALIKE * float(np.abs(values).max())
        return float(values[0]), canonical_basis(vectors[:, shared], tuple(range(len(values))))[
            :, 0
        ]

    @property
    def threshold(self) -> float:
        """The least eigenvalue [N·m/rad] with which a posture counts as held."""
        return _LEAST * float(np.linalg.eigvalsh(self.elastic)[-1])


def stiffness_of(
    robot: Robot,
    geometry: CableGeometry,
    *,
    gravity: Floats,
    loads: tuple[PointLoad, ...] = (),
    winch: float,
    elasticity: float = np.inf,
) -> Stiffness:
    """Returns the stiffness of a posture.

    With friction the elastic part is ``k a_μ a_0ᵀ`` (a cable that slides through its holes), its
    symmetric part taken: eigenvalues of that bound those of the whole from below.

    Args:
        robot: whose weight.
        geometry: of the cables in the posture.
        gravity: (3,) m/s².
        loads: that keep their direction.
        winch: N/m, stiffness of a winch.
        elasticity: N, EA of a cable; its own stiffness is EA over its length.
    """
    length = np.zeros(geometry.count)
    np.add.at(length, geometry.cable, geometry.size)
    cable = 1.0 / (1.0 / winch + length / elasticity)
    arms = geometry.arms()
    straight = geometry.arms(np.ones_like(geometry.share))
    elastic = (arms * cable) @ straight.T
    return Stiffness(
        arms,
        0.5 * (elastic + elastic.T),
        load_stiffness(robot, geometry.chain, gravity, loads, geometry.joints),
        geometry.tension_stiffness(),
        cable,
    )


def least_holding_tension(
    stiffness: Stiffness, torque: Floats, minimum: float, maximum: float, margin: float = 0.0
) -> Floats | None:
    """Returns the tensions (c,) [N] of least sum that balance and hold, or None where none do.

    ``min Σt`` with ``A t = τ``, ``minimum ≤ t ≤ maximum`` and ``K(t) - margin I`` positive: a
    semidefinite program, solved by linear ones with a cut ``vᵀ K(t) v ≥ margin`` along each
    eigenvector that has been found soft. None is proved by the last of them, unless it ran out of
    cuts.

    Args:
        stiffness: of the posture.
        torque: (k,) N·m, wanted of the cables.
        minimum, maximum: N; minimum above 0, or cables go slack.
        margin: N·m/rad, the least eigenvalue asked for.
    """
    from scipy.optimize import linprog

    count = stiffness.arms.shape[1]
    minimum = max(minimum, 1e-6)  # what is slack adds no elasticity
    bounds = [(minimum, None if np.isinf(maximum) else maximum)] * count
    aim = max(margin, 2.0 * stiffness.threshold)
    fixed = stiffness.elastic + stiffness.loads
    rows: list[Floats] = []
    right: list[float] = []
    for _ in range(_CUTS):
        found = linprog(
            np.ones(count),
            A_ub=np.array(rows) if rows else None,
            b_ub=np.array(right) if rows else None,
            A_eq=stiffness.arms,
            b_eq=torque,
            bounds=bounds,
            method="highs",
        )
        if found.status != 0:
            return None
        t = np.asarray(found.x)
        values, vectors = np.linalg.eigh(stiffness.matrix(t))
        if values[0] >= max(margin, stiffness.threshold):
            return t
        for v in vectors[:, values < aim].T:
            rows.append(-np.einsum("i,cij,j->c", v, stiffness.tension, v))
            right.append(float(v @ fixed @ v) - aim)
    return None


def holding_limit(
    stiffness: Stiffness, torque: Floats, minimum: float, maximum: float, steps: int = 30
) -> float:
    """Returns the highest least tension [N] at which some tensions still balance and hold.

    Bisected between 0 and four times the tensions in question; its safe, lower side. nan where not
    even the slightest tension holds, inf where the highest one tried does.

    Args:
        stiffness: of the posture.
        torque: (k,) N·m, wanted of the cables.
        minimum, maximum: N, as asked for.
        steps: of the bisection.
    """

    def holds(least: float) -> bool:
        return least_holding_tension(stiffness, torque, least, maximum) is not None

    slight = 1e-6 * max(1.0, minimum)
    if not holds(slight):
        return float("nan")
    low, high = slight, min(maximum, 4.0 * max(minimum, 50.0))
    if holds(high):
        return high if np.isfinite(maximum) and high == maximum else float("inf")
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
        if high - low < 1e-3 * high:
            break
    return low
