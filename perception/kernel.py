"""The decorators that compile a function as a kernel.

Numba's own decorator is untyped; this one keeps the signature visible to the type checker. Kernels are plain
module-level functions on float64 arrays with preallocated outputs: no fastmath (it breaks NaN and infinity, which
mean something in a range), no threads (the loop that calls them has a deadline). `NUMBA_DISABLE_JIT=1` runs them
as plain Python.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from perception.kernel_compiler import EntryDispatcher, KernelDispatcher
from perception.records import INTERPRETED

F = TypeVar("F", bound=Callable[..., object])

BORROWING: Final[Mapping[str, object]] = MappingProxyType({"_nrt": False, "no_cfunc_wrapper": True})
"""NRT is numba's run time: its allocator and its reference counts."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _compiled(function: F, dispatcher: type[KernelDispatcher] = KernelDispatcher, /, **options: object) -> F:
    if INTERPRETED:
        return function
    return cast("F", dispatcher(function, **options))


def kernel(function: F) -> F:
    """Compile `function` in nopython mode, with numba's file cache.

    A kernel allocates nothing and owns nothing: its caller keeps the arrays. So it is compiled without numba's
    reference counts, which cost two atomic additions for each array of each call. An allocation in a kernel is an
    error when it is compiled.
    """
    return _compiled(function, **BORROWING)


def entry_kernel(function: F) -> F:
    """Compile `function` as `kernel` does, for one that Python calls with each firing.

    Only its first call looks at what types its arguments have. Later ones must have the same, and arrays whose items
    follow each other: a column of a table would be read wrongly.
    """
    return _compiled(function, EntryDispatcher, **BORROWING)


def loop_kernel(function: F) -> F:
    """Compile `function` as `kernel` does, for a loop whose passes the processor computes several at a time.

    That takes a body without branches and without calls: divided by zero, it gives infinity or NaN instead of an
    error, and what it calls must be a loop kernel, too, which becomes a part of its callers.
    """
    return _compiled(function, error_model="numpy", forceinline=True, **BORROWING)


def owning_kernel(function: F) -> F:
    """Compile `function` as `kernel` does, with reference counts: for what allocates or takes numba's objects."""
    return _compiled(function)
