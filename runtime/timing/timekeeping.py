"""Where a run's time goes, and who is to blame for a cycle that is late.

All that this program does between two cycles is booked as a stretch with a name: a phase of the cycle, or a callback
of ours. What overlaps the time for which a cycle was late made it late; what was put aside for most of its time is
not to blame for that; and where nothing of ours overlaps, either an unknown callback had the thread or nobody here.
"""

from __future__ import annotations

from collections.abc import Callable
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

_PHASES: Final = frozenset(phase.value for phase in Phase)

MOSTLY: Final = 0.5
"""Of a span of time: a share above this is what it was spent on."""

STRETCHES_MAX: Final = 256
"""Stretches kept from one cycle to the next; the oldest leave."""


class Span(NamedTuple):
    """Something of ours that had the loop."""

    name: str
    begin: ClockSample
    end: ClockSample

    @property
    def took_s(self) -> float:
        """How long it had the loop."""
        return self.end.host_s - self.begin.host_s

    def held_up_by(self) -> str | None:
        """Return who kept it from working for most of its time, None where it was slow by itself."""
        if self.end.waits == self.begin.waits:
            return _robbed(self.begin, self.end)
        return _beside(self.begin, self.end, self.took_s)


class Latest(NamedTuple):
    """How the newest cycle went."""

    phases_s: dict[str, float]
    """What each phase took."""
    late_s: float
    """How long after its time it began."""


class Timing(TypedDict):
    """The books of a run, times in microseconds."""

    period: float
    """From cycle to cycle, as it was at the end."""
    following: float
    """Share of the cycles that followed the ring."""
    late: Spread
    """How long after its time a cycle began."""
    echo_wait: Spread
    """How long the oldest echo of a cycle had waited when it began."""
    phases: dict[str, Spread]
    callbacks: dict[str, Spread]
    overruns: int
    """Times that this program was still busy, or not awake, a whole period after the last cycle began."""
    missed: int
    faults: dict[str, int]
    """Late and overrun cycles by culprit."""


