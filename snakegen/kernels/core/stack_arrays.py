"""Arrays without a reference count, for the length of one call: their owner is the caller.

Numba counts references to every array of every tuple that passes from function to function, with
atomic operations; in a loop over small arrays that takes as long as the arithmetic, and making a
small array takes longer still. An array without an owner is not counted; `scratch` makes one on
the stack. Both are for `bare` functions, which may call others only where no new array comes back.
"""

from collections.abc import Callable
from functools import reduce
from math import prod
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.extending import intrinsic

from snakegen.kernels.core.types import Floats


@intrinsic  # type: ignore[untyped-decorator]
def _borrowed(_typing: Any, value: Any) -> Any:
    """Returns `value`, an array or a (named) tuple of them, with arrays that own nothing.

    For arguments of a kernel that is called from Python, which keeps them alive meanwhile; not
    for what a kernel returns or has made itself, unless it uses the owner again after the last
    use of what was borrowed: an owner is freed after its own last use.
    """

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _stripped(context, builder, signature.args[0], arguments[0])

    return value(value), code


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
def _scratch(_typing: Any, shape: Any) -> Any:
    sizes: Any = tuple(cast(Any, shape)) if isinstance(shape, types.BaseTuple) else (shape,)
    kind = types.Array(types.float64, len(sizes), "C")

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given, word, step = arguments[0], context.get_value_type(types.intp), 8
        whole = isinstance(signature.args[0], types.BaseTuple)
        lengths = cgutils.unpack_tuple(builder, given) if whole else [given]
        if all(isinstance(s, types.IntegerLiteral) for s in sizes):
            lengths = [ir.Constant(word, s.literal_value) for s in sizes]
            total = ir.Constant(word, prod(s.literal_value for s in sizes))
            data = cgutils.alloca_once(builder, ir.DoubleType(), total)
        else:
            pairs = zip(lengths, sizes, strict=True)
            lengths = [context.cast(builder, n, s, types.intp) for n, s in pairs]
            data = builder.alloca(ir.DoubleType(), reduce(builder.mul, lengths))
        strides = [ir.Constant(word, step)]
        for n in lengths[:0:-1]:
            strides.insert(0, builder.mul(strides[0], n))
        array = context.make_array(kind)(context, builder)
        context.populate_array(
            array,
            data=data,
            shape=cgutils.pack_array(builder, lengths, word),
            strides=cgutils.pack_array(builder, strides, word),
            itemsize=ir.Constant(word, step),
            meminfo=None,
        )
        return array._getvalue()

    return kind(shape), code


# With NUMBA_DISABLE_JIT kernels run as the Python that they are, on arrays of the usual kind.
_interpreted = bool(cast(Any, config).DISABLE_JIT)

# Returns its argument with arrays that own nothing: see `_borrowed`.
borrowed: Callable[[Any], Any] = (lambda value: value) if _interpreted else cast(Any, _borrowed)

# Returns an array of floats on the stack for the length of the call, contents undefined; its shape
# is an int or a tuple of ints. A kernel must neither return it nor, where its size is known only at
# run time, make it in a loop: the stack would grow with every round.
scratch: Callable[[int | tuple[int, ...]], Floats] = (
    np.empty if _interpreted else cast(Any, _scratch)
)


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
