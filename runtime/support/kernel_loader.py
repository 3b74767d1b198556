"""Load the kernels of a model that is added while the robot drives, without delaying a cycle.

A run loads the kernels it needs before its first cycle. Those for polygons are half of all, so a run whose models
are all round leaves them out. If a polygon is added later, they are prepared before the new settings take effect:
compiled by a process at low priority if they never were, then loaded by a thread between whose steps the loop runs.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Final

from config.settings import Settings
from runtime.support.child_process import kill_child, start_child
from runtime.support.kernel_cache import (
    compiled_signatures,
    is_interpreted,
    needed_parts,
    uncompiled_parts,
    use_kernel_cache,
    warm_up,
)

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

COMPILING_MAX_S: Final = 600.0
"""Time limit for the compiling process: ten times what it usually takes at low priority beside a driving robot."""


class KernelLoader:
    """Prepare kernels while the robot drives.

    Parameters
    ----------
    log : structlog logger
        Receives a line when kernels have to be compiled.
    compile_part : callable, optional
        Compiles a part in another process.

    Attributes
    ----------
    loaded : int
        Kernel signatures loaded since the start; they are no compilation within a cycle.
    """

    def __init__(
        self, log: FilteringBoundLogger, compile_part: Callable[[str], Awaitable[None]] | None = None
    ) -> None:
        self._log = log
        self._compile_part = _compile_in_child if compile_part is None else compile_part
        self._lock = asyncio.Lock()
        self.loaded = 0

    async def __call__(self, running: Settings, proposed: Settings) -> str | None:
        """Load what the proposed settings need beyond the running ones; return None, or why that failed."""
        parts = [part for part in needed_parts(proposed) if part not in needed_parts(running)]
        if is_interpreted() or not parts:
            return None
        async with self._lock:
            folder = use_kernel_cache()
            for part in uncompiled_parts(folder, parts):
                self._log.info(f"compiling the kernels for {part}, once; the change takes effect afterwards")
                await self._compile_part(part)
            if uncompiled_parts(folder, parts):
                return (
                    "models: the kernels for a model without arc_radius_m could not be compiled during the run, "
                    "likely for lack of memory, disk or time: start with such a model, e.g. `--set models=box`"
                )
            before = compiled_signatures()
            await asyncio.to_thread(warm_up, proposed, parts)
            self.loaded += compiled_signatures() - before
        return None


async def _compile_in_child(part: str) -> None:
    process = await start_child("runtime.support.kernel_warmup", [part, "whole"], pipes=False, low_priority=True)
    try:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(process.communicate(), COMPILING_MAX_S)
    finally:
        await kill_child(process)
