"""Compile a kernel with numba and keep its type: the decorator numba ships is untyped.

Keep every kernel in one file with what it calls: the cache on disk knows only the file a kernel stands in. A place
where nothing can be cached (no writable folder at all) costs a compilation at each start, not the start itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Return `function` compiled at its first call, from numba's cache on disk where there is one."""
    try:
        return cast(F, numba.njit(cache=True)(function))
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        return cast(F, numba.njit(function))
