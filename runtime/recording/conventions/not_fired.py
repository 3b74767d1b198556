"""What stands for a sensor that did not fire, in a ring log that writes something else than an empty cell.

Sensors that fire in turn are read at most once in a cycle. So the readings of one sensor are never in two rows that
follow each other, while what stands between them is always the same value. Ranges, silence and repeats of
last values last for longer than a row.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from drivers.messages import Floats

FOLLOWED: Final = 0.98
"""Share of the readings that the value follows in the next row: rows may be at uneven times."""
EXPECTED: Final = 30.0
"""Least number of pairs of readings in neighbouring rows that would be expected if they were independent."""


def find_not_fired(ranges: Floats, wanted: str, set_size: int) -> float | None:
    """Return the value that stands for a sensor that did not fire besides an empty cell, or None.

    Parameters
    ----------
    ranges : (n, sensors) float
        As the file has them: NaN for an empty cell, −inf for the text nan.
    wanted : str
        The option: auto, empty, nan, inf or a number.
    set_size : int
        Most sensors of the robot that fire at once.
    """
    if wanted == "nan":
        return -np.inf
    if wanted not in {"auto", "empty"}:
        return float(wanted)
    if wanted == "empty" or set_size >= ranges.shape[1]:
        return None
    values, counts = np.unique(ranges[~np.isnan(ranges)], return_counts=True)
    if len(values) < 2:
        return None
    value = float(values[counts.argmax()])
    is_read = (ranges != value) & ~np.isnan(ranges)
    expected = float(len(ranges) * (is_read.mean(axis=0) ** 2).sum())
    followed = int((is_read[:-1] & (ranges[1:] == value)).sum())
    return value if expected > EXPECTED and followed > FOLLOWED * is_read[:-1].sum() else None


def without_not_fired(ranges: Floats, value: float | None) -> Floats:
    """Return ranges with NaN where they are the value of `find_not_fired`."""
    return ranges if value is None else np.where(ranges == value, np.nan, ranges)


def option_of(value: float) -> str:
    """Return the option that says what `find_not_fired` returned."""
    return f"--not-fired {'nan' if value == -np.inf else f'{value:.10g}'}"
