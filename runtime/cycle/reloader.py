"""Reading the configuration files again while the robot runs: off the loop, one attempt at a time, logged.

A file on a slow disk must delay no cycle, so the files are read in a thread; the process takes the new settings at
the beginning of a cycle.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING

from config.files import ConfigError
from config.reload import ReloadResult
from config.settings import Settings
from runtime.cycle.live_settings import LiveSettings, PrepareSettings

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger


class Reloader:
    """Puts the settings of the files in force, as a whole or not at all.

    Parameters
    ----------
    live_settings : LiveSettings
        The settings in force.
    propose : callable
        Loads the settings from the files as they are now; raises ConfigError. Called in a thread.
    log : structlog logger
        Gets the result of every attempt.
    prepare : PrepareSettings
        Awaited before new settings are put in force.
    """

    def __init__(
        self,
        live_settings: LiveSettings,
        propose: Callable[[], Settings],
        log: FilteringBoundLogger,
        prepare: PrepareSettings,
    ) -> None:
        self._live_settings = live_settings
        self._propose = propose
        self._log = log
        self._prepare = prepare
        self._places_of_files = live_settings.initial.places
        """As of the start, or of the last attempt that was not refused."""
        self._task: asyncio.Task[None] | None = None
        self._is_requested = False

    def request(self) -> None:
        """Begin an attempt; during one, request another after it, so that the newest files are read."""
        if self._task is not None and not self._task.done():
            self._is_requested = True
            return
        self._task = asyncio.get_running_loop().create_task(self._attempts(), name="reload")

    async def settled(self) -> None:
        """Wait until no attempt is in progress."""
        if self._task is not None:
            await asyncio.gather(self._task, return_exceptions=True)

    def probe(self) -> str | None:
        """Return how an attempt ended unexpectedly, None otherwise; see `runtime.support.health`."""
        return "its task was cancelled" if self._task is not None and self._task.cancelled() else None

    def cancel(self) -> None:
        """Drop the attempt in progress."""
        if self._task is not None:
            self._task.cancel()

    async def _attempts(self) -> None:
        """Make an attempt, and another if one was requested meanwhile; an error is logged and changes nothing."""
        while True:
            self._is_requested = False
            try:
                await self._attempt()
            except Exception as error:  # noqa: BLE001 - a reload that fails must not end a run that goes well
                self._log.error(
                    "the configuration cannot be read and stays as it is", error=f"{type(error).__name__}: {error}"
                )
            if not self._is_requested:
                return

    async def _attempt(self) -> None:
        """Read the files, prepare this process for the change, and put it in force."""
        live = self._live_settings
        try:
            of_files = await asyncio.to_thread(self._propose)
        except ConfigError as error:
            self._conclude(ReloadResult(live.current, problems=error.problems))
            return
        before = live.current
        result = live.check(lambda: self._with_live_places(of_files))
        problem = await self._prepare(before, result.settings)
        if problem is not None:
            result = ReloadResult(before, problems=(problem,))
        elif live.current is not before and not result.problems:
            # Changed from the console meanwhile; the files take precedence if that change is possible too.
            result = live.check(lambda: self._with_live_places(of_files))
        if not result.problems:
            self._places_of_files = of_files.places
        self._conclude(result)

    def _with_live_places(self, of_files: Settings) -> Settings:
        """Return the files' settings, with the places as an operator left them unless the files' have changed."""
        if of_files.places != self._places_of_files:
            return of_files
        return of_files.model_copy(update={"places": self._live_settings.current.places})

    def _conclude(self, result: ReloadResult) -> None:
        """Log what came of an attempt, and put what it changes in force."""
        if result.problems:
            for line in result.problems:
                self._log.warning("the new configuration is refused", problem=line)
        elif not result.changed:
            self._log.info("the configuration has not changed")
        else:
            changed = self._live_settings.apply(result.settings, can_undo=False)
            self._log.info("the new configuration is in use", changed=[str(d) for d in changed])
