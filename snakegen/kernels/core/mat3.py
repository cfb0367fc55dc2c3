"""Products of 3-vectors and 3x3 matrices written out: a BLAS call costs more than the arithmetic.

Functions ending in `_into` write to their last argument, which must not be one of the inputs.
"""

from math import cos, sin

from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats


@bare
def matmul_into(a: Floats, b: Floats, out: Floats) -> None:
    """Writes ``a @ b`` of two (3, 3) matrices."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@bare
def turn_into(a: Floats, v: Floats, out: Floats) -> None:
    """Writes ``a @ v`` of a (3, 3) matrix and a (3,) vector."""
    for i in range(3):
        out[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + a[i, 2] * v[2]


@bare
def turn_back_into(a: Floats, v: Floats, out: Floats) -> None:
    """Writes ``a.T @ v`` of a (3, 3) matrix and a (3,) vector."""
    for i in range(3):
        out[i] = a[0, i] * v[0] + a[1, i] * v[1] + a[2, i] * v[2]


@bare
def cross_into(a: Floats, b: Floats, out: Floats) -> None:
    """Writes ``a × b`` of two (3,) vectors."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@bare
def dot(a: Floats, b: Floats) -> float:
    """Returns ``a · b`` of two (3,) vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@bare
def rotation_into(axis: Floats, angle: float, out: Floats) -> None:
    """Writes the rotation about the unit `axis` by `angle` [rad] (Rodrigues)."""
    c, s = cos(angle), sin(angle)
    t = 1.0 - c
    x, y, z = axis[0], axis[1], axis[2]
    out[0, 0], out[0, 1], out[0, 2] = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = t * x * z - s * y, t * y * z + s * x, t * z * z + c
