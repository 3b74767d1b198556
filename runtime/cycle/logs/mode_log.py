"""The log of modes: each mode that is entered, at a bounded rate, also for the service manager."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from drivers.token_bucket import LineLimit
from runtime.cycle.logs.mission_log import MissionLog
from runtime.cycle.modes import RESTORED, STARTING, WAITING, Mode, ModeState
from runtime.cycle.step import State
from runtime.support.sd_notify import SdNotifier

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

LINES_PER_S: Final = 2.0
LINES_BURST: Final = 200.0
"""Lines at once: a person changes the mode a few times a minute, a robot that fails to keep the line each cycle."""
HELD_S: Final = 2.0
"""A reason that ends sooner, as that of a start that waits, is not logged, s."""
STOP_REASONS_MAX: Final = 1000
"""Reasons of stops that are kept; the oldest are dropped."""
STOPPED: Final = frozenset({Mode.SAFE_STOP, Mode.FAULT, Mode.CONNECTING})
NUMBER: Final = re.compile(r"\d+(\.\d+)?")
"""What may change in a reason that is still the same: how long, how often, how many."""


class ModeLog:
    """Logs each mode that is entered, and reports it to the service manager."""

    def __init__(self, log: FilteringBoundLogger, notifier: SdNotifier) -> None:
        self.stop_reasons: list[str] = []
        """Of the newest stops, and of lines that were lost in READY, in order: each reason that a stop had, but that
        the line is back. What a start waits for is no stop."""
        self._has_started = False
        """Whether the robot has been in another mode than CONNECTING."""
        self._kept = set[str]()
        """Those of the present stop, without their numbers."""
        self.missions = MissionLog(log)
        """How missions go on."""
        self._log = log
        self._notifier = notifier
        self.hold_reasons: list[str] = []
        """Why the robot held in DRIVE for `HELD_S` or more, in order."""
        self._held: str | None = None
        self._held_run_s: float | None = None
        self._is_logged = False
        self._limit = LineLimit(LINES_PER_S, LINES_BURST)

    def observe(self, state: State, before: ModeState, run_s: float) -> None:
        """Log the mode if it was entered since `before`, and why a robot in DRIVE holds, once that has lasted."""
        if state.mode.entered_since(before):
            self.entered(state, run_s)
        elif state.mode.reason != before.reason:
            self._keep(state.mode)
        self.missions.observe(state.drive_request, run_s)
        if state.hold_reason != self._held or self._held_run_s is None:
            self._held, self._held_run_s, self._is_logged = state.hold_reason, run_s, False
        elif not self._is_logged and self._held is not None and run_s - self._held_run_s >= HELD_S:
            self._is_logged = True
            self.hold_reasons.append(self._held)
            del self.hold_reasons[:-STOP_REASONS_MAX]
            if self._limit.take(run_s) is not None:
                self._log.info("holds", reason=self._held, cycle=state.cycle)

    def entered(self, state: State, run_s: float) -> None:
        """Log the mode that was entered at `run_s`."""
        mode = state.mode
        self._kept.clear()
        self._keep(mode)
        self._notifier.status(mode.mode.value if mode.reason is None else f"{mode.mode.value}: {mode.reason}")
        left_out = self._limit.take(run_s)
        if left_out is not None:
            more = {"suppressed_before": left_out} if left_out else {}
            write = self._log.error if mode.mode is Mode.FAULT else self._log.info
            write("mode", mode=mode.mode.value, reason=mode.reason, cycle=state.cycle, **more)

    def _keep(self, mode: ModeState) -> None:
        """Keep the reason of a stop, unless this stop has had it already, or it says that the line is back."""
        self._has_started |= mode.mode is not Mode.CONNECTING
        reason = (mode.reason or "").removeprefix(WAITING)
        text = NUMBER.sub("", reason)
        if not self._has_started or mode.mode not in STOPPED or reason in {"", STARTING}:
            return
        if not reason.startswith(RESTORED) and text not in self._kept:
            self._kept.add(text)
            self.stop_reasons.append(reason)
            del self.stop_reasons[:-STOP_REASONS_MAX]
