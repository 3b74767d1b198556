"""Tests for crosstalk: readings that are short with one set of partners and not with others."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats, kernel
from perception.records import Records
from perception.sensor_faults.memory import RingMemory, SensorMemory

REGULARITY_GAIN: Final = 0.05
"""Weight of the newest firing in the regularity of the firing pattern."""
SHORT_M: Final = 0.15
"""Crosstalk: a reading is short if it is below those before and after it by this, m, and by `SHORT_SHARE` of them."""
SHORT_SHARE: Final = 0.05
"""Share of the other readings in `SHORT_M`."""
DOUBT_M: Final = 0.06
"""A single reading is doubted if it is below the last one of another set by this, m: two quantisation steps."""
DOUBT_SHARE: Final = 0.02
"""It must also be below by this share, for noise. A wrong doubt costs a firing, a wrong mask a sensor: that one has
wider limits."""
SHORT_READINGS_MAX: Final = 8.0
"""Short readings that are crosstalk; each other reading subtracts two."""


@kernel
def find_set(
    ranges: Floats, sets: NDArray[np.uint8], sensors: Records[SensorMemory], ring: Records[RingMemory]
) -> int:
    """Return the index of the set of sensors that fired; enter a new set, over the oldest where all are in use.

    Parameters
    ----------
    ranges : (n,) float
        Readings of the firing, m: NaN for a sensor that did not fire, inf for one without an echo.
    sets : (sets, n) uint8
        Known sets, one a row: 1 for each sensor of the set. A new set overwrites a row.
    sensors : (n,) records
        What is remembered of each sensor. Crosstalk counts of an overwritten set are cleared.
    ring : (1,) records
        What is remembered of the ring. The number of sets and the regularity are updated.
    """
    seen = ring[0].sets_seen
    k: int
    for k in range(min(seen, sets.shape[0])):
        same = True
        for i in range(ranges.shape[0]):
            if (sets[k, i] == 1) == math.isnan(ranges[i]):
                same = False
                break
        if same:
            ring[0].regularity += REGULARITY_GAIN * (1.0 - ring[0].regularity)
            return k
    ring[0].regularity -= REGULARITY_GAIN * ring[0].regularity
    k = seen % sets.shape[0]
    for i in range(ranges.shape[0]):
        sets[k, i] = 0 if math.isnan(ranges[i]) else 1
        sensors[i].short_readings[k] = 0.0
        sensors[i].is_crossed[k] = 0
    ring[0].sets_seen += 1
    return k


@kernel
def count_short_readings(c: SensorMemory, r: float, fired_set: int) -> None:
    """Compare the last reading with `r` and with the one before it, if those were fired in other sets.

    Borenstein & Koren 1995 (EERUF): a true echo does not depend on which other sensors fired.

    Parameters
    ----------
    c : SensorMemory
        The sensor. Its counts of short readings and its crosstalk flags are updated.
    r : float
        The new reading, m.
    fired_set : int
        The set it was fired in.
    """
    middle = c.last_set
    if c.readings < 2 or middle in (fired_set, c.before_last_set):
        return
    if c.last_m < min(r, c.before_last_m) * (1.0 - SHORT_SHARE) - SHORT_M:
        c.short_readings[middle] = min(c.short_readings[middle] + 1.0, 2.0 * SHORT_READINGS_MAX)
    else:
        c.short_readings[middle] = max(c.short_readings[middle] - 2.0, 0.0)
    if c.short_readings[middle] >= SHORT_READINGS_MAX:
        c.is_crossed[middle] = 1
    elif c.short_readings[middle] == 0.0:
        c.is_crossed[middle] = 0


@kernel
def is_doubtful(c: SensorMemory, r: float, x: float, y: float, fired_set: int) -> bool:
    """Return whether a reading is shorter than the last one in another set by more than the base has moved since.

    Parameters
    ----------
    c : SensorMemory
        The sensor, before the reading is entered.
    r : float
        The new reading, m.
    x, y : float
        Place of the ring now, in the odometry's frame, m.
    fired_set : int
        Index of the set that the reading was fired in.
    """
    if c.readings < 1 or c.last_set == fired_set:
        return False
    moved = math.hypot(x - c.last_x, y - c.last_y)
    return bool(r < c.last_m * (1.0 - DOUBT_SHARE) - DOUBT_M - moved)
