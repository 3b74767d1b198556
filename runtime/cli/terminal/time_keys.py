"""Time control by two keys of the terminal: p pauses and resumes the emulated run, s steps by one cycle.

While it is paused, the other keys take effect with the next cycle, and the terminal says so.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from runtime.cycle.inputs import Request

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from runtime.timing.time_control import TimeControl


WAITS: Final = " waits for the next cycle, because the run is paused: p resumes, s steps"


def noting_what_waits(
    on_request: Callable[[Request], None], control: TimeControl, show: Callable[[str], None]
) -> Callable[[Request], None]:
    """Return what passes a request on, and says that it has to wait while the run is paused."""

    def on_key(request: Request) -> None:
        on_request(request)
        if control.is_paused:
            show(request.value.upper() + WAITS)

    return on_key


class TimeKeys:
    """Carries out one key at a time; the log says why a key had no effect.

    Parameters
    ----------
    control : TimeControl
        Of the run.
    log : structlog logger
        Receives why a key had no effect.
    """

    def __init__(self, control: TimeControl, log: FilteringBoundLogger) -> None:
        self._control = control
        self._log = log
        self._task: asyncio.Task[None] | None = None
        self._next: str | None = None

    def press(self, key: str) -> None:
        """Handle a key; while one is being carried out, only the newest further one is kept for after it."""
        if key not in {"p", "s"}:
            return
        self._next = key
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._carry_out())

    async def _carry_out(self) -> None:
        control = self._control
        while (key := self._next) is not None:
            self._next = None
            stepped_or_paused = control.single_step if key == "s" else control.pause
            request = control.resume if key == "p" and control.is_paused else stepped_or_paused
            if (why := await request()) is not None:
                self._log.warning("the run cannot be paused or stepped", reason=why)
