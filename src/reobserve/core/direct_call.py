"""Calls that cost nothing beyond the call: of the functions that compiled loops are handed."""

from __future__ import annotations

from typing import Any

import numba
from numba import types
from numba.extending import intrinsic


def _call(_: Any, function: Any, arguments: Any) -> Any:
    """Compile ``call(function, arguments)`` by numba."""
    if not isinstance(function, types.FunctionType):
        return None
    signature: Any = function.signature
    if signature.return_type != types.none or signature.args != tuple(arguments):
        return None

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = context.get_value_type(signature.args[0].ftype)
        address = builder.bitcast(builder.extract_value(args[0], 0), kind)
        values = [builder.extract_value(args[1], k) for k in range(len(arguments))]
        builder.call(address, values)
        return context.get_dummy_value()

    return types.void(function, arguments), generate


# Call a function without a result, of a `FunctionPointer` or a vector field, with a tuple of
# arguments.
#
# As ``function(*arguments)`` does, which numba compiles with what it takes to fetch the function
# from Python and to raise what it raises; neither ever happens. But it takes longer to compile and
# to run, in an `allocating_kernel` most of all: numba counts references where anything may raise.
call: Any = intrinsic(_call)

_settings: Any = numba.config
if _settings.DISABLE_JIT:  # to debug kernels as Python

    def call(function: Any, arguments: Any) -> None:
        """Call a function, whose Python code is run."""
        function(*arguments)
