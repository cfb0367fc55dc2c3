"""The inverse of a small matrix by Gauss-Jordan elimination, the same on every processor."""

from snakegen.kernels.core.no_alloc import bare

NOTHING = 1e-14  # of the largest entry: a pivot that rounding alone leaves


@bare
def _swap(a, i, k):
    """Swaps rows i and k of a."""
    for c in range(a.shape[1]):
        a[i, c], a[k, c] = a[k, c], a[i, c]


@bare
def invert(a, out):
    """Writes the inverse of `a` (r, r) to `out`, `a` used up; False, `out` spoilt, if singular."""
    r, size = a.shape[0], 0.0
    for i in range(r):
        for c in range(r):
            out[i, c] = 1.0 if i == c else 0.0
            size = max(size, abs(a[i, c]))
    for k in range(r):
        at = k
        for i in range(k + 1, r):
            if abs(a[i, k]) > abs(a[at, k]):
                at = i
        if not abs(a[at, k]) > NOTHING * size:
            return False
        if at != k:
            _swap(a, at, k)
            _swap(out, at, k)
        unit = 1.0 / a[k, k]
        for c in range(r):
            a[k, c] *= unit
            out[k, c] *= unit
        for i in range(r):
            if i != k and a[i, k] != 0.0:
                s = a[i, k]
                for c in range(r):
                    a[i, c] -= s * a[k, c]
                    out[i, c] -= s * out[k, c]
    return True
