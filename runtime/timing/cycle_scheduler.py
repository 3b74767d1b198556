"""The beat of the main process: it waits for the next cycle, and keeps the books of how that went.

Pacer, waker, timekeeper and watch know nothing of each other; here they are one thing that the process can ask.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Final

from config.settings import Settings
from runtime.timing.clock_sampler import ClockSample, ClockSampler
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.pacing import CycleStart, Pacer
from runtime.timing.run_clock import run_clock
from runtime.timing.stall_sampler import StallSampler
from runtime.timing.timekeeping import Timekeeper
from runtime.timing.wake import Waker

LATE_SHARE: Final = 0.1
"""A cycle that begins later than this share of its period is late."""

PATIENCE_SHARE: Final = 0.5
"""An echo is waited for no longer than this share of the time between commands that the base's deadman allows."""

OVERRUN: Final = "{} cycles in a row left no time for the next one, mostly through {}: take load off it, then re-arm"


class CycleScheduler:
    """When cycles begin, and what came of it.

    Parameters
    ----------
    settings : Settings
        Rate, firing step, and the limit on overruns.
    clock : callable
        Monotonic, s; or the run's.
    callbacks : tuple of str
        Names of the callbacks that the keeper will time.
    """

    def __init__(self, settings: Settings, clock: Callable[[], float], callbacks: tuple[str, ...] = ()) -> None:
        self._period_s = 1.0 / settings.cycle.rate_hz
        self._step_s = settings.ring.firing.step_period_s
        self._overruns_max = settings.cycle.overruns_max
        self._clock = run_clock(clock)
        self._read = ClockSampler(self._clock).read
        self._waker = Waker(self._clock)
        self._clock.listen(self._waker.wake)
        self._watch = StallSampler()
        self._pacer: Pacer | None = None
        self.books = CycleStats(LATE_SHARE * self._period_s, is_touched=True)
        self.keeper = Timekeeper(self.books, self._read, lambda: self._watch.seen, callbacks)

    def start(self, run_s: float, gap_max_s: float) -> AbstractContextManager[None]:
        """Have the first cycle due at `run_s`, commands being `gap_max_s` apart at most; watch while inside."""
        self._pacer = Pacer(run_s, self._period_s, self._step_s, PATIENCE_SHARE * gap_max_s)
        return self._watch.on_duty()

    def hear(self, run_s: float) -> None:
        """Take note that an echo has just been read from the line."""
        if self._pacer is not None:
            self._pacer.hear(run_s, self.keeper.held_since_s)
            self._waker.wake()

    def wake(self) -> None:
        """End the wait before its time."""
        self._waker.wake()

    async def wait(self) -> ClockSample | None:
        """Sleep until the next cycle is due and return what the clocks show; None where it was woken before."""
        pacer = self._started()
        await self._waker.until(pacer.deadline_s)
        return None if self._clock.expect(pacer.deadline_s) > 0.0 else self._read()

    def begin(self, now: ClockSample) -> CycleStart:
        """Begin a cycle."""
        pacer = self._started()
        period_s, is_following = pacer.period_s, pacer.is_locked
        self._clock.begun()
        begun = pacer.begin(now.run_s)
        self.keeper.begin(now, begun, period_s, is_following=is_following)
        self._watch.expect(pacer.due_s + self.books.late_after_s - now.run_s)
        return begun

    def end(self, run_s: float) -> float:
        """End the cycle at `run_s`; return how long the next one leaves, s."""
        self.keeper.end()
        return self._started().advance(run_s) - run_s

    def close(self) -> None:
        """Give the timer back; there is no further cycle."""
        self._waker.close()

    @property
    def overrun(self) -> str | None:
        """Why the cycle cannot keep its time any more, None while it can."""
        row = self.keeper.in_a_row
        return OVERRUN.format(row, self.keeper.culprit) if row >= self._overruns_max else None

    def _started(self) -> Pacer:
        if self._pacer is None:
            raise RuntimeError("the rhythm was asked before it was started: a fault of this program")
        return self._pacer
