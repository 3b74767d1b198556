"""The clock of a run: the host's, or one that can be paused and scaled together with an emulated robot's time.

Deadlines, timeouts, the base's deadman and the schedule of cycles are all measured by the run's clock. So while it is
paused nothing is late, nothing times out and no cycle begins, and a pause does not affect any part of the run. Only
work is measured by the host's clock, because a budget is a property of the machine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

from drivers.emulator.time_scale import REAL_TIME, TimeScale

LEASE_S: Final = 0.002
"""How far scaled time may pass the next cycle's deadline before that cycle has started, s.

This limit prevents a cycle from missing its deadline, however slow the machine is.
"""

LEASE_MIN_S: Final = 0.0005
"""Smallest extension of the lease that is sent to the emulator, s."""


class RunClock:
    """The host's monotonic clock, unchanged."""

    def __init__(self, host: Callable[[], float] = time.monotonic) -> None:
        self.host = host

    def __call__(self) -> float:
        """Return the run's time, s."""
        return self.host()

    def at(self, host_s: float) -> float:
        """Return the run's time at the present moment `host_s` of the host's clock."""
        return host_s

    def both(self) -> tuple[float, float]:
        """Return the present moment by the run's clock and by the host's, s."""
        host_s = self.host()
        return self.at(host_s), host_s

    @property
    def is_real_time(self) -> bool:
        """Whether the run's time passes as the host's."""
        return True

    def expect(self, due_s: float) -> float:
        """Announce the next cycle and return the time until it is due, by the host's clock; inf where unknown.

        Not above zero where the cycle may begin.
        """
        return due_s - self.host()

    def cycle_began(self) -> None:
        """Count the beginning of a cycle."""

    def release(self) -> None:
        """Continue in real time until the end of the run."""

    def on_change(self, call: Callable[[], None]) -> None:
        """Register a callback for changes of the result of `expect` other than by the passing of time."""


def run_clock(clock: Callable[[], float]) -> RunClock:
    """Return a run's clock for any clock."""
    return clock if isinstance(clock, RunClock) else RunClock(clock)