class Timekeeper:
    """CycleStats the stretches of a run and judges late cycles.

    Parameters
    ----------
    books : CycleStats
        Where durations, lateness and culprits go.
    read : callable
        The clocks.
    seen : callable
        What ran when a cycle was overdue, where anybody looked.
    callbacks : tuple of str
        Names of the callbacks that will be timed.
    """

    def __init__(
        self,
        books: CycleStats,
        read: Callable[[], ClockSample],
        seen: Callable[[], StackSample | None] = lambda: None,
        callbacks: tuple[str, ...] = (),
    ) -> None:
        self._books = books
        self._read = read
        self._seen = seen
        self._phases = {phase: Series(is_touched=True) for phase in Phase}
        self._callbacks = {name: Series(is_touched=True) for name in callbacks}
        self._echo_wait = Series(is_touched=True)
        self._stretches: list[Span] = []
        self._busy_s = 0.0
        self._begun: CycleStart | None = None
        self._begin: ClockSample | None = None
        self._mark: ClockSample | None = None
        self._last: ClockSample | None = None
        self._held_since_s = 0.0
        self._following = 0
        self._period_s = 0.0
        self.overruns = 0
        """Overruns so far."""
        self.in_a_row = 0
        """Overruns since the last cycle that kept its time."""
        self._row: dict[str, int] = {}

    def begin(self, now: ClockSample, begun: CycleStart, period_s: float, *, is_following: bool) -> None:
        """Begin a cycle and judge what came before it."""
        is_late = begun.late_s > self._books.late_after_s
        is_overrun = self._begin is not None and (begun.missed > 0 or self._busy_s >= period_s)
        if not is_overrun:
            self._row.clear()
        if is_late or is_overrun:
            culprit = self._judge(now, begun)
            self._books.blame(culprit)
            self._row[culprit] = self._row.get(culprit, 0) + is_overrun
        self._books.missed += begun.missed
        self.overruns += is_overrun
        self.in_a_row = self.in_a_row + 1 if is_overrun else 0
        if begun.echo_age_s is not None:
            self._echo_wait.add(begun.echo_age_s)
        self._following += is_following
        self._period_s = period_s
        self._stretches.clear()
        self._busy_s = 0.0
        self._begun, self._begin, self._mark = begun, now, now
        self._resume(now)

    def mark(self, phase: Phase) -> None:
        """Book the time since the last mark to `phase`, which has just ended."""
        now = self._read()
        if self._mark is not None:
            self._phases[phase].add(now.host_s - self._mark.host_s)
            self._enter(Span(phase.value, self._mark, now))
            self._mark = now

    def end(self) -> None:
        """End the cycle."""
        if self._mark is not None and self._begin is not None and self._begun is not None:
            self._books.enter(self._mark.host_s - self._begin.host_s, self._begun.late_s)

    def timed(self, name: str, call: Callable[P, R]) -> Callable[P, R]:
        """Return `call` as a stretch of that name, which must be one of the callbacks."""

        def stretch(*args: P.args, **kwargs: P.kwargs) -> R:
            begin = self._read()
            self._resume(begin)
            try:
                return call(*args, **kwargs)
            finally:
                end = self._read()
                self._callbacks[name].add(end.host_s - begin.host_s)
                self._enter(Span(name, begin, end))

        return stretch

    @property
    def held_since_s(self) -> float:
        """Since when the loop has been busy without a pause, s: nobody looked at the line since then."""
        return self._held_since_s

    @property
    def culprit(self) -> str:
        """Who is most often to blame for the overruns in a row; nobody where there are none."""
        return max(self._row, key=lambda name: self._row[name], default="")

    def latest(self) -> Latest:
        """Return how the newest cycle went, of whose phases those are known that have ended."""
        phases_s = {s.name: s.took_s for s in self._stretches if s.name in _PHASES}
        return Latest(phases_s, 0.0 if self._begun is None else self._begun.late_s)

    def timing(self) -> Timing:
        """Return the books."""
        cycles = max(1, self._books.cycles)
        return {
            "period": round(1e6 * self._period_s, 1),
            "following": round(self._following / cycles, 4),
            "late": self._books.lag.spread(),
            "echo_wait": self._echo_wait.spread(),
            "phases": {phase.value: series.spread() for phase, series in self._phases.items()},
            "callbacks": {name: series.spread() for name, series in self._callbacks.items() if series.count},
            "overruns": self.overruns,
            "missed": self._books.missed,
            "faults": dict(sorted(self._books.faults.items(), key=lambda item: -item[1])),
        }

    def _resume(self, now: ClockSample) -> None:
        """Take note of a beginning: either the loop has been busy ever since the last end, or it paused."""
        last, self._last = self._last, now
        if last is None or now.thread_s - last.thread_s < MOSTLY * (now.host_s - last.host_s):
            self._held_since_s = now.run_s

    def _enter(self, stretch: Span) -> None:
        if len(self._stretches) == STRETCHES_MAX:
            del self._stretches[0]
        self._stretches.append(stretch)
        # What it left of the run's time, which does not go on beyond a cycle that takes long where it is held.
        self._busy_s += stretch.end.run_s - stretch.begin.run_s
        self._last = stretch.end

    def _judge(self, now: ClockSample, begun: CycleStart) -> str:
        """Return the name of whoever kept the cycle from beginning in time, or left no time for it."""
        blamed: Span | None = None
        most = (0.0, 0.0)
        is_late = begun.late_s > self._books.late_after_s
        untimed_s = begun.late_s if is_late else 0.0
        for stretch in self._stretches:
            overlap_s = max(0.0, stretch.end.run_s - max(begun.due_s, stretch.begin.run_s)) if is_late else 0.0
            untimed_s -= overlap_s
            if (overlap_s, stretch.took_s) > most:
                blamed, most = stretch, (overlap_s, stretch.took_s)
        sight = self._seen()
        if blamed is not None and most[0] >= untimed_s:
            inside = f" (in {sight.function})" if sight is not None and blamed.name == Phase.OBSERVERS.value else ""
            return blamed.held_up_by() or f"{blamed.name}{inside}"
        if sight is not None:
            return f"callback {sight.callback}"
        last = self._last
        if last is None:
            return OUTSIDE
        # The time to account for begins where the cycle was due; before that the loop had a right to sleep.
        overdue_s = now.run_s - max(last.run_s, begun.due_s)
        if now.thread_s - last.thread_s > MOSTLY * overdue_s:
            return UNTIMED
        return _beside(last, now, overdue_s) or OUTSIDE


def _robbed(begin: ClockSample, end: ClockSample) -> str | None:
    """Return who had the time between two readings, None where the thread had most of it."""
    took_s = end.host_s - begin.host_s
    if end.thread_s - begin.thread_s > MOSTLY * took_s:
        return None
    return _beside(begin, end, took_s) or OUTSIDE


def _beside(begin: ClockSample, end: ClockSample, span_s: float) -> str | None:
    """Return that other threads of ours worked between two readings for most of such a span, None if not."""
    others_s = (end.process_s - begin.process_s) - (end.thread_s - begin.thread_s)
    return THREAD if others_s > MOSTLY * span_s else None
