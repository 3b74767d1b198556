"""Kernels for a model that comes while the robot drives: compiled by another process, loaded between cycles.

What a run needs is warm before its first cycle, and polygons are half of the work, so a run whose models are all
round leaves them out. Where the first polygon comes later its kernels are readied before the settings are taken over:
what was never compiled is compiled in a process of its own, behind everything else, and loaded by a thread, which
lets the loop in between any two kernels.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Final

from config.settings import Settings
from runtime.support.child_process import end_child, start_child
from runtime.support.kernel_cache import compiled_signatures, is_interpreted, missing, needed, use_cache, warm_up

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

COMPILING_MAX_S: Final = 600.0
"""Behind everything else, beside a robot that drives: ten times as long as it usually takes."""


class KernelLoader:
    """Readies kernels while the robot drives.

    Parameters
    ----------
    log : structlog logger
        Told where it takes a while.
    compile_aside : callable, optional
        Has a part compiled by another process.

    Attributes
    ----------
    loaded
        How many kernels were loaded on purpose since the start.
    """

    def __init__(
        self, log: FilteringBoundLogger, compile_aside: Callable[[str], Awaitable[None]] | None = None
    ) -> None:
        self._log = log
        self._compile = _compiled if compile_aside is None else compile_aside
        self._one_at_a_time = asyncio.Lock()
        self.loaded = 0

    async def __call__(self, running: Settings, proposed: Settings) -> str | None:
        """Ready what other settings need beyond those in force; return None, or why it cannot be done."""
        parts = [part for part in needed(proposed) if part not in needed(running)]
        if is_interpreted() or not parts:
            return None
        async with self._one_at_a_time:
            folder = use_cache()
            for part in missing(folder, parts):
                self._log.info(f"kernels for {part} are being compiled, once; the change is taken over then")
                await self._compile(part)
            if missing(folder, parts):
                return (
                    "models: the kernels that the first one without arc_radius_m needs cannot be compiled beside the "
                    "run, likely for want of memory, disk or time: start with such a model, e.g. `--set models=box`"
                )
            before = compiled_signatures()
            await asyncio.to_thread(warm_up, proposed, parts)
            self.loaded += compiled_signatures() - before
        return None


async def _compiled(part: str) -> None:
    process = await start_child("runtime.support.kernel_warmup", [part, "whole"], talks=False)
    try:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(process.communicate(), COMPILING_MAX_S)
    finally:
        await end_child(process)
