"""The decorator that compiles the emulator's kernels; unlike numba's own it keeps their type.

Keep every kernel in one file with what it calls: numba's cache on disk detects changes in that file only. If no
folder is writable, kernels are compiled at each start.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Return `function` compiled at its first call, or loaded from numba's cache on disk."""
    try:
        return cast(F, numba.njit(cache=True)(function))
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        return cast(F, numba.njit(function))
