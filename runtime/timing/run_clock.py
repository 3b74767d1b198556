"""The clock of a run: the host's, or one that can be held where the robot's own time can be held with it.

Deadlines, silence, the base's deadman and the rhythm of cycles are all counted in the run's time. So where that
stands still nothing is late, nothing is silent and no cycle begins; and when it goes on, nobody can tell that it
stood. Only work is counted by the host's clock: a budget is for the machine, whatever the time of day in the run.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

from drivers.emulator.time_scale import REAL_TIME, TimeScale

LEASE_S: Final = 0.002
"""Where time is not free it goes on so far beyond the next cycle's deadline, and no farther until that is over.

So however slow the machine is, no cycle misses its time; nothing else needs the room.
"""

LEASE_LEAST_S: Final = 0.0005
"""A smaller extension is not worth telling."""


class RunClock:
    """The host's clock, as it is.

    Parameters
    ----------
    host : callable
        Monotonic, s.
    """

    def __init__(self, host: Callable[[], float] = time.monotonic) -> None:
        self.host = host

    def __call__(self) -> float:
        """Return the run's time, s."""
        return self.host()

    def at(self, host_s: float) -> float:
        """Return the run's time at a moment of the host's clock that is now."""
        return host_s

    def both(self) -> tuple[float, float]:
        """Return the present moment by the run's clock and by the host's, s."""
        host_s = self.host()
        return self.at(host_s), host_s

    def expect(self, due_s: float) -> float:
        """Take note of when the next cycle is due and return how long that is, s; inf where nobody knows.

        What it returns is for the host's clock; not above zero where the cycle may begin.
        """
        return due_s - self.host()

    def begun(self) -> None:
        """Take note that a cycle begins."""

    def release(self) -> None:
        """Let time go by freely from here on: the run comes to its end."""

    def listen(self, call: Callable[[], None]) -> None:
        """Have `call` called whenever `expect` would answer otherwise than by the passing of time."""


def run_clock(clock: Callable[[], float]) -> RunClock:
    """Return a run's clock for any clock."""
    return clock if isinstance(clock, RunClock) else RunClock(clock)


class PacedClock(RunClock):
    """A clock that shares its law with the emulator, and never goes beyond what the emulated robot has lived.

    Parameters
    ----------
    host : callable
        Monotonic, s; the emulator's as well.
    tell : callable
        Gets every new law for the emulator.

    Attributes
    ----------
    pace
        The law in force.
    factor
        How fast time goes, or will when it goes on.
    """

    def __init__(
        self, host: Callable[[], float] = time.monotonic, tell: Callable[[TimeScale], None] = lambda _: None
    ) -> None:
        super().__init__(host)
        self.tell = tell
        self.pace: TimeScale = REAL_TIME
        self.factor = 1.0
        self._lived_s = math.inf
        self._told_s = -math.inf
        self._shown_s = -math.inf
        self._due_s: float | None = None
        self._turns: int | None = None
        self._calls: list[Callable[[], None]] = []

    def __call__(self) -> float:
        """Return the run's time, s."""
        return self.at(self.host())

    def at(self, host_s: float) -> float:
        """Return the run's time at a moment of the host's clock that is now; it never goes back."""
        self._shown_s = max(self._shown_s, min(self.pace.run_at(host_s), self._lived_s))
        return self._shown_s

    def expect(self, due_s: float) -> float:
        """Take note of when the next cycle is due and return how long that is; inf while time is held before it."""
        self._due_s = due_s
        if self._turns == 0:
            return math.inf
        self._extend(due_s)
        host_s = self.host()
        run_s = self.at(host_s)
        if due_s <= run_s:
            return due_s - run_s
        return math.inf if due_s > self._lived_s else self.pace.host_at(due_s) - host_s

    def begun(self) -> None:
        """Take note that a cycle begins."""
        if self._turns:
            self._turns -= 1
            self._news()

    def release(self) -> None:
        """Let time go by freely from here on, whether the emulator follows or not."""
        self.factor = 1.0
        if self._turns is not None or not self.pace.is_real_time:
            self.go()

    def listen(self, call: Callable[[], None]) -> None:
        """Have `call` called whenever `expect` would answer otherwise than by the passing of time."""
        self._calls.append(call)

    @property
    def is_held(self) -> bool:
        """Whether time goes on only step by step."""
        return self._turns is not None

    @property
    def is_still(self) -> bool:
        """Whether both sides stand at the same time, and no cycle is to come."""
        return self._turns == 0 and self._told_s >= self.pace.until_s

    @property
    def has_beat(self) -> bool:
        """Whether anybody waits for cycles by this clock."""
        return self._due_s is not None

    def hold(self, lead_s: float) -> None:
        """Begin no further cycle, and let time stand still `lead_s` of the host's from now, on both sides."""
        self._turns = 0
        host_s = self.host()
        here = self.at(host_s), self.pace.run_at(host_s)
        until_s = min(self.pace.until_s, max(here) + lead_s * self.pace.factor)
        self._told_s = -math.inf
        self._change(self.pace._replace(until_s=until_s))

    def step(self) -> None:
        """Let time go by, from where it is held, until the next cycle is due, and let that one begin."""
        self._turns = 1
        run_s = self()
        self._lived_s, self._told_s = run_s, -math.inf
        self._change(TimeScale(self.host(), run_s, self.factor, max(run_s, self._due_s or run_s)))

    def go(self) -> None:
        """Let time go by from where it is held."""
        self._turns = None
        host_s = self.host()
        run_s = self.at(host_s)
        is_free = self.factor == 1.0
        until_s = math.inf if is_free else max(run_s, self._due_s or run_s) + LEASE_S
        self._lived_s = math.inf if is_free else run_s
        self._change(TimeScale(host_s, run_s, self.factor, until_s))

    def lived(self, run_s: float) -> None:
        """Take the emulator's word for how far its robot has lived, with what it sent by then on the line."""
        if self.pace.is_real_time:
            return
        self._lived_s = self._told_s = run_s
        if run_s > self.pace.until_s:
            # The law came too late for it; so both stand where it stands.
            self.pace = self.pace._replace(until_s=run_s)
        self._news()

    def _extend(self, due_s: float) -> None:
        """Let time that is not free go on to the next cycle, and where it had to wait, at the same pace from here."""
        pace = self.pace
        beyond_s, least_s = (LEASE_S, LEASE_LEAST_S) if self._turns is None else (0.0, 0.0)
        if pace.is_real_time or due_s + beyond_s <= pace.until_s + least_s:
            return
        host_s = self.host()
        if pace.host_at(pace.until_s) < host_s:
            pace = TimeScale(host_s, pace.until_s, pace.factor, pace.until_s)
        self.pace = pace._replace(until_s=due_s + beyond_s)
        self.tell(self.pace)

    def _news(self) -> None:
        for call in self._calls:
            call()

    def _change(self, pace: TimeScale) -> None:
        self.pace = pace
        self.tell(pace)
        self._news()
