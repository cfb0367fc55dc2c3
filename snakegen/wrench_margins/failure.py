"""Margins with one rotor, or one apparatus, removed (THEORY A4, `failure`)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from snakegen.errors import AnalysisError
from snakegen.wrench_margins import inputs
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.thrust import ThrustMargins, thrust_margins
from snakegen.wrench_margins.vectored import VectoredMargins, set_margins


@dataclass(frozen=True)
class Failure:
    """One line of the table: what is lost ("rotor" or "apparatus", its index) and what is left."""

    part: str
    index: int
    margins: ThrustMargins | VectoredMargins


def thrust_failures(
    allocation: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    hover_wrench: ArrayLike,
    apparatus: ArrayLike | None = None,
    *,
    force_scale: float,
    torque_scale: float,
) -> list[Failure]:
    """Returns the margins with each rotor, and each apparatus, of ``W = {Q λ}`` removed.

    Args:
        apparatus: (n,) index of each rotor's apparatus; by default rotors fail alone only.
        allocation, lower, upper, hover_wrench, force_scale, torque_scale: as `thrust_margins`,
            one posture.

    Raises:
        AnalysisError: as `thrust_margins`; `apparatus` of another length or not whole numbers.
    """
    q = inputs.array("Q", allocation, (6, None))
    n = q.shape[1]
    cases = [("rotor", j, np.arange(n) == j) for j in range(n)]
    if apparatus is not None:
        owner = inputs.array("apparatus", apparatus, (n,))
        if (owner != np.round(owner)).any():
            raise AnalysisError(
                "apparatus holds numbers that are not whole: it is a list of indices."
            )
        cases += [("apparatus", int(k), owner == k) for k in np.unique(owner)]
    stack = np.array([np.where(lost, 0.0, q) for _, _, lost in cases]).reshape(-1, 6, n)
    margins = thrust_margins(
        stack, lower, upper, hover_wrench, force_scale=force_scale, torque_scale=torque_scale
    )
    return [Failure(part, index, margins[i]) for i, (part, index, _) in enumerate(cases)]


def vectored_failures(
    sets: ForceSets,
    hover_wrench: ArrayLike,
    *,
    force_scale: float,
    torque_scale: float,
    tolerance: float = 1e-3,
) -> list[Failure]:
    """Returns the margins with each apparatus removed.

    In virtual-single-rotor mode both rotors of an apparatus push alike, so a lost rotor is a lost
    apparatus. Arguments and errors: as `set_margins`, one posture.
    """
    table = []
    for j in range(len(sets)):
        left = set_margins(
            sets.without(j),
            hover_wrench,
            force_scale=force_scale,
            torque_scale=torque_scale,
            tolerance=tolerance,
        )
        table.append(Failure("apparatus", j, left))
    return table
