"""The farthest force of a convex piece, for callers from Python."""

from snakegen.kernels.core.jit import jit
from snakegen.kernels.margins.force_sets import piece_farthest


@jit
def piece_support(j, d, sets, f):
    """Writes the force (3,) of piece j that lies farthest along d, CoG axes; their product."""
    return piece_farthest(j, d, sets, f)
