"""Sends what the driver has to send: in each cycle, and in between where it sends its commands one by one."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Final, Literal

from drivers.driver import RobotDriver
from drivers.link import Link
from runtime.timing.run_clock import RunClock

SEND_AGAIN_S: Final = 0.01
"""Time after what was sent until the driver is asked for more, s: the gap that an rFLEX controller needs."""


class LineSender:
    """Sends the driver's bytes, and asks it for more while a velocity is still current.

    Parameters
    ----------
    link
        The line.
    driver
        What it has to send.
    clock
        Of the run.
    on_bytes
        Gets what is sent, with the moment by the run's clock and by the host's.
    timed
        Wraps the call between cycles, for the statistics.
    """

    def __init__(
        self,
        link: Link,
        driver: RobotDriver,
        clock: RunClock,
        on_bytes: Callable[[Literal["in", "out"], float, float, bytes], None] | None,
        timed: Callable[[Callable[[], None]], Callable[[], None]],
    ) -> None:
        self.stale_run_s = -math.inf
        """When the last velocity is too old to be sent, by the run's clock, s."""
        self._link, self._driver, self._clock, self._on_bytes = link, driver, clock, on_bytes
        self._again = timed(self._send_again)
        self._timer: asyncio.TimerHandle | None = None

    def send(self) -> None:
        """Send the bytes that the driver has to send."""
        link = self._link
        link.set_baud(self._driver.line_baud)
        if not (link.is_open and (data := self._driver.outgoing(writable=link.writable)) and link.send(data)):
            return
        if self._on_bytes is not None:
            self._on_bytes("out", *self._clock.both(), data)
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(SEND_AGAIN_S, self._again)

    def _send_again(self) -> None:
        run_s = self._clock()
        if run_s <= self.stale_run_s:  # else this process was suspended, and the next cycle stops the base
            self._driver.tick(run_s)
            self.send()
