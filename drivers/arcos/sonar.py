"""Firings from the sonar lists of SIPs: which discs fired together, and when.

All arrays fire in parallel, one disc each per sonar cycle, and a range is known at the end of its cycle. A SIP lists
the ranges that became known since the last one, in the order of firing, without times. But each list bounds them: the
cycle of its last range has ended before the SIP, and the next cycle has not. As SIPs and cycles shift against each
other, these bounds narrow from SIP to SIP: with SIPs each 100 ms to 20 ms for cycles of 40 ms, and to 3 ms for 41 ms.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from drivers.arcos.frames import NO_ECHO_MM, SonarReading
from drivers.messages import Floats

DISCS_PER_ARRAY: Final = 8
_SLACK_S: Final = 3e-4
"""By how much the bounds widen from one SIP to the next, s: the robot's clock and the run's differ a little."""
_JITTER_S: Final = 5e-3
"""Bounds that contradict each other by no more than this do so because the times of SIPs are not exact."""
_ORDER_S: Final = 1e-4
"""Least time between two firings, s."""
_TOO_MANY: Final = 2
"""More ranges than fit between two SIPs by this number were not measured one by one, but as by a simulator."""


class SonarTimes:
    """Estimates when sonar cycles of `cycle_s` end."""

    def __init__(self, cycle_s: float) -> None:
        self.cycle_s = cycle_s
        self._low_s, self._high_s = -math.inf, math.inf
        """Bounds of the end of the last cycle."""

    def last_end_s(self, sip_s: float, count: int) -> float:
        """Return when the last cycle ended whose range is in the SIP measured at `sip_s`.

        `count` cycles ended since the SIP before.

        Each SIP with ranges is given once, in order: it narrows the bounds for the next.
        """
        passed_s = count * self.cycle_s
        low_s = max(self._low_s + passed_s - _SLACK_S, sip_s - self.cycle_s)
        high_s = min(self._high_s + passed_s + _SLACK_S, sip_s)
        if low_s > high_s + _JITTER_S:  # a SIP was lost, or the sonar was off
            low_s, high_s = sip_s - self.cycle_s, sip_s
        elif low_s > high_s:
            low_s = high_s = 0.5 * (low_s + high_s)
        self._low_s, self._high_s = low_s, high_s
        return 0.5 * (low_s + high_s)


class SonarRing:
    """Turns the sonar lists of one robot into ranges by sensor.

    `discs` are the robot's numbers of the ring's sensors; `range_factor` is millimetres per unit of a range.
    """

    def __init__(self, discs: tuple[int, ...], range_factor: float) -> None:
        self._sensors = {disc: sensor for sensor, disc in enumerate(discs)}
        self._range_factor = range_factor
        self._times = SonarTimes(0.04)
        self._window_m = NO_ECHO_MM * 1e-3
        """A range from here on is silence."""
        self._fired_s = -math.inf
        """Time of the last firing."""

    def set_cycle(self, cycle_s: float, window_m: float) -> None:
        """Set the time from one firing to the next, and the range beyond which a firing hears nothing."""
        self._window_m = min(window_m, NO_ECHO_MM * 1e-3)
        if cycle_s != self._times.cycle_s:
            self._times = SonarTimes(cycle_s)

    def restart(self) -> None:
        """Forget the times of earlier firings."""
        self._times = SonarTimes(self._times.cycle_s)
        self._fired_s = -math.inf

    def firings(
        self, readings: tuple[SonarReading, ...], sip_s: float, period_s: float
    ) -> list[tuple[float, Floats]]:
        """Return time and ranges of each firing whose ranges a SIP lists, oldest first; times only grow.

        The SIP was measured at `sip_s`, `period_s` after the one before. Times and ranges are as in `Firing`.
        """
        arrays: dict[int, list[SonarReading]] = {}
        for reading in readings:
            arrays.setdefault(reading.number // DISCS_PER_ARRAY, []).append(reading)
        if not arrays:
            return []
        count, cycle_s = max(map(len, arrays.values())), self._times.cycle_s
        if count > period_s / cycle_s + _TOO_MANY:
            return self._at(sip_s, list(readings))
        end_s = self._times.last_end_s(sip_s, count)
        firings: list[tuple[float, Floats]] = []
        for back in range(count, 0, -1):
            fired = [array[-back] for array in arrays.values() if back <= len(array)]
            firings += self._at(end_s - back * cycle_s, fired)
        return firings

    def _at(self, fired_s: float, readings: list[SonarReading]) -> list[tuple[float, Floats]]:
        """Return the firing of these discs; none if the ring has none of them."""
        ranges = np.full(len(self._sensors), math.nan)
        for reading in readings:
            sensor = self._sensors.get(reading.number)
            if sensor is not None and reading.range_raw > 0 and math.isnan(ranges[sensor]):
                range_m = 1e-3 * self._range_factor * reading.range_raw
                ranges[sensor] = range_m if range_m < self._window_m else math.inf
        if np.isnan(ranges).all():
            return []
        self._fired_s = max(fired_s, self._fired_s + _ORDER_S)
        return [(self._fired_s, ranges)]
