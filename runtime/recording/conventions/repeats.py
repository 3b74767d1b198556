"""Whether the rows of a ring log repeat the last value of each sensor until it fires again.

A row with more numbers than sensors fire at once is no single firing: either all sensors fired in the time of a row,
or most numbers are old. Old ones are equal to the bit, and a sensor cannot change more often than it fires.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.latched_ranges import RepeatDetector
from drivers.messages import Floats
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError

RUNS_NAT: Final = 12.0
"""By how much rarer runs of changes are than those of a fresh source would be."""
GLITCHES: Final = 0.02
"""Share of runs that may contradict: rows at uneven times."""
ROWS_MIN: Final = 30
REPEATED: Final = 0.3
"""Share of repeats, as the robot moves, from which a log that shows nothing else is ambiguous: ranges to the
millimetre repeat hardly ever."""


def find_repeats(table: Table, set_size: int) -> float:
    """Return for how many rows a value stands; 1 if each row is fresh.

    Parameters
    ----------
    table : Table
        With NaN where the sensor did not fire and inf where nothing was heard.
    set_size : int
        Most sensors of the robot that fire at once.

    Raises
    ------
    RingLogError
        It is ambiguous.
    """
    ranges = table.ranges
    sensors = ranges.shape[1]
    if len(ranges) < ROWS_MIN or np.median((~np.isnan(ranges)).sum(axis=1)) <= set_size < sensors:
        return 1.0
    detector = RepeatDetector(sensors)
    for row in ranges:
        detector.add(row)
    if detector.period > 1:
        return float(detector.period)
    changed, great = _changes(ranges)
    begins = great[:-2]
    count = begins.sum(axis=0)
    runs = int((begins & changed[1:-1] & changed[2:]).sum())
    expected = float((count * changed.mean(axis=0) ** 2).sum())
    if runs <= GLITCHES * count.sum() and expected - runs > RUNS_NAT:
        return 1.5  # each value stands for one row or two: no sensor changes three times in a row
    known = np.isfinite(ranges[1:]) & np.isfinite(ranges[:-1]) & table.moved[1:, None]
    repeated = float((~changed[known]).mean()) if known.sum() >= ROWS_MIN * sensors else 0.0
    if repeated > REPEATED and set_size < sensors:
        raise RingLogError(
            f"has more ranges in a row than sensors fire at once, and {100 * repeated:.0f} % of them are those of "
            "the row before: say --latched yes if rows repeat the last value of every sensor, no if all are fresh"
        )
    return 1.0


def _changes(ranges: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where values differ from the row before, and where they do by more than a step of the resolution."""
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(ranges, axis=0))
    changed = (ranges[1:] != ranges[:-1]) & ~np.isnan(ranges[1:]) & ~np.isnan(ranges[:-1])
    finite = change[changed & np.isfinite(change)]
    step = float(finite.min()) if len(finite) else 0.0
    return changed, changed & (change > 1.5 * step)
