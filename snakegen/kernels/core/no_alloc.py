"""The decorator of kernels that allocate nothing: arrays go in without counting references.

Numba counts a reference for every array argument of a function that it does not inline: an atomic
pair, some 7 ns each, which is more than the arithmetic of the small kernels. A function that makes
no array can do without.
"""

from typing import Any

from snakegen.kernels.core.jit import F, jit


def bare(function: F | None = None, /, **options: Any) -> Any:
    """Compiles `function` as `jit` does, for use inside kernels; it must not allocate."""
    return jit(function, _nrt=False, **options)
