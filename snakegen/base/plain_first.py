"""Chooses between a plain function and its compiled twin, without anybody waiting for a compiler.

The first calls of a process are plain NumPy, which answers one posture at once; a loop soon runs
compiled. Both compute the same to round-off, or bounds of one figure that both close to the same
tolerance, which tests hold; the choice depends on the number of calls alone, never on what the
kernel cache holds: a command prints the same digits on its first day and on its second.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
CALLS = 200  # plain calls, some 0.1 ms each, before a kernel that takes seconds to compile


def plain_first(
    kernel: Callable[..., Any], calls: int = CALLS
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Makes the decorator of a plain function whose compiled twin is `kernel`.

    Args:
        kernel: takes the same arguments and returns the same to round-off.
        calls: how often a process runs the plain function before it turns to the kernel.

    Returns:
        The decorator; the plain function itself is the result's ``__wrapped__``.
    """

    def decorate(plain: Callable[P, R]) -> Callable[P, R]:
        done = 0

        @wraps(plain)
        def run(*args: P.args, **kwargs: P.kwargs) -> R:
            nonlocal done
            if done >= calls:
                return kernel(*args, **kwargs)
            done += 1
            return plain(*args, **kwargs)

        return run

    return decorate
