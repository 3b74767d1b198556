"""What stands for silence in a ring log that does not write it as inf.

A sensor that hears nothing gives one and the same value wherever the robot is and the sensor looks; a surface does
not. So only rows in which the robot moved count, and silence shows as a value far more frequent than any other, or
as a narrow band at the top.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from drivers.messages import Floats
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError

MODE_FACTOR: Final = 8.0
"""How much more frequent than the second commonest range that of silence is: on walls, ranges in tenths of a foot
differ by less than 3 in this."""
MODE_SHARE: Final = 0.05
"""Least share of the ranges that are silence …"""
TOP_SHARE: Final = 0.01
"""… and where nothing else is near or above."""
GLITCHES: Final = 0.03
"""Share of the ranges that may lie above those of silence."""
FEW_GLITCHES: Final = 0.005
"""The same where silence itself may be as rare as `TOP_SHARE`."""
NOISY_SHARE: Final = 0.02
"""A value of silence has noise if those beside it are more than this share of it."""
BAND: Final = 0.12
"""Half width of a noisy band, as a share of its value."""
BAND_CONTRAST: Final = 5.0
"""How many times as dense as below it the ranges in the band are."""
DOUBTFUL: Final = (0.2, 3.0)
"""Half width and contrast of a band that may be silence: the log is refused unless it is said what it is."""
WIDTHS: Final = 4.5
"""Half width within which a band is looked for, in its standard deviations; beyond it are 7 of a million values."""
LEAST_SPREAD: Final = 1e-3 / WIDTHS
"""Least standard deviation of a band, as a share of its value: for what is rounded."""
LEAST_STEPS: Final = 0.02
"""Ranges are rounded to steps of no more than this share of what stands for silence."""
SMOOTH: Final = 0.5
"""Readings of silence differ from one to the next as much as from any other (1); of a wall that is passed, less."""
TAKEN: Final = ", which is taken for silence (inf)"
RANGES_MIN: Final = 100
LEAP: Final = 1.25
"""A leap is a range longer than those before and after it by this factor."""
LEAPS_MIN: Final = 30
"""Fewest leaps by which a band is judged."""
LEAPS_SHARE: Final = 0.55
"""Least share of them that end in the band. Over 13 drives, 69 % or more did where silence was noisy, and 40 % at
most (21 leaps) where silence was left out."""


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
        found = _top(finite) or _spikes(ranges) or _band(finite, GLITCHES, *DOUBTFUL)
        return found or Silence(float(finite.max()), np.inf, is_top=True, option="max")
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
    zeros = int(np.count_nonzero(finite == 0.0))
    if zeros > TOP_SHARE * len(finite):
        _check_zeros(ranges[table.moved], finite)
        return _one_value(0.0, finite)
    return _most_frequent(ranges[table.moved], finite)


def _check_zeros(moved: Floats, finite: Floats) -> None:
    """Raise an error if another value stands for silence more often than 0; parameters as of `_most_frequent`."""
    other = _most_frequent(np.where(moved == 0.0, np.nan, moved), finite[finite > 0.0])
    zeros, silent = (finite == 0.0).mean(), ((finite >= other.low) & (finite <= other.high)).mean()
    if silent > zeros:
        raise RingLogError(
            f"{100 * zeros:.2g} % of the ranges are 0, and {100 * silent:.0f} % are {other.low:.4g} to "
            f"{other.high:.4g} wherever the robot is: say --silence {other.option} --not-fired 0 if 0 is no reading, "
            "or --silence 0 if only that is no echo"
        )


def _most_frequent(moved: Floats, finite: Floats) -> Silence:
    """Return the value that stands for silence by how often it came while the robot moved; `Silence()` if none does.

    `moved`: (rows, sensors), ranges of the rows in which it moved; `finite`: (n,), all ranges that are numbers.
    """
    finite_moved = moved[np.isfinite(moved)]
    if len(finite_moved) < RANGES_MIN:
        return Silence()
    values, counts = np.unique(finite_moved, return_counts=True)
    if values[0] == values[-1]:
        return Silence()
    counts[0] = 0  # what is too near is given as the least range, by many rings
    most = int(counts.argmax())
    second = int(np.delete(counts, most).max(initial=1))
    if counts[most] > max(MODE_FACTOR * second, MODE_SHARE * len(finite_moved)):
        value, band = float(values[most]), _unlike_wall(_top(finite_moved), moved)
        if band is not None and band.low <= value <= band.high:
            inside = np.count_nonzero((finite_moved >= band.low) & (finite_moved <= band.high))
            if inside > (1.0 + NOISY_SHARE) * counts[most]:
                return band
        return _one_value(value, finite)
    found = _unlike_wall(_top(finite_moved), moved) or _spikes(moved)
    wide = None if found else _unlike_wall(_band(finite_moved, GLITCHES, *DOUBTFUL), moved)
    if wide is not None:
        raise RingLogError(
            f"{wide.words.removesuffix(TAKEN)}: say --silence max if that is no echo, or --silence inf if they are "
            "ranges"
        )
    return found or Silence()


def check_near(ranges: Floats, unit_m: float, range_min_m: float, silence: str) -> None:
    """Raise an error if half of the sensors have one and the same value that is too short for the ring.

    Parameters
    ----------
    ranges : (n, sensors) float
        In the file's unit, without silence.
    unit_m : float
        That unit, m.
    range_min_m : float
        Shortest range of the ring, m.
    silence : str
        The option that says what silence is known.

    Raises
    ------
    RingLogError
        They have: it may be silence, or mean that something is too near.
    """
    finite = np.isfinite(ranges)
    near = ranges[finite & (unit_m * ranges < 0.9 * range_min_m)]
    if len(near) <= TOP_SHARE * finite.sum():
        return
    values, counts = np.unique(near, return_counts=True)
    value, count = float(values[counts.argmax()]), int(counts.max())
    if count > 0.9 * len(near) and (ranges == value).any(axis=0).mean() >= 0.5:
        raise RingLogError(
            f"{100 * count / finite.sum():.0f} % of the ranges are exactly {value:g}, and the ring's shortest is "
            f"{range_min_m:g} m: say --silence {value:.10g} if that is no echo, {silence} if it is something too near"
        )


def _nan_is_silence(ranges: Floats, set_size: int) -> bool:
    """Return whether nan is a sensor that fired, because one that did not is an empty cell or would have to be."""
    if np.isposinf(ranges).any():
        return False
    sensors = ranges.shape[1]
    numbers = np.isfinite(ranges).sum(axis=1)
    return bool(np.isnan(ranges).any() or set_size >= sensors or numbers.max(initial=0) > set_size)


def _one_value(value: float, finite: Floats) -> Silence:
    """Return the silence of ranges that are all exactly `value`; `finite`: all ranges that are numbers, (n,)."""
    share = np.count_nonzero(finite == value) / len(finite)
    is_top = value > 0.0 and float(np.count_nonzero(finite > value)) < GLITCHES * len(finite)
    # Ranges above a greatest value are glitches: they stay what they are.
    return Silence(
        value,
        value,
        is_top=is_top,
        option=f"{value:.10g}",
        words=f"{100 * share:.0f} % of the ranges are exactly {value:g}{TAKEN}",
    )


def _top(finite: Floats) -> Silence | None:
    """Return a narrow band at the top of the ranges, if there is one."""
    return _band(finite, FEW_GLITCHES) or _band(finite, GLITCHES)


def _band(finite: Floats, glitches: float, widest: float = BAND, contrast: float = BAND_CONTRAST) -> Silence | None:
    """Return a band of ranges, of which a share is above, as silence, if there is one.

    Parameters
    ----------
    finite : (n,) float
        Ranges.
    glitches : float
        The share.
    widest : float
        Half width of the band at most, as a share of its value.
    contrast : float
        How many times as dense as below it the ranges in it are at least.
    """
    centre = float(np.quantile(finite, max(0.0, 1.0 - max(glitches, 3.0 / len(finite)))))
    for _ in range(5):
        near = finite[np.abs(finite - centre) <= widest * centre]
        centre = float(np.median(near))
    spread = _spread(near)
    width = WIDTHS * spread
    if width > widest * centre:
        return None
    inside = int(np.count_nonzero(np.abs(finite - centre) <= width))
    below = int(np.count_nonzero((finite < centre - width) & (finite >= centre - 5.0 * width)))
    least = contrast * (1 + below / 2.0)
    if inside < max(least, TOP_SHARE * len(finite), 10):
        return None
    return _noisy_silence(finite, centre, spread, inside)


def _unlike_wall(band: Silence | None, moved: Floats) -> Silence | None:
    """Return a band, but None if each sensor's readings in it change as slowly as those of a wall along the way.

    Equal readings in a row count once: a table may repeat each until the next. `moved`: as of `_most_frequent`.
    """
    if band is None:
        return None
    steps = spread = 0.0
    for column in moved.T:
        inside = column[(column >= band.low) & (column <= band.high)]
        if len(inside):
            changed = inside[np.r_[True, np.diff(inside) != 0.0]]
            steps += float(np.square(np.diff(changed)).sum())
            spread += 2.0 * len(changed) * float(changed.var())
    return None if steps < SMOOTH * spread else band


def _spread(near: Floats) -> float:
    """Return the standard deviation of values about their median, at least half the step between them."""
    centre, steps = float(np.median(near)), np.diff(np.unique(near))
    step = float(steps[steps > LEAST_SPREAD * centre].min(initial=centre))
    least = 0.5 * step if step < LEAST_STEPS * centre else LEAST_SPREAD * centre
    return max(1.4826 * float(np.median(np.abs(near - centre))), least)


def _spikes(ranges: Floats) -> Silence | None:
    """Return the value, or the narrow band at the top, to which ranges leap for single readings, if there is one.

    A sensor that misses an echo leaps to the value of silence and back. Other leaps end at any range.
    """
    up, down = [], []
    for column in ranges.T:
        values = column[np.isfinite(column)]
        one, around = values[1:-1], np.stack([values[:-2], values[2:]])[:, : max(len(values) - 2, 0)]
        up.append(one[one > LEAP * around.max(axis=0)])
        down.append(one[LEAP * one < around.min(axis=0)])
    leaps = np.sort(np.concatenate(up))
    both = np.concatenate([leaps, *down])
    values, counts = np.unique(both, return_counts=True)
    finite = ranges[np.isfinite(ranges)]
    if counts.max(initial=0) >= max(LEAPS_MIN, LEAPS_SHARE * len(both)) and values[counts.argmax()] > finite.min():
        return _one_value(float(values[counts.argmax()]), finite)
    if len(leaps) < LEAPS_MIN:
        return None
    end = np.searchsorted(leaps, leaps * (1.0 + BAND), side="right")
    first = int((end - np.arange(len(leaps))).argmax())
    inside = leaps[first : end[first]]
    centre, spread = float(np.median(inside)), _spread(inside)
    above = np.count_nonzero(leaps > centre + WIDTHS * spread)
    if len(inside) < max(LEAPS_MIN, LEAPS_SHARE * len(leaps)) or above > GLITCHES * ranges.size:
        return None
    return _noisy_silence(finite, centre, spread, int(np.count_nonzero(np.abs(finite - centre) <= WIDTHS * spread)))


def _noisy_silence(finite: Floats, centre: float, spread: float, count: int) -> Silence:
    """Return the silence about a centre: the values that are likelier silence than ranges, in the file's unit.

    Silence is normally distributed; ranges are as dense there as they are beside it. On each side it ends where its
    density has fallen to theirs, at σ √(2 ln(greatest density / density beside)), `WIDTHS` σ at most.

    Parameters
    ----------
    finite : (n,) float
        Ranges.
    centre, spread : float
        Mean and standard deviation of silence; that is above 0.
    count : int
        Values within `WIDTHS` standard deviations.
    """
    width = WIDTHS * spread
    ends = []
    for side in (-1.0, 1.0):
        away = side * (finite - centre)
        beside = np.count_nonzero((away > width) & (away <= 5.0 * width))
        ratio = count / (math.sqrt(2.0 * math.pi) * spread) * 4.0 * width / max(int(beside), 1)
        ends.append(centre + side * spread * min(WIDTHS, math.sqrt(2.0 * math.log(max(ratio, 1.0)))))
    low, high = ends
    share = np.count_nonzero((finite >= low) & (finite <= high)) / len(finite)
    words = f"{100 * share:.0f} % of the ranges are {centre:.4g} ± {spread:.1g} wherever the robot is"
    return Silence(low, high, is_top=True, words=f"{words}{TAKEN}", option="max")
