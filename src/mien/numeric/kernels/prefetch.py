"""Prefetching of memory in kernels."""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

__all__ = ["prefetch"]


@intrinsic
def prefetch(_: Any, array: Any, index: Any) -> Any:
    """Within a kernel: have the processor fetch a 1-D array's element; it need not exist.

    The processor does not predict reads of many short runs that lie far from each other, and
    waits for them.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = context.make_array(signature.args[0])(context, builder, arguments[0])
        element = builder.gep(values.data, [arguments[1]])
        element = builder.bitcast(element, ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        form = ir.FunctionType(ir.VoidType(), [element.type, number, number, number])
        function = cgutils.get_or_insert_function(builder.module, form, "llvm.prefetch.p0i8")
        # To read, to be kept near, data.
        builder.call(function, [element, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate
