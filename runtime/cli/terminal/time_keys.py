"""The run's time under two keys of the terminal: p holds it and lets it go on, s lets one cycle go by."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from runtime.timing.time_control import TimeControl


class TimeKeys:
    """Asks for what a key stands for, one thing at a time; what cannot be done is told in the log.

    Parameters
    ----------
    control : TimeControl
        Holds the run's time.
    log : structlog logger
        For the user.
    """

    def __init__(self, control: TimeControl, log: FilteringBoundLogger) -> None:
        self._control = control
        self._log = log
        self._task: asyncio.Task[None] | None = None

    def press(self, key: str) -> None:
        """Take a key; one pressed while the last is being carried out is dropped."""
        control = self._control
        if self._task is None or self._task.done():
            if key == "p":
                self._task = asyncio.create_task(self._ask(control.resume if control.is_paused else control.pause))
            elif key == "s":
                self._task = asyncio.create_task(self._ask(control.single_step))

    async def _ask(self, what: Callable[[], Awaitable[str | None]]) -> None:
        if (why := await what()) is not None:
            self._log.warning("time is not held", reason=why)
