"""Tests for crosstalk: readings that are short with one set of partners and not with others."""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import kernel
from perception.sensor_memory import SensorMemory

SHORT_M: Final = 0.15
"""Crosstalk: a reading is short if it is below those before and after it by this, m, …"""
SHORT_SHARE: Final = 0.05
"""… and by this share of them."""
DOUBT_M: Final = 0.06
"""A single reading is doubted if it is below the last one of another set by this, m: two quantisation steps, …"""
DOUBT_SHARE: Final = 0.02
"""… and by this share, for noise. A wrong doubt costs a firing, a wrong mask a sensor: that one has wider limits."""
SHORT_READINGS_MAX: Final = 8.0
"""Short readings that are crosstalk; each other reading subtracts two."""


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
