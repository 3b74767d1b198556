"""The settings in force while the robot runs: one store, changed as a whole or not at all.

A changed file (SIGHUP), the console's parameters and undo all use it. The process takes the newest settings at the
beginning of each cycle, and subscribers are notified of every change.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Final, TypeAlias

from config.reload import Difference, ReloadResult, differences, reload
from config.settings import Settings

UNDO_MAX: Final = 100
"""Most changes that can be undone."""

PrepareSettings: TypeAlias = Callable[[Settings, Settings], Awaitable[str | None]]
"""Prepares this process for a change from the first settings to the second (`runtime.support.kernel_loader`);
returns why that is impossible, None if the change can be applied."""


class LiveSettings:
    """The settings in force, those before them, and who is notified of a change.

    Parameters
    ----------
    settings : Settings
        What the run starts with.
    """

    def __init__(self, settings: Settings) -> None:
        self.initial = settings
        """What the run was started with."""
        self._current = settings
        self._history: list[Settings] = []
        self._subscribers: list[Callable[[Settings], None]] = []

    @property
    def current(self) -> Settings:
        """The settings in force."""
        return self._current

    def subscribe(self, call: Callable[[Settings], None]) -> None:
        """Register a callback that gets the new settings after every change."""
        self._subscribers.append(call)

    def check(self, propose: Callable[[], Settings], also: frozenset[str] = frozenset()) -> ReloadResult:
        """Return the effect of a change: its differences, or the problems for which it is refused.

        See `config.reload.reload` for its arguments.

        `propose` returns the new settings as a whole and raises ConfigError where they are invalid. Changes nothing,
        so that it may run in a thread.
        """
        return reload(self._current, propose, also)

    def apply(self, settings: Settings, *, can_undo: bool) -> tuple[Difference, ...]:
        """Put settings in force that `check` has accepted; return what changed.

        A change that cannot be undone also ends the history for `undo`.
        """
        changed = tuple(differences(self._current, settings))
        if not changed:
            return ()
        history = [*self._history, self._current] if can_undo else []
        if settings.places != self._current.places:  # they have an undo of their own
            history = [before.model_copy(update={"places": settings.places}) for before in history]
            history = history[:-1] if history and history[-1] == settings else history
        if settings.models != self._current.models:
            # A model cannot be removed while the robot runs: undo reverts the other changes only.
            history = [before.model_copy(update={"models": settings.models}) for before in history]
            history = history[:-1] if history and history[-1] == settings else history
        self._history = history[-UNDO_MAX:]
        self._put_in_force(settings)
        return changed

    def undo(self) -> tuple[Difference, ...]:
        """Undo the last change and return what changed; empty if there is no change to undo."""
        if not self._history:
            return ()
        before = self._history.pop()
        changed = tuple(differences(self._current, before))
        self._put_in_force(before)
        return changed

    def _put_in_force(self, settings: Settings) -> None:
        self._current = settings
        for call in self._subscribers:
            call(settings)
