"""What stands for silence in a ring log that does not write it as inf.

A sensor that hears nothing gives one and the same value wherever the robot is and the sensor looks; a surface does
not. So only rows in which the robot moved count, and silence shows as a value far more frequent than any other, or
as a narrow band at the top.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from drivers.messages import Floats
from runtime.recording.conventions.beams import Beams
from runtime.recording.conventions.ceilings import (
    BAND_CONTRAST,
    DOUBTFUL,
    GLITCHES,
    TOP_SHARE,
    Ceiling,
    find_band,
    find_spikes,
    lone_bands,
    lone_readings,
    noisy_about,
    top_band,
    unlike_wall,
)
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError

MODE_FACTOR: Final = 8.0
"""How much more frequent than the second commonest range that of silence is: on walls, ranges in tenths of a foot
differ by less than 3 in this."""
MODE_SHARE: Final = 0.05
"""Least share of the ranges that are silence where others are beside it."""
NOISY_SHARE: Final = 0.02
"""A value of silence has noise if those beside it are more than this share of it."""
WIDE_BAND: Final = 0.2
"""Half width of such a band, as a share of its value."""
BESIDE: Final = 0.03
"""Ranges shorter than the greatest one by less than this share may be its noise."""
TAKEN: Final = ", which is taken for silence (inf)"
RANGES_MIN: Final = 100
EVERYWHERE: Final = 0.3
"""Least share of silence in the readings that no wall along the way explains, over that in all."""
ELSEWHERE_MIN: Final = 5
"""Fewest of them."""


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
    centre : float
        The value without noise.
    words : str
        What was found, for messages; empty if there is nothing to say.
    option : str
        That sets it.
    """

    low: float = np.inf
    high: float = -np.inf
    nan_is_silence: bool = False
    is_top: bool = False
    centre: float = np.nan
    words: str = ""
    option: str = "inf"

    def applied(self, ranges: Floats) -> Floats:
        """Return ranges with inf for silence, and NaN for what did not fire; negative ones remain."""
        silent = (ranges >= self.low) & (ranges <= self.high)
        found = np.where(silent, np.inf, ranges)
        found[np.isneginf(ranges)] = np.inf if self.nan_is_silence else np.nan
        return found


