"""Reading the configuration again while the robot runs: off the loop, one attempt at a time, told in the log.

A file on a slow disk must delay no cycle, so it is read in a thread; what comes of it is taken over by the process at
the start of a cycle (`RobotProcess.reconfigure`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, TypeAlias

from config.reload import ReloadResult, reload
from config.settings import Settings

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

Ready: TypeAlias = Callable[[Settings, Settings], Awaitable[str | None]]
"""Has this process readied to go from settings in force to other ones; says why it cannot. See `runtime.support.kernel_loader`."""


class Reloader:
    """Keeps the settings in force, and changes them as a whole or not at all.

    Parameters
    ----------
    current : Settings
        What the process was started with.
    propose : callable
        Loads the settings as they stand now; raises ConfigError. Called in a thread.
    take_over : callable
        Gets settings that are good, differ from the last ones, and need no restart. Called in the loop.
    log : structlog logger
        Told of every attempt.
    ready : Ready
        Awaited before anything is taken over.
    """

    def __init__(
        self,
        current: Settings,
        propose: Callable[[], Settings],
        take_over: Callable[[Settings], None],
        log: FilteringBoundLogger,
        ready: Ready,
    ) -> None:
        self.current = current
        self._propose = propose
        self._take_over = take_over
        self._log = log
        self._ready = ready
        self.on_taken: Callable[[Settings], None] = lambda _settings: None
        """Told of settings that were taken over from the files."""
        self._under_way: asyncio.Task[None] | None = None
        self._again = False

    def ask(self) -> None:
        """Begin an attempt; asked for while one is under way, another follows, so that the last word counts."""
        if self._under_way is not None and not self._under_way.done():
            self._again = True
            return
        self._under_way = asyncio.get_running_loop().create_task(self._attempts(), name="reload")

    def supersede(self, settings: Settings) -> None:
        """Take over settings that came by another way; the next attempt is compared with them."""
        self._take_over(settings)
        self.current = settings

    async def settled(self) -> None:
        """Wait until no attempt is under way."""
        if self._under_way is not None:
            await asyncio.gather(self._under_way, return_exceptions=True)

    def probe(self) -> str | None:
        """Say how an attempt ended that should have gone on; None where none has. See `runtime.support.health`."""
        task = self._under_way
        return "it was ended from outside" if task is not None and task.cancelled() else None

    def cancel(self) -> None:
        """Drop what is under way."""
        if self._under_way is not None:
            self._under_way.cancel()

    async def _attempts(self) -> None:
        while True:
            self._again = False
            try:
                outcome = await asyncio.to_thread(reload, self.current, self._propose)
                validate = await self._ready(self.current, outcome.settings)
                self._conclude(outcome if validate is None else ReloadResult(self.current, problems=(validate,)))
            except Exception as error:  # noqa: BLE001 - a reload that fails must not end a run that goes well
                self._log.error(
                    "the configuration is kept: reading it failed", error=f"{type(error).__name__}: {error}"
                )
            if not self._again:
                return

    def _conclude(self, outcome: ReloadResult) -> None:
        if outcome.problems:
            for line in outcome.problems:
                self._log.warning("the configuration is kept", problem=line)
        elif not outcome.changed:
            self._log.info("the configuration is as before")
        else:
            self._take_over(outcome.settings)
            self.current = outcome.settings
            self.on_taken(outcome.settings)
            self._log.info("the configuration is taken over", changed=[str(d) for d in outcome.changed])
