"""Sleeping until a time or until something rings, whichever comes first."""

from __future__ import annotations

import asyncio
from collections.abc import Callable


class Alarm:
    """One sleeper's alarm.

    Parameters
    ----------
    clock : callable
        The clock that times are given in, s.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._awake: asyncio.Future[None] | None = None

    async def until(self, when_s: float) -> None:
        """Sleep until `when_s` or until it rings; the loop gets to read what has come in any case."""
        left_s = when_s - self._clock()
        if left_s <= 0.0:
            # Two passes: in the first one this task stands before what the loop finds to read.
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            return
        loop = asyncio.get_running_loop()
        self._awake = loop.create_future()
        timer = loop.call_later(left_s, self.ring)
        try:
            await self._awake
        finally:
            timer.cancel()
            self._awake = None

    def ring(self) -> None:
        """Wake the sleeper; nobody sleeps, nothing happens."""
        if self._awake is not None and not self._awake.done():
            self._awake.set_result(None)
