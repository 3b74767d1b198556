"""The report in a browser's tab: a page that says it is being made and asks again, then the report itself.

A long recording takes a while to read. All tabs that ask meanwhile wait for the same report.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Final

LIMIT_S: Final = 1.0
AGAIN_S: Final = 1
"""The page that waits asks again after this time."""
KEPT_S: Final = 5.0
"""A report that was waited for is given to all who ask within this time after it is done."""
PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Report in progress · echolocate</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>body { font: 18px/1.5 system-ui; margin: 3rem auto; max-width: 34rem; padding: 0 1rem }</style></head>
<body><h1>The report is being made</h1>
<p role="status">For SECONDS s so far. The recording of the run is being read; an hour of it takes about half a
minute, longer while the robot drives. This page shows the report as soon as it is done.</p></body></html>
"""


class ReportTab:
    """Makes one report at a time.

    Parameters
    ----------
    make : callable
        Makes the report; raises a CommandError.
    clock : callable
        Monotonic, s.
    limit_s : float
        A report that takes longer is waited for by a page that says so.
    """

    def __init__(
        self, make: Callable[[], Awaitable[bytes]], clock: Callable[[], float], limit_s: float = LIMIT_S
    ) -> None:
        self._make = make
        self._limit_s = limit_s
        self._clock = clock
        self._task: asyncio.Task[bytes] | None = None
        self._began_s = self._kept_until_s = 0.0

    async def answer(self, *, wait: bool) -> tuple[HTTPStatus, bytes]:
        """Return the report, or the page that waits for it with `HTTPStatus.ACCEPTED`.

        Parameters
        ----------
        wait : bool
            Wait until the report is done, however long that takes.

        Raises
        ------
        CommandError
            It cannot be made.
        """
        task = self._task
        if task is None or (task.done() and self._clock() >= self._kept_until_s):
            self._task = task = asyncio.create_task(self._timed(), name="console report")
        await asyncio.wait({task}, timeout=None if wait else self._limit_s)
        if task.done():
            return HTTPStatus.OK, task.result()
        seconds = f"{self._clock() - self._began_s:.0f}"
        return HTTPStatus.ACCEPTED, PAGE.replace("SECONDS", seconds).encode()

    async def _timed(self) -> bytes:
        self._began_s = self._clock()
        try:
            return await self._make()
        finally:
            now_s = self._clock()
            self._kept_until_s = now_s + KEPT_S if now_s - self._began_s > self._limit_s else now_s

    async def close(self) -> None:
        """End a report that is being made."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait({self._task})
