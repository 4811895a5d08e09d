"""Arrays without their owners, for hot loops that are made of many parts.

Numba counts references to an array, atomically, wherever a part of a kernel begins or ends, also when that is written out
in place. In a loop of some hundred nanoseconds this doubled the time.
"""

from __future__ import annotations

from typing import Any

import numba.extending

from fastcontact._jit.decorators import compiled


def _without_owners(_context: Any, arrays: Any) -> Any:
    from numba.core.imputils import impl_ret_untracked
    from numba.np.arrayobj import make_array

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        given = args[0]
        for k, kind in enumerate(signature.return_type):
            array = make_array(kind)(context, builder, builder.extract_value(given, k))
            array.meminfo = array.meminfo.type(None)
            given = builder.insert_value(given, array._getvalue(), k)
        return impl_ret_untracked(context, builder, signature.return_type, given)

    return arrays(arrays), code


def _as_given(arrays: Any) -> Any:
    return arrays


# Returns a tuple (or named tuple) of arrays again, without their owners. Only for arguments of the kernel that it is called
# in: their owners live until the kernel returns, those of arrays made inside would not.
borrowed = numba.extending.intrinsic(_without_owners) if compiled() else _as_given
