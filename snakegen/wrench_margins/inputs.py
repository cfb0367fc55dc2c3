"""Checks of what a caller hands to a margin: one clear line for every mistake."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snakegen.base.geometry import skew
from snakegen.errors import AnalysisError

Floats = NDArray[np.float64]


def _fits(has: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(has) == len(wanted) and all(
        want is None or want == size for want, size in zip(wanted, has, strict=True)
    )


def array(name: str, value: ArrayLike, *shapes: tuple[int | None, ...]) -> Floats:
    """Returns `value` as finite float64 of one of `shapes` (None: any length).

    Raises:
        AnalysisError: not numbers, another shape, or NaN or infinity among the entries.
    """
    try:
        out = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise AnalysisError(f"{name} is not an array of numbers: {error}") from None
    out = out.reshape(np.shape(value))
    if not any(_fits(out.shape, shape) for shape in shapes):
        wanted = " or ".join(str(s).replace("None", "any") for s in shapes)
        raise AnalysisError(f"{name} has shape {out.shape}; it must be {wanted}.")
    if not np.isfinite(out).all():
        at = tuple(int(i) for i in np.argwhere(~np.isfinite(out))[0])
        raise AnalysisError(f"{name}{list(at) if at else ''} is {out[at]}; it must be finite.")
    return out


def per_unit(name: str, value: ArrayLike, count: int) -> Floats:
    """Returns `value`, one number or (count,), as (count,).

    Raises:
        AnalysisError: another shape, not finite, or negative.
    """
    out = np.ascontiguousarray(np.broadcast_to(array(name, value, (), (count,)), (count,)))
    if (out < 0.0).any():
        at = int(np.argmax(out < 0.0))
        raise AnalysisError(f"{name}[{at}] is {out[at]:g}; a thrust limit cannot be negative.")
    return out


def drags(value: ArrayLike, count: int) -> Floats:
    """Returns the signed drags, m, one number or (count,), as (count,).

    Raises:
        AnalysisError: another shape, or not finite.
    """
    drag = array("drag", value, (), (count,))
    return np.ascontiguousarray(np.broadcast_to(drag, (count,)))


def force_map(points: Floats, drag: Floats) -> Floats:
    """Returns (6, 3n), forces at points (n, 3) with drags (n,) to the wrench: ``[E; p× + c E]``."""
    unit = np.eye(3)
    blocks = [np.vstack([unit, skew(p) + c * unit]) for p, c in zip(points, drag, strict=True)]
    return np.hstack(blocks)


def limits(lower: ArrayLike, upper: ArrayLike, count: int) -> tuple[Floats, Floats]:
    """Returns the thrust limits (count,), N, checked: lower ≤ upper; a negative one reverses."""
    low = np.broadcast_to(array("lower", lower, (), (count,)), (count,))
    low, high = np.ascontiguousarray(low), per_unit("upper", upper, count)
    if (low > high).any():
        at = int(np.argmax(low > high))
        raise AnalysisError(f"lower[{at}] = {low[at]:g} is above upper[{at}] = {high[at]:g}.")
    return low, high


def positive(name: str, value: float) -> float:
    """Returns the positive finite number `value`."""
    out = float(array(name, value, ()))
    if out <= 0.0:
        raise AnalysisError(f"{name} is {out:g}; it must be positive.")
    return out


def share(name: str, value: float) -> float:
    """Returns the fraction `value`, in [0, 1)."""
    out = float(array(name, value, ()))
    if not 0.0 <= out < 1.0:
        raise AnalysisError(f"{name} is {out:g}; it must be a fraction in [0, 1).")
    return out


def scale(force_scale: float, torque_scale: float) -> Floats:
    """Returns (6,) ``[F0, F0, F0, T0, T0, T0]``, N and N·m."""
    force, torque = positive("force_scale", force_scale), positive("torque_scale", torque_scale)
    return np.repeat([force, torque], 3)


def hover(hover_wrench: ArrayLike, postures: int | None) -> Floats:
    """Returns the hover wrench (6,), or (m, 6) for a batch of m `postures`."""
    if postures is None:
        return array("hover_wrench", hover_wrench, (6,))
    wrench = array("hover_wrench", hover_wrench, (6,), (postures, 6))
    return np.ascontiguousarray(np.broadcast_to(wrench, (postures, 6)))


def margins_text(kind: str, wrench: Floats, force: Floats, torque: Floats) -> str:
    """Returns one line for margins of one posture, or of a batch."""
    if np.ndim(wrench):
        return f"{kind}({len(wrench)} postures)"
    if not wrench >= 0.0:
        return f"{kind}(hover is infeasible by {-float(wrench):.3g}, scaled)"
    return (
        f"{kind}(force {float(force):.4g} N, torque {float(torque):.4g} N·m, wrench {wrench:.3g})"
    )
