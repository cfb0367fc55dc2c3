"""Arrays without a reference count, for the length of one call: their owner is the caller.

Numba counts references to every array of every tuple that passes from function to function, with
atomic operations; in a loop over small arrays that takes as long as the arithmetic. An array
without an owner is not counted.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic  # type: ignore[untyped-decorator]
def borrowed(_typing: Any, value: Any) -> Any:
    """Returns `value`, an array or a (named) tuple of them, with arrays that own nothing.

    For arguments of a kernel that is called from Python, which keeps them alive meanwhile; not
    for what a kernel returns or has made itself.
    """

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _stripped(context, builder, signature.args[0], arguments[0])

    return value(value), code


def _stripped(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value=value)
        array.meminfo = ir.Constant(array.meminfo.type, None)
        array.parent = ir.Constant(array.parent.type, None)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        kinds: Any = kind
        parts: Any = cgutils.unpack_tuple(builder, value, len(kinds))
        stripped = [_stripped(context, builder, k, parts[i]) for i, k in enumerate(kinds)]
        return context.make_tuple(builder, kind, stripped)
    return value
