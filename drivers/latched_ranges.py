"""Whether a source repeats each sensor's last value until the sensor fires again, and the firings without repeats.

Many programs (RosAria, most loggers) give all sensors in every row, each with the last value it had. Taken
for firings, old ranges count again, at poses where nothing was measured.

A latched sensor changes when it fires: its changes are a cycle apart, and between them its value is equal to the bit.
A fresh sensor on which noise or motion shows changes at each firing; one on which they do not (coarse ranges, a robot
at rest, a wall alongside) changes by single steps of the resolution, or rarely, at intervals of any length. So only
changes by more than a step of the resolution count, and only the intervals between two of them in which the value was
repeated and nothing else. Their lengths are alike in a latched source, and in no other one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from drivers.firing_pattern import firing_pattern
from drivers.messages import Firing, Floats

if TYPE_CHECKING:
    from config.robot import RingConfig
    from drivers.driver import Received, RobotDriver

INTERVALS_MAX: Final = 128
"""Longest interval that is counted, in readings of a sensor: ten seconds of a log of ten rows a second."""
INTERVALS_MIN: Final = 60
"""Intervals on which the decision rests: with fewer, three neighbouring lengths may hold most of them by chance."""
ALIKE: Final = 0.6
"""Share of the intervals that lie within one reading of the commonest length, in a latched source. Chosen on few
latched and fresh drives; how far apart the two kinds lie is not measured over many."""
AT_ONCE: Final = 0.02
"""Greatest share of changes at two consecutive readings, in a latched source that gives each value at least twice."""
NOTE: Final = (
    "each sensor's value is repeated until the sensor fires again: only changes are taken as readings; set the "
    "source to send what is new if it can"
)


class RepeatDetector:
    """Counts of the intervals between changes, over all sensors."""

    def __init__(self, sensors: int) -> None:
        self._last: Floats = np.full(sensors, np.nan)
        self._interval: NDArray[np.int64] = np.zeros(sensors, dtype=np.int64)
        """Readings since the last great change; 0 where something else than repeats followed it."""
        self._step_m = np.inf
        """Least change seen: the resolution."""
        self._counts: NDArray[np.int64] = np.zeros(INTERVALS_MAX + 1, dtype=np.int64)

    def add(self, ranges_m: Floats) -> None:
        """Count what a firing says: ranges of all sensors, shape (sensors,), m; NaN did not fire."""
        was, has = self._last, ~np.isnan(ranges_m)
        known = has & ~np.isnan(was)
        same = known & (ranges_m == was)
        with np.errstate(invalid="ignore"):
            change = np.abs(ranges_m - was)  # NaN between inf and inf, which is a repeat
        changed = known & ~same
        if changed.any():
            self._step_m = min(self._step_m, float(change[changed].min()))
        great = changed & (change > 1.5 * self._step_m)
        ended = self._interval[great & np.isfinite(was)]  # silence repeats honestly
        ended = ended[(ended > 0) & (ended <= INTERVALS_MAX)]
        np.add.at(self._counts, ended, 1)
        self._interval[changed & ~great] = 0
        self._interval[same & (self._interval > 0)] += 1
        self._interval[great] = 1
        self._last = np.where(has, ranges_m, was)

    @property
    def period(self) -> int:
        """The number of readings that each value stands for; 1 if values are not repeated, or too few changed."""
        total = int(self._counts.sum())
        if total < INTERVALS_MIN or self._counts[1] > AT_ONCE * total:
            return 1
        most = int(self._counts.argmax())
        alike = int(self._counts[most - 1 : most + 2].sum())
        return most if most > 1 and alike > ALIKE * total else 1


class RepeatFilter:
    """Removes repeats from firings: what did not change since the last one did not fire.

    Silence repeats to the bit when a sensor fires again and hears nothing. It counts once in each cycle of the ring.

    Each sensor fires once in `cycle_s`, which is in the firings' unit of time. Values that differ from the last
    reading by `same_m` at most repeat it: a program that adds noise to what it repeats.
    """

    def __init__(self, sensors: int, cycle_s: float, same_m: float = 0.0) -> None:
        self.cycle_s, self._same_m = cycle_s, same_m
        self._last: Floats = np.full(sensors, np.nan)
        self._read_s: Floats = np.full(sensors, np.inf)
        """When each sensor last fired; inf before the first firing, of which nothing is known to be new."""

    def fresh(self, firing: Firing) -> Firing:
        """Return the firing with NaN for each repeated value; of the first firing, nothing is known to be new."""
        ranges, is_first = firing.ranges_m, bool(np.isposinf(self._read_s).all())
        has = ~np.isnan(ranges)
        is_due = np.isposinf(ranges) & (firing.robot_s - self._read_s >= 0.999 * self.cycle_s)
        with np.errstate(invalid="ignore"):
            differs = has & (ranges != self._last) & ~(np.abs(ranges - self._last) <= self._same_m)
        is_new = (differs | (has & is_due)) & (not is_first)
        self._last = np.where(differs, ranges, self._last)
        self._read_s = np.where(is_new | is_first, firing.robot_s, self._read_s)
        return replace(firing, ranges_m=np.where(is_new, ranges, np.nan))


class FreshDriver:
    """A `drivers.driver.RobotDriver` around another one: removes the repeats of a robot that sends last values.

    A ring whose values never change again then has not fired: the robot, which must not drive blind, stops. Silence
    is passed on once a cycle: in an open hall a sensor that fires gives it each time.

    Each sensor fires once in `cycle_s`, at most `set_size` at once: values are repeated only where firings have more.
    """

    def __init__(self, driver: RobotDriver, sensors: int, set_size: int, cycle_s: float) -> None:
        self._driver = driver
        self._sensors, self._set_size = sensors, set_size
        self._detector = RepeatDetector(sensors)
        self._filter = RepeatFilter(sensors, cycle_s)
        self._is_latched = False
        """Whether repeats have been found, and are removed from now on."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - all other members are the driver's, as they are
        return getattr(self._driver, name)

    def set_firing(self, ring: RingConfig) -> None:
        """Change the firing pattern, as of `drivers.driver.RobotDriver`: silence is passed on once in its cycle."""
        self._driver.set_firing(ring)
        pattern = firing_pattern(ring)
        self._set_size, self._filter.cycle_s = pattern.set_size, pattern.cycle_s

    def take_received(self) -> Received:
        """Return what was received since the last call, without repeats, and remove it.

        A robot that has restarted begins its times anew, so that no earlier one says when silence counts again.
        """
        received = self._driver.take_received()
        if received.rebooted:
            self._filter = RepeatFilter(self._sensors, self._filter.cycle_s)
        notes: tuple[str, ...] = ()
        fresh = []
        for firing in received.firings:
            without = self._filter.fresh(firing)
            if not self._is_latched and np.count_nonzero(~np.isnan(firing.ranges_m)) > self._set_size:
                self._detector.add(firing.ranges_m)
                self._is_latched = self._detector.period > 1
                notes = (NOTE,) if self._is_latched else ()
            fresh.append(without if self._is_latched else firing)
        return replace(received, firings=tuple(fresh), notes=(*received.notes, *notes))
