"""Cholesky solves of small symmetric positive-definite systems, without LAPACK's call cost."""

from math import sqrt

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats


@bare
def factor(low: Floats) -> None:
    """Makes the lower triangle (n, n) of a positive definite matrix its Cholesky factor, in place.

    A pivot lost to rounding is replaced by a tiny one.
    """
    n = low.shape[0]
    floor = 0.0
    for i in range(n):
        floor = max(floor, low[i, i])
    floor *= 1e-15
    for j in range(n):
        pivot = low[j, j]
        for k in range(j):
            pivot -= low[j, k] * low[j, k]
        low[j, j] = sqrt(max(pivot, floor))
        for i in range(j + 1, n):
            total = low[i, j]
            for k in range(j):
                total -= low[i, k] * low[j, k]
            low[i, j] = total / low[j, j]


@bare
def solve_factor_into(low: Floats, rhs: Floats, x: Floats) -> None:
    """Writes ``(low lowᵀ)⁻¹ rhs`` (n,)."""
    n = rhs.shape[0]
    for i in range(n):
        total = rhs[i]
        for k in range(i):
            total -= low[i, k] * x[k]
        x[i] = total / low[i, i]
    for i in range(n - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, n):
            total -= low[k, i] * x[k]
        x[i] = total / low[i, i]


@bare
def solve_spd_into(matrix: Floats, rhs: Floats, x: Floats) -> None:
    """Writes ``matrix⁻¹ rhs`` (n,); the lower triangle of `matrix` (n, n) is read.

    A singular system gives a huge, finite answer along its null space instead of NaN; callers
    judge singularity by singular values, not by this solve.
    """
    n = rhs.shape[0]
    low = scratch((n, n))
    for i in range(n):
        for k in range(i + 1):
            low[i, k] = matrix[i, k]
    factor(low)
    solve_factor_into(low, rhs, x)


@jit
def solve_spd(matrix: Floats, rhs: Floats) -> Floats:
    """Returns ``matrix⁻¹ rhs`` (n,) as `solve_spd_into` writes it."""
    x = np.empty(rhs.shape[0])
    solve_spd_into(matrix, rhs, x)
    return x


@bare
def gram_into(matrix: Floats, weight: Floats, out: Floats) -> None:
    """Writes ``matrix diag(weight)² matrixᵀ`` (m, m) of a wide (m, n) matrix."""
    m, n = matrix.shape
    for i in range(m):
        for k in range(i + 1):
            total = 0.0
            for c in range(n):
                total += matrix[i, c] * matrix[k, c] * weight[c] * weight[c]
            out[i, k] = out[k, i] = total


@jit
def gram(matrix: Floats, weight: Floats) -> Floats:
    """Returns ``matrix diag(weight)² matrixᵀ`` (m, m) of a wide (m, n) matrix."""
    out = np.empty((matrix.shape[0], matrix.shape[0]))
    gram_into(matrix, weight, out)
    return out


@bare
def least_norm_into(matrix: Floats, weight: Floats, rhs: Floats, x: Floats) -> None:
    """Writes the x (n,) with ``matrix x = rhs`` of least ``‖x / weight‖``: eqs 22, 36, 46."""
    m = matrix.shape[0]
    square, mu = scratch((m, m)), scratch(m)
    gram_into(matrix, weight, square)
    solve_spd_into(square, rhs, mu)
    for c in range(matrix.shape[1]):
        total = 0.0
        for i in range(m):
            total += matrix[i, c] * mu[i]
        x[c] = total * (weight[c] * weight[c])


@jit
def least_norm(matrix: Floats, weight: Floats, rhs: Floats) -> Floats:
    """Returns the x (n,) with ``matrix x = rhs`` of least ``‖x / weight‖``: eqs 22, 36, 46."""
    x = np.empty(matrix.shape[1])
    least_norm_into(matrix, weight, rhs, x)
    return x


@bare
def tridiagonal(matrix: Floats, diagonal: Floats, square: Floats) -> None:
    """Writes the diagonal (n,) and the squared off-diagonal (n - 1,) of a similar tridiagonal.

    Householder's reflections ``v``, of which the lower triangle of a symmetric `matrix` (n, n) is
    read; it is destroyed.
    """
    n = matrix.shape[0]
    v, w = scratch(n), scratch(n)
    for k in range(n - 1):
        rest = 0.0
        for i in range(k + 2, n):
            rest += matrix[i, k] * matrix[i, k]
        head = matrix[k + 1, k]
        diagonal[k], square[k] = matrix[k, k], head * head + rest
        if rest == 0.0:
            continue
        for i in range(k + 1, n):
            v[i] = matrix[i, k]
        v[k + 1] += sqrt(square[k]) if head > 0.0 else -sqrt(square[k])
        half, along = 2.0 / (v[k + 1] * v[k + 1] + rest), 0.0
        for i in range(k + 1, n):
            w[i] = 0.0
            for j in range(k + 1, n):
                w[i] += half * (matrix[i, j] if j <= i else matrix[j, i]) * v[j]
            along += w[i] * v[i]
        for i in range(k + 1, n):
            w[i] -= 0.5 * half * along * v[i]
            for j in range(k + 1, i + 1):
                matrix[i, j] -= v[i] * w[j] + w[i] * v[j]
    diagonal[n - 1] = matrix[n - 1, n - 1]


@bare
def least_eigenvalue(matrix: Floats) -> float:
    """Returns the least eigenvalue of a positive semidefinite (n, n) matrix, 0 where rounding is.

    Laguerre's steps from 0 up, which never pass it, on the pivots ``q_i = d_i - x - e²/q_{i-1}``
    of a tridiagonal: ``Σ 1/(λ - x) = -Σ q'/q`` and ``Σ 1/(λ - x)² = Σ (q'/q)² - q''/q``. The lower
    triangle is read, `matrix` destroyed. LAPACK's compile and call cost more at this size.
    """
    n = matrix.shape[0]
    d, square = scratch(n), scratch(n)
    tridiagonal(matrix, d, square)
    x, size = 0.0, 0.0
    for i in range(n):
        size = max(size, d[i])
    for _ in range(50):
        first = second = rise = bend = 0.0
        pivot = 1.0
        for i in range(n):
            lost = square[i - 1] / pivot if i > 0 else 0.0
            pivot = d[i] - x - lost
            if pivot <= 0.0:
                return x
            bend = lost * (bend - 2.0 * rise * rise) / pivot
            rise = (lost * rise - 1.0) / pivot
            first -= rise
            second += rise * rise - bend
        step = n / (first + sqrt(max((n - 1.0) * (n * second - first * first), 0.0)))
        x += step
        if step <= 1e-16 * size:
            break
    return x


@bare
def least_singular_value(matrix: Floats, rows: Floats, weight: Floats) -> float:
    """Returns σ_min of ``diag(rows) matrix diag(weight)``, 0 if there are fewer columns than rows.

    From the eigenvalues of its Gram matrix: good to about 1e-8 of the largest.
    """
    square = scratch((matrix.shape[0], matrix.shape[0]))
    gram_into(matrix, weight, square)
    for i in range(square.shape[0]):
        for k in range(i + 1):
            square[i, k] *= rows[i] * rows[k]
    return sqrt(least_eigenvalue(square))
