"""Whether the rows of a ring log repeat the last value of each sensor until it fires again.

A row with more numbers than sensors fire at once is no single firing: either all sensors fired in the time of a row,
or most numbers are old. Old ones are equal to the bit, or but for noise of one last digit, and a sensor cannot change
more often than it fires.
"""

from __future__ import annotations

from typing import Final, NamedTuple

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
LONGEST_RUN: Final = 24
"""Longest run of changes whose end is looked for: of a source that repeats less than that, hardly a value is old."""
SHORT_RUN: Final = 2
"""Runs of this length at most are decided before: by intervals between changes, and by three changes in a row."""
ROWS_MIN: Final = 30
REPEATED: Final = 0.3
"""Share of repeats, as the robot moves, from which a log that shows nothing else is ambiguous: ranges to the
millimetre repeat hardly ever."""
DITHER: Final = 2.5
"""Least changes of the file by which a repeated value may differ, where noise of one last digit is added to each row:
two digits between two rows, and what is lost by rounding."""


class Repeats(NamedTuple):
    """How long values are repeated."""

    rows: float = 1.0
    """For how many a value stands; 1 if each row is fresh."""
    same: float = 0.0
    """By how much, in the file's unit, a repeated value may differ."""

    @property
    def words(self) -> str:
        """What was found."""
        noise = f", give or take {self.same:.2g} in the file's unit" if self.same else ""
        return (
            f"each value is repeated{noise}, for {self.rows:.3g} rows mostly, until its sensor fires again: only "
            "changes are readings"
        )


def find_repeats(table: Table, set_size: int) -> Repeats:
    """Return for how many rows a value stands.

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
        return Repeats()
    found = _repeats(ranges, table.moved)
    if found.rows > 1.0:
        return found
    changed, _ = _changes(ranges)
    known = np.isfinite(ranges[1:]) & np.isfinite(ranges[:-1]) & table.moved[1:, None]
    repeated = float((~changed[known]).mean()) if known.sum() >= ROWS_MIN * sensors else 0.0
    if repeated > REPEATED and set_size < sensors:
        raise RingLogError(
            f"has more ranges in a row than sensors fire at once, and {100 * repeated:.0f} % of them are those of "
            "the row before: say --latched yes if rows repeat the last value of every sensor, no if all are fresh"
        )
    return Repeats()


def noise_of_repeats(table: Table) -> float:
    """Return by how much repeated values differ, in a log that is known to repeat them; 0 mostly."""
    return _repeats(table.ranges, table.moved).same


def _repeats(ranges: Floats, moved: NDArray[np.bool_]) -> Repeats:
    """Return what the changes show: of values to the bit, or else of values but for their last digit.

    A run of changes that ends where the robot stands shows nothing: little changes there in a fresh log either. Where
    poses come more rarely than rows, more than half of the sensors change in rows that repeat one value in three.
    """
    for same in (0.0, DITHER * _least_change(ranges)):
        held = _without_dither(ranges, same) if same else ranges
        detector = RepeatDetector(ranges.shape[1])
        for row in held:
            detector.add(row)
        if detector.period > 1:
            return Repeats(float(detector.period), same)
        changed, great = _changes(held)
        heard = np.maximum(1, (np.isfinite(held[1:]) & np.isfinite(held[:-1])).sum(axis=1))
        shown = changed | (moved[1:] | (changed.sum(axis=1) > 0.5 * heard))[:, None]
        begins = great[:-2] & shown[1:-1] & shown[2:]
        count = begins.sum(axis=0)
        runs = int((begins & changed[1:-1] & changed[2:]).sum())
        expected = float((count * changed.mean(axis=0) ** 2).sum())
        if runs <= GLITCHES * count.sum() and expected - runs > RUNS_NAT:
            return Repeats(1.5, same)  # each value stands for one row or two: no sensor changes three times in a row
        if longest := _longest_run(held, changed, great, shown):
            return Repeats((longest + 1) / longest, same)
    return Repeats()


def _longest_run(
    ranges: Floats, changed: NDArray[np.bool_], great: NDArray[np.bool_], shown: NDArray[np.bool_]
) -> int:
    """Return how often in a row a sensor changes at most, where that ends all at once; 0 where it does not.

    Rows that come a little faster than the ring's cycle repeat one value in a few, and always after as many changes.
    In a fresh source runs go on from each length with nearly the same chance.

    Parameters
    ----------
    ranges
        Shape (n, sensors).
    changed, great
        As of `_changes`.
    shown
        Where a value that is not changed is one repeated, shape (n − 1, sensors).
    """
    known = np.isfinite(ranges[1:]) & np.isfinite(ranges[:-1]) & shown
    runs = great & known
    follows = runs[:-1] & known[1:]
    goes_on = (follows & changed[1:]).sum(axis=0) / np.maximum(1, follows.sum(axis=0))
    for length in range(1, LONGEST_RUN + 1):
        if len(runs) <= length:
            break
        runs = runs[:-1] & known[length:]
        count = runs.sum(axis=0)  # the runs of each sensor that are as long as this, before a known value
        runs = runs & changed[length:]
        longer = int(runs.sum())
        is_end = longer <= GLITCHES * count.sum() and float((count * goes_on).sum()) - longer > RUNS_NAT
        if is_end and length > SHORT_RUN:
            return length
    return 0


def _least_change(ranges: Floats) -> float:
    """Return the least change from row to row that is none of 0; 0 if nothing changes."""
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(ranges, axis=0))
    change = change[np.isfinite(change) & (change > 0.0)]
    return float(change.min()) if len(change) else 0.0


def _without_dither(ranges: Floats, same: float) -> Floats:
    """Return ranges, (n, sensors), in which values that differ from a sensor's last one by `same` at most are it."""
    held, last = ranges.copy(), np.full(ranges.shape[1], np.nan)
    with np.errstate(invalid="ignore"):
        for row in held:
            near = np.abs(row - last) <= same
            row[near] = last[near]
            last = np.where(np.isnan(row), last, row)
    return held


def _changes(ranges: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where values differ from the row before, and where they do by more than a step of the resolution."""
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(ranges, axis=0))
    changed = (ranges[1:] != ranges[:-1]) & ~np.isnan(ranges[1:]) & ~np.isnan(ranges[:-1])
    finite = change[changed & np.isfinite(change)]
    step = float(finite.min()) if len(finite) else 0.0
    return changed, changed & (change > 1.5 * step)
