"""The schedule of the main process: waits for the next cycle, and measures how the cycles keep it.

Pacer, waker, timing monitor and stall sampler do not depend on each other; the scheduler connects them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from config.settings import Settings
from runtime.timing.clock_sampler import ClockSample, ClockSampler
from runtime.timing.cycle_gaps import CycleGaps
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.pacing import CycleStart, Pacer
from runtime.timing.run_clock import run_clock
from runtime.timing.stall_sampler import StallSampler
from runtime.timing.timing_monitor import TimingMonitor
from runtime.timing.wake import Waker

LATE_SHARE: Final = 0.1
"""A cycle that begins later than this share of its period is late."""

CYCLE_GAP_SHARE: Final = 0.5
"""Longest time between two cycles that wait for an echo, as a share of that which the base's deadman allows."""

OVERRUN: Final = "{} cycles in a row left no time for the next one, mostly through {}: reduce its load, then re-arm"


class CycleScheduler:
    """Decides when cycles begin and measures them.

    Parameters
    ----------
    settings : Settings
        Rate, firing step, and the limit on overruns.
    clock : callable
        The run's, or any monotonic clock, s.
    callbacks : tuple of str
        Names of the callbacks that `timing_monitor` will measure.
    """

    def __init__(self, settings: Settings, clock: Callable[[], float], callbacks: tuple[str, ...] = ()) -> None:
        self._period_s = 1.0 / settings.cycle.rate_hz
        self._step_s = settings.ring.firing.step_period_s
        self._overruns_max = settings.cycle.overruns_max
        self._clock = run_clock(clock)
        sampler = ClockSampler(self._clock)
        self._read = sampler.read
        self._waker = Waker(self._clock)
        self._clock.on_change(self._waker.wake)
        self._stall_sampler = StallSampler()
        self._pacer: Pacer | None = None
        self.gaps = CycleGaps()
        """Runs work in threads that rest in cycles."""
        self.stats = CycleStats(LATE_SHARE * self._period_s, is_touched=True)
        """Durations and lateness of all cycles."""
        self.timing_monitor = TimingMonitor(
            self.stats, sampler.read, lambda: self._stall_sampler.sample, callbacks, sampler.read_after
        )
        """Measures the phases of each cycle and the callbacks between two."""

    @contextmanager
    def start(self, run_s: float, gap_max_s: float) -> Iterator[None]:
        """Plan the first cycle for `run_s`; in this context stalls are sampled, and after it no thread rests.

        `gap_max_s` is the longest time between two commands that the base's deadman allows.
        """
        self._pacer = Pacer(run_s, self._period_s, self._step_s, CYCLE_GAP_SHARE * gap_max_s)
        try:
            with self._stall_sampler.active():
                yield
        finally:
            self.gaps.close()

    def on_echo(self, run_s: float) -> None:
        """Count an echo that has just been read from the line: it may begin the next cycle."""
        if self._pacer is not None:
            self._pacer.on_echo(run_s, self.timing_monitor.busy_since_run_s)
            self._waker.wake()

    def wake(self) -> None:
        """End the wait before its time."""
        self._waker.wake()

    async def wait(self) -> ClockSample | None:
        """Sleep until the next cycle is due and return the clocks; None if `wake` ended the sleep early."""
        pacer = self._started()
        await self._waker.until(pacer.deadline_s)
        return None if self._clock.expect(pacer.deadline_s) > 0.0 else self._read()

    def begin(self, now: ClockSample) -> CycleStart:
        """Begin a cycle and return how it begins."""
        pacer = self._started()
        period_s, is_following = pacer.period_s, pacer.is_locked
        self.gaps.begin()
        self._clock.cycle_began()
        start = pacer.begin(now.run_s)
        self.timing_monitor.begin(now, start, period_s, is_following=is_following)
        self._stall_sampler.sample_after(pacer.due_s + self.stats.late_after_s - now.run_s)
        return start

    def end(self, run_s: float) -> float:
        """End the cycle at `run_s`; return the time until the next one, s."""
        self.timing_monitor.end()
        pacer = self._started()
        slack_s = pacer.advance(run_s) - run_s
        self.gaps.end(min(slack_s, pacer.due_s - run_s))
        return slack_s

    def quiet_s(self, run_s: float) -> float:
        """Return for how long after `run_s` no echo is expected, s; zero while the run's time is scaled or paused."""
        return self._started().quiet_until_s - run_s if self._clock.is_real_time else 0.0

    def close(self) -> None:
        """Release the timer; there is no further cycle."""
        self._waker.close()

    @property
    def overrun(self) -> str | None:
        """Why the cycle can no longer keep its period, None while it can."""
        count = self.timing_monitor.overruns_in_a_row
        return OVERRUN.format(count, self.timing_monitor.main_cause) if count >= self._overruns_max else None

    def _started(self) -> Pacer:
        if self._pacer is None:
            raise RuntimeError("the scheduler was used before it was started: a program error")
        return self._pacer
