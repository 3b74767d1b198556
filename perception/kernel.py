"""The one way a function here becomes a compiled kernel.

Numba's own decorator is untyped; this one keeps the signature visible to the type checker. Kernels are plain
module-level functions on float64 arrays with preallocated outputs: no fastmath (it breaks NaN and infinity, which
mean something in a range), no threads (the loop that calls them has a deadline). `NUMBA_DISABLE_JIT=1` runs them
as the Python they are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def kernel(function: F) -> F:
    """Compile `function` in nopython mode, with numba's file cache."""
    return cast("F", numba.njit(cache=True)(function))