def find_silence(table: Table, wanted: str, set_size: int, beams: Beams) -> Silence:
    """Return what stands for silence.

    Parameters
    ----------
    table : Table
        As the file has it.
    wanted : str
        The option: auto, inf, nan, max or a number.
    set_size : int
        Most sensors of the robot that fire at once.
    beams : Beams
        Where its sensors look, in the rows of the table.

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
        is_top = number > 0.0 and above <= GLITCHES * len(finite)
        return Silence(number, number, is_top=is_top, centre=number, option=wanted)
    if wanted == "nan":
        return Silence(nan_is_silence=True, option="nan")
    if wanted == "auto" and is_nan.any() and _nan_is_silence(ranges, set_size):
        words = f"{is_nan.sum()} cells are nan, which is taken for silence (inf)"
        return Silence(nan_is_silence=True, words=words, option="nan")
    if wanted == "inf" or len(finite) == 0:
        return Silence()
    if wanted == "max":
        found = top_band(finite) or find_spikes(ranges) or find_band(finite, GLITCHES, WIDE_BAND, DOUBTFUL)
        return _silence(found, finite) if found else Silence(float(finite.max()), np.inf, is_top=True, option="max")
    negative = np.unique(finite[finite < 0.0])
    if len(negative):
        if len(negative) > 1 or np.isposinf(ranges).any():
            raise RingLogError(
                f"ranges are negative, {negative[0]:g} and others; allowed is metres ≥ 0, inf (fired, no echo) or an "
                f"empty cell (did not fire). Say --silence {negative[-1]:g} if negative ones are silence, or empty "
                "these cells"
            )
        return _silence(Ceiling.exactly(float(negative[0])), finite)
    if np.isposinf(ranges).any():
        return Silence()
    zeros, moved = int(np.count_nonzero(finite == 0.0)), np.where(table.moved[:, None], ranges, np.nan)
    if zeros > TOP_SHARE * len(finite):
        _check_zeros(moved, finite, beams)
        return _silence(Ceiling.exactly(0.0), finite)
    return _most_frequent(moved, finite, beams)


def _check_zeros(moved: Floats, finite: Floats, beams: Beams) -> None:
    """Raise an error if another value stands for silence more often than 0; parameters as of `_most_frequent`."""
    other = _most_frequent(np.where(moved == 0.0, np.nan, moved), finite[finite > 0.0], beams)
    zeros, silent = (finite == 0.0).mean(), ((finite >= other.low) & (finite <= other.high)).mean()
    if silent > zeros:
        raise RingLogError(
            f"{100 * zeros:.2g} % of the ranges are 0, and {100 * silent:.0f} % are {other.low:.4g} to "
            f"{other.high:.4g} wherever the robot is: say --silence {other.option} --not-fired 0 if 0 is no reading, "
            "or --silence 0 if only that is no echo"
        )


def _most_frequent(moved: Floats, finite: Floats, beams: Beams) -> Silence:
    """Return the value that stands for silence by how often it came while the robot moved; `Silence()` if none does.

    Parameters
    ----------
    moved : (rows, sensors) float
        Ranges of the rows in which it moved, NaN in others.
    finite : (n,) float
        All ranges that are numbers.
    beams : Beams
        Of all rows.
    """
    finite_moved = moved[np.isfinite(moved)]
    if len(finite_moved) < RANGES_MIN or finite_moved.min() == finite_moved.max():
        return Silence()
    foreseen = None
    for found, contrast in _candidates(moved, finite_moved, beams):
        inside, silence = found.inside(moved), _silence(found, finite)
        at_one_angle = beams.at_one_angle(inside, found.low, found.high)
        foreseen = beams.foreseen(moved) if foreseen is None else foreseen
        rest = inside[np.isfinite(moved) & ~at_one_angle & ~foreseen]
        where = ""
        is_sure = found.spread == 0.0 and beams.is_greatest(found.centre)
        least = max(ELSEWHERE_MIN, EVERYWHERE * len(rest) / len(finite_moved) * inside.sum())
        if not is_sure and rest.sum() < least:
            above = np.count_nonzero(finite_moved > found.high)
            if above > GLITCHES * len(finite_moved) or foreseen[inside].mean() > 0.5:
                continue  # a wall
            where = ", of sensors at one angle to the way"
        if contrast == DOUBTFUL or where:
            raise RingLogError(
                f"{silence.words.removesuffix(TAKEN)}{where}: say --silence {silence.option} if that is no echo, or "
                "--silence inf if they are ranges"
            )
        return silence
    return Silence()


def _candidates(moved: Floats, finite_moved: Floats, beams: Beams) -> Iterator[tuple[Ceiling, float]]:
    """Yield what may stand for silence, and the contrast by which it does: parameters as of `_most_frequent`."""
    lone, doubtful = lone_bands(lone_readings(moved), finite_moved)
    bands = (unlike_wall(top_band(finite_moved), moved), lone)
    top = max(bands, key=lambda one: 0 if one is None else np.count_nonzero(one.inside(finite_moved)))
    values, counts = np.unique(finite_moved, return_counts=True)
    counts[0] = 0  # what is too near is given as the least range, by many rings
    most = int(counts.argmax())
    value = Ceiling.exactly(float(values[most]))
    second = int(np.delete(counts, most).max(initial=1))
    if counts[most] > max(MODE_FACTOR * second, MODE_SHARE * len(finite_moved)):
        noisy = top or noisy_about(value.centre, finite_moved)
        yield noisy if noisy is not None and _has_noise(value.centre, noisy, finite_moved) else value, BAND_CONTRAST
    if top is not None:
        yield top, BAND_CONTRAST
    if (spikes := find_spikes(moved)) is not None:
        yield spikes, BAND_CONTRAST
    last = float(values[-1])
    beside = np.count_nonzero((finite_moved < last) & (finite_moved > (1.0 - BESIDE) * last))
    is_frequent = counts[-1] >= max(ELSEWHERE_MIN, DOUBTFUL * beside) and beams.is_greatest(last)
    if is_frequent and not (top is not None and _has_noise(last, top, finite_moved)):  # the band has been judged
        yield Ceiling.exactly(last), BAND_CONTRAST
    if doubtful is not None:
        yield doubtful, DOUBTFUL
    if (wide := unlike_wall(find_band(finite_moved, GLITCHES, WIDE_BAND, DOUBTFUL), moved)) is not None:
        yield wide, DOUBTFUL


def _has_noise(value: float, band: Ceiling, finite: Floats) -> bool:
    """Return whether a band holds, of ranges (n,), a value and others, too."""
    exact = np.count_nonzero(finite == value)
    is_within = band.low <= value <= band.high
    return is_within and bool(np.count_nonzero(band.inside(finite)) > (1.0 + NOISY_SHARE) * exact)


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


def _silence(band: Ceiling, finite: Floats) -> Silence:
    """Return the silence that a band is, of all ranges that are numbers, (n,)."""
    share = np.count_nonzero(band.inside(finite)) / len(finite)
    if band.spread > 0.0:
        words = f"{100 * share:.0f} % of the ranges are {band.centre:.4g} ± {band.spread:.1g} wherever the robot is"
        return Silence(band.low, band.high, is_top=True, centre=band.centre, words=f"{words}{TAKEN}", option="max")
    value = band.centre
    # Ranges above a greatest value are glitches: they stay what they are.
    return Silence(
        value,
        value,
        is_top=value > 0.0 and float(np.count_nonzero(finite > value)) < GLITCHES * len(finite),
        centre=value,
        option=f"{value:.10g}",
        words=f"{100 * share:.0f} % of the ranges are exactly {value:g}{TAKEN}",
    )
