"""The timing monitor: measures how a run spends its time, and names what delayed a late cycle.

All work of this program between two cycles is measured as a span with a name: a phase of the cycle, or one of its
callbacks. A cycle was delayed by the span that overlaps most of its lateness, unless the system suspended that span
for most of its time. Where no span overlaps, either a callback without a name had the thread, or the cause lies
outside.
"""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType
from typing import Final, NamedTuple, ParamSpec, TypedDict, TypeVar

from runtime.timing.clock_sampler import ClockSample
from runtime.timing.cycle_stats import CycleStats, Series, Spread
from runtime.timing.pacing import CycleStart
from runtime.timing.phases import Phase
from runtime.timing.stall_sampler import StackSample

P = ParamSpec("P")
R = TypeVar("R")

OUTSIDE: Final = "outside the process"
THREAD: Final = "another thread of this process"
UNTIMED: Final = "a callback that is not timed"

_NAMES: Final = MappingProxyType({phase: phase.value for phase in Phase})
"""`value` is a property in Python, and each phase of each cycle would ask for it."""

MOST: Final = 0.5
"""A span of time counts as spent on what took more than this share of it."""

SPANS_MAX: Final = 256
"""Most spans kept from one cycle to the next; beyond it the oldest are dropped."""


class Span(NamedTuple):
    """A part of this program's work in the loop, from begin to end."""

    name: str
    begin: ClockSample
    end: ClockSample

    @property
    def took_s(self) -> float:
        """Its duration by the host's clock."""
        return self.end.host_s - self.begin.host_s

    def suspended_by(self) -> str | None:
        """Return what prevented it from running for most of its time, None if its own work took that long."""
        if self.end.waits == self.begin.waits:
            return _suspended_by(self.begin, self.end)
        return _other_threads(self.begin, self.end, self.took_s)


class LastCycle(NamedTuple):
    """The timing of the newest cycle."""

    phases_s: dict[str, float]
    """Duration of each phase that has ended."""
    late_s: float
    """How long after its time it began."""


class TimingSummary(TypedDict):
    """The timing of a run, times in microseconds."""

    period: float
    """From cycle to cycle, as of the end."""
    following: float
    """Share of the cycles that followed the ring."""
    late: Spread
    """How long after its time a cycle began."""
    echo_wait: Spread
    """How long the oldest echo of a cycle had waited when the cycle began."""
    phases: dict[str, Spread]
    callbacks: dict[str, Spread]
    overruns: int
    """Times that this program was still busy, or not awake, a whole period after the last cycle began."""
    missed: int
    faults: dict[str, int]
    """Late and overrun cycles by cause."""


