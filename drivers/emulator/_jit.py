"""The decorator that compiles the emulator's kernels; unlike numba's own it keeps their type.

Keep every kernel in one file with what it calls: numba's cache on disk detects changes in that file only. If no
folder is writable, kernels are compiled at each start. Without a compiler (`NUMBA_DISABLE_JIT=1`) they run as plain
Python, and numba, which takes most of a start, is not imported.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

INTERPRETED: Final = os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}
"""Whether kernels run as plain Python."""

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Return `function` compiled at its first call, or loaded from numba's cache on disk."""
    if INTERPRETED:
        return function
    import numba

    try:
        return cast(F, numba.njit(cache=True)(function))
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        return cast(F, numba.njit(function))
