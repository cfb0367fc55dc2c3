"""Rounding of numbers that are written to files: the same digits on every processor.

BLAS and compiled kernels sum in the order that suits a processor; results differ in the last bits.
A number is written to the digits that are meant.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats

_NOISE = 3  # digits more than are kept, beyond which two processors may differ


def significant(values: ArrayLike, digits: int = 9) -> Floats:
    """Returns `values` rounded to `digits` of the largest of them; no zero is negative.

    Rounded first to 3 digits more: a half that is meant is then a half on every processor.
    """
    out = np.array(values, float)
    finite = np.abs(out[np.isfinite(out)])
    largest = float(finite.max(initial=0.0))
    if largest == 0.0:
        return out + 0.0
    decimals = digits - 1 - int(np.floor(np.log10(largest)))
    return np.asarray(np.round(np.round(out, decimals + _NOISE), decimals) + 0.0, float)


def rounded(value: Any, digits: int = 10) -> Any:
    """Returns plain data with each number, or list of numbers, rounded by `significant`."""
    if isinstance(value, dict):
        return {key: rounded(v, digits) for key, v in value.items()}
    if isinstance(value, list):
        if value and all(isinstance(v, float) for v in value):
            return significant(value, digits).tolist()
        return [rounded(v, digits) for v in value]
    return float(significant(value, digits)) if isinstance(value, float) else value


def least(values: ArrayLike) -> int:
    """Returns the index of the least value; of values that are equal to 1e-9 the first."""
    return int(np.argmin(significant(values)))


def in_order(rows: ArrayLike, digits: int = 6) -> Floats:
    """Returns rows (m, k) in ascending order of their columns; columns tie within `digits`."""
    out = np.asarray(rows, float)
    return out[np.lexsort(significant(out, digits).T[::-1])] if out.size else out
