"""The log of modes: each mode that is entered, at a bounded rate, also for the service manager."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from drivers.token_bucket import LineLimit
from runtime.cycle.modes import Mode
from runtime.cycle.step import State
from runtime.support.sd_notify import SdNotifier

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

LINES_PER_S: Final = 2.0
LINES_BURST: Final = 200.0
"""Lines at once: a person changes the mode a few times a minute, a robot that fails to keep the line each cycle."""
STOP_REASONS_MAX: Final = 1000
"""Reasons of stops that are kept; the oldest are dropped."""


class ModeLog:
    """Logs each mode that is entered, and reports it to the service manager.

    Parameters
    ----------
    log : structlog logger
        Of the run.
    notifier : SdNotifier
        Gets each mode with its reason.

    Attributes
    ----------
    stop_reasons
        Of the newest stops, in order.
    """

    def __init__(self, log: FilteringBoundLogger, notifier: SdNotifier) -> None:
        self.stop_reasons: list[str] = []
        self._log = log
        self._notifier = notifier
        self._limit = LineLimit(LINES_PER_S, LINES_BURST)

    def entered(self, state: State, run_s: float) -> None:
        """Log the mode that was entered at `run_s`."""
        mode = state.mode
        if mode.mode in {Mode.SAFE_STOP, Mode.FAULT} and mode.reason is not None:
            self.stop_reasons.append(mode.reason)
            del self.stop_reasons[:-STOP_REASONS_MAX]
        self._notifier.status(mode.mode.value if mode.reason is None else f"{mode.mode.value}: {mode.reason}")
        left_out = self._limit.take(run_s)
        if left_out is not None:
            more = {"suppressed_before": left_out} if left_out else {}
            write = self._log.error if mode.mode is Mode.FAULT else self._log.info
            write("mode", mode=mode.mode.value, reason=mode.reason, cycle=state.cycle, **more)
