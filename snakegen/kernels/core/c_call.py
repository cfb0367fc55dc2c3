"""Calling a C function by its address from compiled code: how a kernel steps a simulator.

A compiled function that holds a library's function cannot be cached, since addresses change from
run to run; so the address is an argument.
"""

import ctypes
from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba import types
from numba.core import config
from numba.extending import intrinsic


@intrinsic  # type: ignore[untyped-decorator]
def _call_two_pointers(_typing: Any, _function: Any, _first: Any, _second: Any) -> Any:
    """Calls ``void function(void *first, void *second)``; all three are addresses (int64)."""

    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        builder.call(target, [builder.inttoptr(a, pointer) for a in arguments[1:]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), code


def _interpreted(function: int, first: int, second: int) -> None:
    """Does the same where kernels run as Python: NUMBA_DISABLE_JIT."""
    pointer = ctypes.c_void_p
    ctypes.CFUNCTYPE(None, pointer, pointer)(function)(first, second)


call_two_pointers: Callable[[int, int, int], None] = (
    _interpreted if cast(Any, config).DISABLE_JIT else cast(Any, _call_two_pointers)
)
