"""The forces that an apparatus can turn to: all, a plane or a line, by how many gimbals it has."""

import numpy as np

from snakegen.kernels.allocation.gimbals import AXIS, FIRST, SECOND, turned_into
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import dot, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats


@bare
def confinement_into(m: Floats, angles: Floats, out: Floats) -> None:
    """Writes projectors (Ñ, 3, 3), CoG axes, onto the forces that each apparatus can turn to.

    All of space with two gimbal axes, the plane across the axis with one, the line with none.
    """
    u, once, twice, elbow = scratch(3), scratch((3, 3)), scratch((3, 3)), scratch(3)
    for j in range(m.shape[0]):
        one, two = dot(m[j, FIRST], m[j, FIRST]) > 0.5, dot(m[j, SECOND], m[j, SECOND]) > 0.5
        if one and two:
            for k in range(3):
                for i in range(3):
                    out[j, k, i] = 1.0 if k == i else 0.0
            continue
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        if two:
            turn_into(once, m[j, SECOND], u)
            across_into(u, out[j])
        else:
            turn_into(twice, m[j, AXIS], u)
            along_into(u, out[j])


@jit
def confinement(m: Floats, angles: Floats) -> Floats:
    """Returns the projectors (Ñ, 3, 3) of `confinement_into`."""
    out = np.empty((m.shape[0], 3, 3))
    confinement_into(m, angles, out)
    return out


@bare
def along_into(u: Floats, out: Floats) -> None:
    """Writes the projector (3, 3) onto the line along unit u."""
    for i in range(3):
        for k in range(3):
            out[i, k] = u[i] * u[k]


@bare
def across_into(u: Floats, out: Floats) -> None:
    """Writes the projector (3, 3) onto the plane across unit u."""
    for i in range(3):
        for k in range(3):
            out[i, k] = -u[i] * u[k]
        out[i, i] += 1.0
