"""Sublinear functions of a direction as tables that never lie below them.

A support function, its rotations, sums and maxima are sublinear: ``f(a x + b y) ≤ a f(x) + b f(y)``
for a, b ≥ 0. So on the faces of a cube, where f is kept at grid points, bilinear interpolation is
an upper bound (Jensen), off by the square of the spacing alone; and over an arc the corners of the
polygon about it bound f, for the arc lies in their hull.
"""

from math import ceil, cos, sin

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.types import Floats


@jit
def read_table(table: Floats, x: float, y: float, z: float) -> float:
    """Returns the upper bound of f at (x, y, z) from a table (6, m + 1, m + 1).

    Face 2 k + (1 if negative) has coordinate k at ±1; its rows and columns are the next two
    coordinates, from -1 to 1.
    """
    a, b, c = abs(x), abs(y), abs(z)
    if a >= b and a >= c:
        face, size, u, v = (0 if x > 0 else 1), a, y, z
    elif b >= c:
        face, size, u, v = (2 if y > 0 else 3), b, z, x
    else:
        face, size, u, v = (4 if z > 0 else 5), c, x, y
    if size == 0.0:
        return 0.0
    m = table.shape[1] - 1
    row, column = 0.5 * m * (1.0 + u / size), 0.5 * m * (1.0 + v / size)
    i, j = min(int(row), m - 1), min(int(column), m - 1)
    s, t = row - i, column - j
    low = (1.0 - t) * table[face, i, j] + t * table[face, i, j + 1]
    high = (1.0 - t) * table[face, i + 1, j] + t * table[face, i + 1, j + 1]
    return size * ((1.0 - s) * low + s * high)


@jit
def highest(
    table: Floats, d: Floats, mount: Floats, axis: Floats, lower: float, upper: float, step: float
) -> float:
    """Returns an upper bound of f over ``Rot(axis, θ)ᵀ mountᵀ d``, lower ≤ θ ≤ upper.

    Args:
        table: of f, in the turning body's frame.
        d: (3,) direction in the frame that carries the joint.
        mount: (3, 3) joint frame in that frame at θ = 0.
        axis: (3,) unit, in both.
        lower, upper: rad.
        step: rad, between corners of the polygon about the arc, less than π.
    """
    x = mount[0, 0] * d[0] + mount[1, 0] * d[1] + mount[2, 0] * d[2]
    y = mount[0, 1] * d[0] + mount[1, 1] * d[1] + mount[2, 1] * d[2]
    z = mount[0, 2] * d[0] + mount[1, 2] * d[1] + mount[2, 2] * d[2]
    p, q, r = axis[0], axis[1], axis[2]
    along = x * p + y * q + z * r
    e, f, g = x - along * p, y - along * q, z - along * r  # across the axis
    k, l, m = f * r - g * q, g * p - e * r, e * q - f * p  # (e, f, g) × axis: back by 90°
    count = max(int(ceil((upper - lower) / step)), 1)
    half = 0.5 * (upper - lower) / count
    reach = 1.0 / cos(half)
    best = -np.inf
    for i in range(count + 2):
        if i == 0 or i == count + 1:
            angle, size = (lower if i == 0 else upper), 1.0
        else:
            angle, size = lower + (2 * i - 1) * half, reach
        c, s = size * cos(angle), size * sin(angle)
        value = read_table(
            table, along * p + c * e + s * k, along * q + c * f + s * l, along * r + c * g + s * m
        )
        best = max(best, value)
    return best


@jit
def turned_table(
    table: Floats, mount: Floats, axis: Floats, lower: float, upper: float, step: float
) -> Floats:
    """Returns the table of ``d ↦ max_θ f(Rot(axis, θ)ᵀ mountᵀ d)``, an upper bound of it."""
    out, d = np.empty_like(table), np.empty(3)
    m = table.shape[1] - 1
    for face in range(6):
        k = face // 2
        for i in range(m + 1):
            for j in range(m + 1):
                d[k] = 1.0 if face % 2 == 0 else -1.0
                d[(k + 1) % 3] = 2.0 * i / m - 1.0
                d[(k + 2) % 3] = 2.0 * j / m - 1.0
                out[face, i, j] = highest(table, d, mount, axis, lower, upper, step)
    return out


@jit
def twisting_table(
    table: Floats, axis: Floats, scale: float, aside: float, above: Floats
) -> Floats:
    """Returns the larger of `above` and of ``g ↦ (max f(± g × axis) + aside |g|) · scale``.

    With f the support function of the first moments beyond a joint it bounds the joint's use by
    loads along g; `aside` [N·m] bounds what other loads add.
    """
    out, d = np.empty_like(table), np.empty(3)
    m = table.shape[1] - 1
    for face in range(6):
        k = face // 2
        for i in range(m + 1):
            for j in range(m + 1):
                d[k] = 1.0 if face % 2 == 0 else -1.0
                d[(k + 1) % 3] = 2.0 * i / m - 1.0
                d[(k + 2) % 3] = 2.0 * j / m - 1.0
                x = d[1] * axis[2] - d[2] * axis[1]
                y = d[2] * axis[0] - d[0] * axis[2]
                z = d[0] * axis[1] - d[1] * axis[0]
                most = max(read_table(table, x, y, z), read_table(table, -x, -y, -z))
                size = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                out[face, i, j] = max(above[face, i, j], scale * (most + aside * size))
    return out


def grid(m: int) -> Floats:
    """Returns the grid's directions (6, m + 1, m + 1, 3), of length 1 to √3."""
    line = np.linspace(-1.0, 1.0, m + 1)
    out = np.empty((6, m + 1, m + 1, 3))
    for face in range(6):
        k = face // 2
        out[face, ..., k] = 1.0 if face % 2 == 0 else -1.0
        out[face, ..., (k + 1) % 3] = line[:, None]
        out[face, ..., (k + 2) % 3] = line[None, :]
    return out
