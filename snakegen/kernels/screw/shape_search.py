"""Compiled search over a screw drive's shapes: σ₃, its gradient, a certified lower bound."""

import math

import numpy as np
from numpy.typing import NDArray

from snakegen.kernels.core.jit import jit
from snakegen.kernels.screw.constraints import unit_rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@jit
def _weakest(rows: Floats) -> tuple[float, Floats]:
    """Returns σ₃ and its right singular vector (3,)."""
    _, sigma, right = np.linalg.svd(rows, False)
    return sigma[2], right[2].copy()


@jit
def smallest_sigma(
    shapes: Floats, alpha: Floats, link: Ints, offset: Floats, lengths: Floats, scale: float
) -> Floats:
    """Returns σ₃ of `unit_rows` for each of the shapes (m, n - 1)."""
    out = np.empty(shapes.shape[0])
    for m in range(shapes.shape[0]):
        out[m] = _weakest(unit_rows(shapes[m], alpha, link, offset, lengths, scale))[0]
    return out


@jit
def sigma_squared(
    shape: Floats, alpha: Floats, link: Ints, offset: Floats, lengths: Floats, scale: float
) -> tuple[float, Floats]:
    """Returns σ₃² and its gradient by the joint angles: ``2 Σ_i (G_i·v) (∂G_i/∂φ_k · v)``.

    v is the right singular vector of σ₃; φ_k turns the links after k, so only their units' rows
    change, and of their levers only the links up to k: ``Σ_{j≤k} ℓ_ij cos(α_i + ψ_i - ψ_j)``.
    """
    rows = unit_rows(shape, alpha, link, offset, lengths, scale)
    v = _weakest(rows)[1]
    along = rows @ v
    psi = np.zeros(lengths.shape[0])
    psi[1:] = np.cumsum(shape)
    gradient = np.zeros(shape.shape[0])
    for i in range(alpha.shape[0]):
        direction = alpha[i] + psi[link[i]]
        across = -math.sin(direction) * v[0] + math.cos(direction) * v[1]
        lever = 0.0
        for k in range(link[i]):
            lever += lengths[k] * math.cos(direction - psi[k])
            gradient[k] += 2.0 * along[i] * (across + lever / scale * v[2])
    return along @ along, gradient


@jit
def certify(
    lower: Floats,
    upper: Floats,
    bound: float,
    slopes: Floats,
    alpha: Floats,
    link: Ints,
    offset: Floats,
    lengths: Floats,
    scale: float,
    budget: int,
) -> int:
    """Returns how many boxes proved ``σ₃ ≥ bound`` on the whole box, else -1 (refuted or too many).

    Over a box of half widths h, σ₃ falls from its centre's value by at most ``Σ_k slopes_k h_k``
    (Weyl: σ₃ moves no more than the matrix does); boxes are halved where that does not suffice.
    """
    d = lower.shape[0]
    depth = 64 * d + 1
    centres, halves = np.empty((depth, d)), np.empty((depth, d))
    centres[0], halves[0] = 0.5 * (lower + upper), 0.5 * (upper - lower)
    waiting, used = 1, 0
    while waiting > 0:
        waiting -= 1
        centre, half = centres[waiting].copy(), halves[waiting].copy()
        used += 1
        sigma = _weakest(unit_rows(centre, alpha, link, offset, lengths, scale))[0]
        if sigma < bound or used > budget or waiting + 2 > depth:
            return -1
        if sigma - slopes @ half >= bound:
            continue
        k = int(np.argmax(slopes * half))
        half[k] *= 0.5
        for side in (-1.0, 1.0):
            centres[waiting], halves[waiting] = centre, half
            centres[waiting, k] += side * half[k]
            waiting += 1
    return used