class ScaledClock(RunClock):
    """A clock that shares its time scale with the emulator, and never passes the time that the emulator has reached.

    Parameters
    ----------
    host : callable
        Monotonic, s; the emulator's as well.
    send : callable
        Sends each new time scale to the emulator.
    """

    def __init__(
        self, host: Callable[[], float] = time.monotonic, send: Callable[[TimeScale], None] = lambda _: None
    ) -> None:
        super().__init__(host)
        self.send = send
        self.time_scale: TimeScale = REAL_TIME
        """The one in force."""
        self.factor = 1.0
        """Speed of time relative to real time, now or after the pause."""
        self._limit_run_s = math.inf
        """The run's time never passes this: where the emulator has acknowledged its time, or time was resumed."""
        self._acknowledged_run_s = -math.inf
        """The time that the emulator has reached under the present time scale; −inf until it says so."""
        self._latest_run_s = -math.inf
        """The latest time that was returned."""
        self._due_s: float | None = None
        """When the next cycle is due; None before the first one is planned."""
        self._cycles_left: int | None = None
        """Cycles that may still begin; None while time is not paused."""
        self._calls: list[Callable[[], None]] = []

    def __call__(self) -> float:
        """Return the run's time, s."""
        return self.at(self.host())

    def at(self, host_s: float) -> float:
        """Return the run's time at the present moment `host_s` of the host's clock; it never decreases."""
        if self.time_scale is REAL_TIME:
            return host_s  # time was never paused nor scaled
        self._latest_run_s = max(self._latest_run_s, min(self.time_scale.run_at(host_s), self._limit_run_s))
        return self._latest_run_s

    @property
    def is_real_time(self) -> bool:
        """Whether the run's time passes as the host's."""
        return self.time_scale.is_real_time

    def expect(self, due_s: float) -> float:
        """Announce the next cycle and return the time until it is due; inf while time is paused before it."""
        self._due_s = due_s
        if self._cycles_left == 0:
            return math.inf
        self._extend(due_s)
        host_s = self.host()
        run_s = self.at(host_s)
        if due_s <= run_s:
            return due_s - run_s
        return math.inf if due_s > self._limit_run_s else self.time_scale.host_at(due_s) - host_s

    def cycle_began(self) -> None:
        """Count the beginning of a cycle."""
        if self._cycles_left:
            self._cycles_left -= 1
            self._notify()

    def release(self) -> None:
        """Continue in real time until the end of the run, whether or not the emulator follows."""
        self.factor = 1.0
        if self._cycles_left is not None or not self.time_scale.is_real_time:
            self.resume()

    def on_change(self, call: Callable[[], None]) -> None:
        """Register a callback for changes of the result of `expect` other than by the passing of time."""
        self._calls.append(call)

    @property
    def is_paused(self) -> bool:
        """Whether time is paused, except for single steps."""
        return self._cycles_left is not None

    @property
    def is_still(self) -> bool:
        """Whether run and emulator have stopped at the same time, and no cycle is pending."""
        return self._cycles_left == 0 and self._acknowledged_run_s >= self.time_scale.until_s

    @property
    def has_cycles(self) -> bool:
        """Whether cycles are scheduled by this clock."""
        return self._due_s is not None

    def pause(self, lead_s: float) -> None:
        """Begin no further cycle, and stop time `lead_s` of the host's from now, for run and emulator."""
        self._cycles_left = 0
        host_s = self.host()
        here = self.at(host_s), self.time_scale.run_at(host_s)
        until_s = min(self.time_scale.until_s, max(here) + lead_s * self.time_scale.factor)
        self._acknowledged_run_s = -math.inf
        self._change(self.time_scale._replace(until_s=until_s))

    def step(self) -> None:
        """Resume paused time until the next cycle is due, and allow that cycle."""
        self._cycles_left = 1
        run_s = self()
        self._limit_run_s, self._acknowledged_run_s = run_s, -math.inf
        self._change(TimeScale(self.host(), run_s, self.factor, max(run_s, self._due_s or run_s)))

    def resume(self) -> None:
        """Resume paused time."""
        self._cycles_left = None
        host_s = self.host()
        run_s = self.at(host_s)
        is_free = self.factor == 1.0
        until_s = math.inf if is_free else max(run_s, self._due_s or run_s) + LEASE_S
        self._limit_run_s = math.inf if is_free else run_s
        self._change(TimeScale(host_s, run_s, self.factor, until_s))

    def acknowledged(self, run_s: float) -> None:
        """Note the time that the emulator has reached; all it sent by then is on the line."""
        if self.time_scale.is_real_time:
            return
        self._limit_run_s = self._acknowledged_run_s = run_s
        if run_s > self.time_scale.until_s:
            # The time scale reached the emulator too late, so both stop at the emulator's time.
            self.time_scale = self.time_scale._replace(until_s=run_s)
        self._notify()

    def _extend(self, due_s: float) -> None:
        """Extend scaled time past the next cycle's deadline, from now on if it had to wait."""
        scale = self.time_scale
        beyond_s, least_s = (LEASE_S, LEASE_MIN_S) if self._cycles_left is None else (0.0, 0.0)
        if scale.is_real_time or due_s + beyond_s <= scale.until_s + least_s:
            return
        host_s = self.host()
        if scale.host_at(scale.until_s) < host_s:
            scale = TimeScale(host_s, scale.until_s, scale.factor, scale.until_s)
        self.time_scale = scale._replace(until_s=due_s + beyond_s)
        self.send(self.time_scale)

    def _notify(self) -> None:
        for call in self._calls:
            call()

    def _change(self, time_scale: TimeScale) -> None:
        self.time_scale = time_scale
        self.send(time_scale)
        self._notify()