class TimingMonitor:
    """Measures the spans of a run and finds the cause of each late cycle.

    Parameters
    ----------
    stats : CycleStats
        Gets durations, lateness and causes.
    read : callable
        Returns all clocks.
    stack_sample : callable
        Returns what ran when a cycle was overdue, if that was sampled.
    callbacks : tuple of str
        Names of the callbacks that will be measured.
    read_after : callable, optional
        Returns all clocks at the end of work that began at a sample; by default `read` does.
    """

    def __init__(
        self,
        stats: CycleStats,
        read: Callable[[], ClockSample],
        stack_sample: Callable[[], StackSample | None] = lambda: None,
        callbacks: tuple[str, ...] = (),
        read_after: Callable[[ClockSample], ClockSample] | None = None,
    ) -> None:
        self._stats = stats
        self._read = read
        self._read_after = (lambda _: read()) if read_after is None else read_after
        self._stack_sample = stack_sample
        self._phases = {phase: Series(is_touched=True) for phase in Phase}
        self._callbacks = {name: Series(is_touched=True) for name in callbacks}
        self._echo_wait = Series(is_touched=True)
        self._spans: list[Span] = []
        """What was measured since the newest cycle began: its phases, and the callbacks after it."""
        self._phases_s: dict[str, float] = {}
        self._busy_s = 0.0
        """Their duration together, by the run's clock."""
        self._start: CycleStart | None = None
        self._begin: ClockSample | None = None
        """Of the newest cycle; None before the first one. `_mark` is the end of its last phase so far."""
        self._mark: ClockSample | None = None
        self._last: ClockSample | None = None
        """The end of the last span, or the beginning of the one in progress; None before the first one."""
        self._busy_since_run_s = 0.0
        self._following = 0
        self._period_s = 0.0
        self.overruns = 0
        """Overruns so far."""
        self.overruns_in_a_row = 0
        """Overruns since the last cycle that kept its time."""
        self._causes_in_a_row: dict[str, int] = {}

    def begin(self, now: ClockSample, start: CycleStart, period_s: float, *, is_following: bool) -> None:
        """Begin a cycle; count it and its cause where it is late or the one before overran.

        Parameters
        ----------
        now : ClockSample
            The cycle's beginning.
        start : CycleStart
            How late it begins.
        period_s : float
            The time from cycle to cycle.
        is_following : bool
            Whether cycles follow the ring's echoes.
        """
        is_late = start.late_s > self._stats.late_after_s
        is_overrun = self._begin is not None and (start.missed > 0 or self._busy_s >= period_s)
        if not is_overrun:
            self._causes_in_a_row.clear()
        if is_late or is_overrun:
            cause = self._cause(now, start)
            self._stats.add_cause(cause)
            self._causes_in_a_row[cause] = self._causes_in_a_row.get(cause, 0) + is_overrun
        self._stats.missed += start.missed
        self.overruns += is_overrun
        self.overruns_in_a_row = self.overruns_in_a_row + 1 if is_overrun else 0
        if start.echo_age_s is not None:
            self._echo_wait.add(start.echo_age_s)
        self._following += is_following
        self._period_s = period_s
        self._spans.clear()
        self._phases_s = {}
        self._busy_s = 0.0
        self._start, self._begin, self._mark = start, now, now
        self._resume(now)

    def mark(self, phase: Phase) -> None:
        """End `phase`: it took the time since the last mark."""
        begin = self._mark
        if begin is not None:
            self._mark = now = self._read_after(begin)
            took_s = self._phases_s[_NAMES[phase]] = now.host_s - begin.host_s
            self._phases[phase].add(took_s)
            self._add_span(Span(_NAMES[phase], begin, now))

    def end(self) -> None:
        """End the cycle."""
        if self._mark is not None and self._begin is not None and self._start is not None:
            self._stats.add_cycle(self._mark.host_s - self._begin.host_s, self._start.late_s)

    def timed(self, name: str, call: Callable[P, R]) -> Callable[P, R]:
        """Return `call` measured as a span of that name, which must be one of the callbacks."""

        def span(*args: P.args, **kwargs: P.kwargs) -> R:
            begin = self._read()
            self._resume(begin)
            try:
                return call(*args, **kwargs)
            finally:
                end = self._read_after(begin)
                self._callbacks[name].add(end.host_s - begin.host_s)
                self._add_span(Span(name, begin, end))

        return span

    @property
    def busy_since_run_s(self) -> float:
        """Since when the loop has been busy without a pause, by the run's clock: the line was not read since."""
        return self._busy_since_run_s

    @property
    def main_cause(self) -> str:
        """The most frequent cause of the overruns in a row; empty without overruns."""
        return max(self._causes_in_a_row, key=lambda name: self._causes_in_a_row[name], default="")

    def last_cycle(self) -> LastCycle:
        """Return the timing of the newest cycle, with the phases that have ended.

        Not of the spans: the oldest of them make room in a long pause.
        """
        return LastCycle(dict(self._phases_s), 0.0 if self._start is None else self._start.late_s)

    def summary(self) -> TimingSummary:
        """Return the timing of the run so far."""
        cycles = max(1, self._stats.cycles)
        return {
            "period": round(1e6 * self._period_s, 1),
            "following": round(self._following / cycles, 4),
            "late": self._stats.lag.spread(),
            "echo_wait": self._echo_wait.spread(),
            "phases": {phase.value: series.spread() for phase, series in self._phases.items()},
            "callbacks": {name: series.spread() for name, series in self._callbacks.items() if series.count},
            "overruns": self.overruns,
            "missed": self._stats.missed,
            "faults": dict(sorted(self._stats.causes.items(), key=lambda item: -item[1])),
        }

    def _resume(self, now: ClockSample) -> None:
        """Note the beginning of a span: since the end of the last one the loop was busy, or it paused."""
        last, self._last = self._last, now
        if last is None or now.thread_s - last.thread_s < MOST * (now.host_s - last.host_s):
            self._busy_since_run_s = now.run_s

    def _add_span(self, span: Span) -> None:
        """Keep a span of the cycle in progress, in place of the oldest one if there are too many."""
        if len(self._spans) == SPANS_MAX:
            del self._spans[0]
        self._spans.append(span)
        # By the run's clock, which stops during a long cycle if time is paused or scaled.
        self._busy_s += span.end.run_s - span.begin.run_s
        self._last = span.end

    def _cause(self, now: ClockSample, start: CycleStart) -> str:
        """Return what kept the cycle from beginning in time, or left no time for it."""
        longest: Span | None = None
        most = (0.0, 0.0)
        is_late = start.late_s > self._stats.late_after_s
        untimed_s = start.late_s if is_late else 0.0
        for span in self._spans:
            overlap_s = max(0.0, span.end.run_s - max(start.due_s, span.begin.run_s)) if is_late else 0.0
            untimed_s -= overlap_s
            if (overlap_s, span.took_s) > most:
                longest, most = span, (overlap_s, span.took_s)
        sample = self._stack_sample()
        if longest is not None and most[0] >= untimed_s:
            is_observer = longest.name == Phase.OBSERVERS.value
            inside = f" (in {sample.function})" if sample is not None and is_observer else ""
            return longest.suspended_by() or f"{longest.name}{inside}"
        if sample is not None:
            return f"callback {sample.callback}"
        last = self._last
        if last is None:
            return OUTSIDE
        # The time to explain begins where the cycle was due: before that the loop was free to sleep.
        overdue_s = now.run_s - max(last.run_s, start.due_s)
        if now.thread_s - last.thread_s > MOST * overdue_s:
            return UNTIMED
        return _other_threads(last, now, overdue_s) or OUTSIDE


def _suspended_by(begin: ClockSample, end: ClockSample) -> str | None:
    """Return what used the time between two samples, None if this thread used most of it."""
    took_s = end.host_s - begin.host_s
    if end.thread_s - begin.thread_s > MOST * took_s:
        return None
    return _other_threads(begin, end, took_s) or OUTSIDE


def _other_threads(begin: ClockSample, end: ClockSample, span_s: float) -> str | None:
    """Return `THREAD` where other threads of this process worked for most of `span_s`, None otherwise."""
    return THREAD if end.others_s - begin.others_s > MOST * span_s else None
