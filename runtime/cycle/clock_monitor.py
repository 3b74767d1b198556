"""Whether the robot's clock keeps time with the run's, so that the age of an echo is known.

A reading of the robot's clock arrives late, never early. How far it is ahead of the run's clock on arrival is its
lead, and the greatest lead of the last seconds belongs to the reading that was least late. Delays on the way only
lower a lead, for a moment, and a program that was held up finds the newest reading among those that waited.

- **Stands**: readings arrive, and for `STANDS_S` none is later than the one before.
- **Slow**: for `HELD_S` every lead is below the greatest by more than `LATE_S`, and the clock loses meanwhile. Behind
  a busy line, readings are late by the same time again and again, and lose nothing.
- **Fast**: a lead exceeds those of a period before by more than `AHEAD_S`: the clock leapt, or gains.

Small errors of the rate are the driver's to find, over minutes (`drivers.robot_clock`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from config.bounded import Count, Seconds
from drivers.messages import Firing, Odometry

PERIOD_S: Final = 5.0
"""Leads are compared over periods of this length, s: two crystals differ by a millisecond in it."""
PERIODS: Final = 2
"""Periods before the present one that are remembered."""
STANDS_S: Final = 0.3
STANDS_READINGS: Final = 3
"""A clock stands if so many readings, and for so long, show the same; some robots send each sample twice."""
LATE_S, HELD_S = 0.25, 0.25
"""Delays of a line, of USB and of a busy machine are shorter, s; a clock at half speed loses as much in .5 s."""
LOSES: Final = 0.9
"""A clock that runs at less than this share of the run's loses."""
AHEAD_S: Final = 0.25
"""By so much the least late of some seconds' readings is late at most, s."""
SETTLED_S: Final = 3.0
"""After a start or a lost line readings may be late for so long, s, as while programs are loaded."""


class ClockState(Enum):
    """How the robot's clock runs, compared with the run's."""

    RIGHT = "right"
    STANDS = "stands"
    SLOW = "slow"
    FAST = "fast"


@dataclass(frozen=True, slots=True)
class Reading:
    """A reading of the robot's clock, and when it arrived by the run's."""

    robot_s: Seconds
    run_s: Seconds


@dataclass(frozen=True, slots=True)
class Lead:
    """The greatest lead of the present period, and those of the periods before, s."""

    begin_run_s: Seconds
    newest_s: Seconds
    before_s: tuple[Seconds, ...] = ()

    @property
    def greatest_s(self) -> float:
        """The greatest of all."""
        return max(self.newest_s, *self.before_s) if self.before_s else self.newest_s

    def gained_s(self, lead_s: float, run_s: float) -> float:
        """Return by how much a lead exceeds those of a period before: a clock that gains raises newer ones."""
        if self.before_s:
            return lead_s - min(self.before_s)
        return lead_s - self.newest_s if run_s - self.begin_run_s >= SETTLED_S else 0.0

    def after(self, lead_s: float, run_s: float) -> Lead:
        """Return the lead after another reading."""
        if run_s - self.begin_run_s >= PERIOD_S:
            return Lead(run_s, lead_s, (*self.before_s, self.newest_s)[-PERIODS:])
        return self if lead_s <= self.newest_s else Lead(self.begin_run_s, lead_s, self.before_s)


@dataclass(frozen=True, slots=True)
class ClockMonitor:
    """Compares the robot's clock with the run's; immutable, as keyframes hold it."""

    clock: ClockState = ClockState.RIGHT
    """As of the newest cycle."""
    newest: Reading | None = None
    """The first reading that showed the newest time of the robot's clock."""
    repeats: Count = 0
    """How many readings have shown it since."""
    lead: Lead | None = None
    """Of odometry."""
    late: Reading | None = None
    """The first of the last readings that were all late; None if the last one was not."""
    heard: Lead | None = None
    """Of firings."""

    def observe(self, odometry: Odometry | None, firings: Sequence[Firing], run_s: float) -> ClockMonitor:
        """Return the monitor after a cycle.

        Odometry is the newest sample of the cycle that begins at `run_s`, None if there was none; firings are all of
        it.
        """
        heard = self.heard
        for firing in firings:
            lead_s = firing.robot_s - run_s
            heard = Lead(run_s, lead_s) if heard is None else heard.after(lead_s, run_s)
        if odometry is None:
            # As `replace` does, in a fifth of its time: this is called in each cycle.
            return ClockMonitor(ClockState.RIGHT, self.newest, self.repeats, self.lead, self.late, heard)
        reading = Reading(odometry.robot_s, run_s)
        if self.newest is not None and reading.robot_s <= self.newest.robot_s:
            repeats = self.repeats + 1
            stands = repeats >= STANDS_READINGS and run_s - self.newest.run_s >= STANDS_S
            clock = ClockState.STANDS if stands else ClockState.RIGHT
            return ClockMonitor(clock, self.newest, repeats, self.lead, self.late, heard)
        lead_s = reading.robot_s - run_s
        if self.lead is None:
            return ClockMonitor(ClockState.RIGHT, reading, 0, Lead(run_s, lead_s), None, heard)
        greatest_s = self.lead.greatest_s
        if self.lead.gained_s(lead_s, run_s) > AHEAD_S:
            return ClockMonitor(ClockState.FAST, reading, 0, Lead(run_s, lead_s), None, heard)
        lead, clock, late = self.lead.after(lead_s, run_s), ClockState.RIGHT, self.late
        if greatest_s - lead_s <= LATE_S:
            late = None
        elif late is None:
            late = reading
        elif (passed_s := run_s - late.run_s) >= HELD_S:
            if reading.robot_s - late.robot_s < LOSES * passed_s:
                clock = ClockState.SLOW
            late = reading
        return ClockMonitor(clock, reading, 0, lead, late, heard)

    def fired_s(self, run_s: float) -> float:
        """Return for how long the ring has fired on this line, s; 0 before its first firing, inf after a period."""
        if self.heard is None:
            return 0.0
        return math.inf if self.heard.before_s else run_s - self.heard.begin_run_s

    def now_s(self, robot_s: float, run_s: float) -> float:
        """Return the robot's time now, at which no echo is younger than the time since its arrival.

        `robot_s` is the newest time that the robot has reported.
        """
        return robot_s if self.heard is None else max(robot_s, run_s + self.heard.greatest_s)
