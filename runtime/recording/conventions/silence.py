"""What stands for silence in a ring log that does not write it as inf.

A sensor that hears nothing gives one and the same value wherever the robot is and the sensor looks; a surface does
not. So only rows in which the robot moved count, and silence shows as a value far more frequent than any other, or
as a narrow band at the top.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Floats
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError

MODE_FACTOR: Final = 8.0
"""How much more frequent than the second commonest range that of silence is: on walls, ranges in tenths of a foot
differ by less than 3 in this."""
MODE_SHARE: Final = 0.05
TOP_SHARE: Final = 0.01
"""Share of the ranges that are silence; the second where nothing else is near or above."""
GLITCHES: Final = 0.005
"""Share of the ranges that may lie above those of silence."""
BAND: Final = 0.04
"""Half width of a noisy band, as a share of its value."""
BAND_CONTRAST: Final = 5.0
"""How many times as dense as below it the ranges in the band are."""
RANGES_MIN: Final = 100


@dataclass(frozen=True)
class Silence:
    """Which values, in the file's own unit, stand for silence besides inf.

    Attributes
    ----------
    low, high : float
        A range in this closed interval is silence; none if low > high.
    nan_is_silence : bool
        Whether the text nan is; otherwise the sensor did not fire.
    is_top : bool
        Whether it is the most that the ring reports, or above.
    words : str
        What was found, for messages; empty if there is nothing to say.
    option : str
        That sets it.
    """

    low: float = np.inf
    high: float = -np.inf
    nan_is_silence: bool = False
    is_top: bool = False
    words: str = ""
    option: str = "inf"

    def applied(self, ranges: Floats) -> Floats:
        """Return ranges with inf for silence, and NaN for what did not fire; negative ones remain."""
        silent = (ranges >= self.low) & (ranges <= self.high)
        found = np.where(silent, np.inf, ranges)
        found[np.isneginf(ranges)] = np.inf if self.nan_is_silence else np.nan
        return found


def find_silence(table: Table, wanted: str, set_size: int) -> Silence:
    """Return what stands for silence.

    Parameters
    ----------
    table : Table
        As the file has it.
    wanted : str
        The option: auto, inf, nan, max or a number.
    set_size : int
        Most sensors of the robot that fire at once.

    Raises
    ------
    RingLogError
        It is ambiguous.
    """
    ranges = table.ranges
    is_nan, finite = np.isneginf(ranges), ranges[np.isfinite(ranges)]
    if wanted not in {"auto", "nan", "max", "inf"}:
        number = float(wanted)
        above = int(np.count_nonzero(finite > number))
        return Silence(number, number, is_top=number > 0.0 and above <= GLITCHES * len(finite), option=wanted)
    if wanted == "nan":
        return Silence(nan_is_silence=True, option="nan")
    if wanted == "auto" and is_nan.any() and _nan_is_silence(ranges, set_size):
        words = f"{is_nan.sum()} cells are nan, which is taken for silence (inf)"
        return Silence(nan_is_silence=True, words=words, option="nan")
    if wanted == "inf" or len(finite) == 0:
        return Silence()
    if wanted == "max":
        return _top(finite) or Silence(float(finite.max()), np.inf, is_top=True, option="max")
    negative = np.unique(finite[finite < 0.0])
    if len(negative):
        if len(negative) > 1 or np.isposinf(ranges).any():
            raise RingLogError(
                f"ranges are negative, {negative[0]:g} and others; allowed is metres ≥ 0, inf (fired, no echo) or an "
                f"empty cell (did not fire). Say --silence {negative[-1]:g} if negative ones are silence, or empty "
                "these cells"
            )
        return _one_value(float(negative[0]), finite)
    if np.isposinf(ranges).any():
        return Silence()
    moved = ranges[_moved(table.pose)]
    finite_moved = moved[np.isfinite(moved)]
    zeros = int(np.count_nonzero(finite == 0.0))
    if zeros > TOP_SHARE * len(finite):
        return _one_value(0.0, finite)
    if len(finite_moved) < RANGES_MIN:
        return Silence()
    values, counts = np.unique(finite_moved, return_counts=True)
    if values[0] == values[-1]:
        return Silence()
    counts[0] = 0  # what is too near is given as the least range, by many rings
    most = int(counts.argmax())
    second = int(np.delete(counts, most).max(initial=1))
    if counts[most] > max(MODE_FACTOR * second, MODE_SHARE * len(finite_moved)):
        return _one_value(float(values[most]), finite)
    return _top(finite_moved) or Silence()


def _nan_is_silence(ranges: Floats, set_size: int) -> bool:
    """Return whether nan is a sensor that fired, because one that did not is an empty cell or would have to be."""
    if np.isposinf(ranges).any():
        return False
    sensors = ranges.shape[1]
    numbers = np.isfinite(ranges).sum(axis=1)
    return bool(np.isnan(ranges).any() or set_size >= sensors or numbers.max(initial=0) > set_size)


def _one_value(value: float, finite: Floats) -> Silence:
    share = np.count_nonzero(finite == value) / len(finite)
    is_top = value > 0.0 and float(np.count_nonzero(finite > value)) < GLITCHES * len(finite)
    # Ranges above a greatest value are glitches: they stay what they are.
    return Silence(
        value, value, is_top=is_top, option=f"{value:.10g}",
        words=f"{100 * share:.0f} % of the ranges are exactly {value:g}, which is taken for silence (inf)",
    )  # fmt: skip


def _moved(pose: Floats) -> NDArray[np.bool_]:
    """Return the rows at another pose than the row before."""
    moved = np.ones(len(pose), dtype=np.bool_)
    moved[1:] = (np.diff(pose, axis=0) != 0.0).any(axis=1)
    return moved


def _top(finite: Floats) -> Silence | None:
    """Return a narrow band at the top of the ranges, if there is one."""
    centre = float(np.quantile(finite, 1.0 - max(GLITCHES, 3.0 / len(finite))))
    for _ in range(5):
        near = finite[np.abs(finite - centre) <= BAND * centre]
        centre = float(np.median(near))
    width = max(4.0 * 1.4826 * float(np.median(np.abs(near - centre))), 1e-3 * centre)
    if width > BAND * centre:
        return None
    inside = int(np.count_nonzero(np.abs(finite - centre) <= width))
    below = int(np.count_nonzero((finite < centre - width) & (finite >= centre - 5.0 * width)))
    least = BAND_CONTRAST * (1 + below / 2.0)
    if inside < max(least, TOP_SHARE * len(finite), 10):
        return None
    low, high = centre - width, centre + width
    return Silence(
        low, high, is_top=True, option="max",
        words=f"{100 * inside / len(finite):.0f} % of the ranges are {centre:.4g} ± {width:.2g} wherever it is, "
        "which is taken for silence (inf)",
    )  # fmt: skip
