"""The decorators that compile a function as a kernel.

Numba's own decorator is untyped; this one keeps the signature visible to the type checker. Kernels are plain
module-level functions on float64 arrays with preallocated outputs: no fastmath (it breaks NaN and infinity, which
mean something in a range), no threads (the loop that calls them has a deadline). `NUMBA_DISABLE_JIT=1` runs them
as plain Python.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])

BORROWING: Final[Mapping[str, Any]] = MappingProxyType({"cache": True, "_nrt": False, "no_cfunc_wrapper": True})
"""NRT is numba's run time: its allocator and its reference counts."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def kernel(function: F) -> F:
    """Compile `function` in nopython mode, with numba's file cache.

    A kernel allocates nothing and owns nothing: its caller keeps the arrays. So it is compiled without numba's
    reference counts, which cost two atomic additions for each array of each call. An allocation in a kernel is an
    error when it is compiled.
    """
    return cast("F", numba.njit(**BORROWING)(function))


def owning_kernel(function: F) -> F:
    """Compile `function` as `kernel` does, with reference counts: for what allocates or takes numba's objects."""
    return cast("F", numba.njit(cache=True)(function))
