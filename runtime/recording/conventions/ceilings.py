"""Narrow bands at the top of the ranges: values of silence with noise, which may be cut off at the greatest one."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from drivers.messages import Floats

TOP_SHARE: Final = 0.01
"""Least share of the ranges that are silence where nothing else is near or above."""
GLITCHES: Final = 0.03
"""Share of the ranges that may lie above those of silence."""
FEW_GLITCHES: Final = 0.005
"""The same where silence itself may be as rare as `TOP_SHARE`."""
BAND: Final = 0.12
"""Half width of a noisy band, as a share of its value."""
BAND_CONTRAST: Final = 5.0
"""How many times as dense as below it the ranges in the band are."""
DOUBTFUL: Final = 2.5
"""Contrast of a band that may be silence: the log is refused unless it is said what it is."""
WIDTHS: Final = 4.5
"""Half width within which a band is looked for, in its standard deviations; beyond it are 7 of a million values."""
CORE: Final = 2.5
"""Half width of a band in which its values are counted, in its standard deviations: 99 % of them."""
ABOVE: Final = 3.0
"""Least number of values in a band over those above it, which are glitches."""
LEAST_SPREAD: Final = 1e-3 / WIDTHS
"""Least standard deviation of a band, as a share of its value: for what is rounded."""
LEAST_STEPS: Final = 0.02
"""Ranges are rounded to steps of no more than this share of what stands for silence."""
CUT_SHARE: Final = 0.1
"""Least share of a band whose values are all its greatest one where noise above that is cut off."""
CUT_NAT: Final = 3.0
"""By how much likelier noise that is cut off must be than one exact value. With 20 one of 24 made tables loses 133 of
its 299 silences and nothing is said; with 3 a wall just below an exact value is often taken for its noise."""
ROUNDS: Final = 30
"""Rounds in which a band's mean and standard deviation are fitted: they then change by less than 1 %."""
SMOOTH: Final = 0.5
"""Readings of silence differ from one to the next as much as from any other (1); of a wall that is passed, less."""
LEAP: Final = 1.25
"""A leap is a range longer than those before and after it by this factor."""
AGREE: Final = 0.05
"""Readings agree that differ by less, as a share of the shorter one."""
LONE_MIN: Final = 20
"""Fewest lone readings in a band that say how wide it is: by n of them, its width is off by 1 / √(2 n) of it."""
LEAPS_MIN: Final = 30
"""Fewest leaps by which a band is judged."""
LEAPS_SHARE: Final = 0.55
"""Least share of them that end in the band. Over 13 drives, 69 % or more did where silence was noisy, and 40 % at
most (21 leaps) where silence was left out."""


class Ceiling(NamedTuple):
    """A band of ranges that are all one value but for noise, in the file's unit."""

    low: float
    high: float
    """Between them, a value is likelier of this band than not."""
    centre: float
    spread: float
    """Standard deviation; 0 of one exact value."""

    @staticmethod
    def exactly(value: float) -> Ceiling:
        """Return the band of one value."""
        return Ceiling(value, value, value, 0.0)

    def inside(self, ranges: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Return which ranges are in it."""
        return (ranges >= self.low) & (ranges <= self.high)

    def stands_out(self, finite: Floats, contrast: float) -> bool:
        """Return whether ranges, (n,), are denser in it than below by this factor, and few are above it."""
        width = CORE * self.spread
        inside = int(np.count_nonzero(np.abs(finite - self.centre) <= width))
        below = int(np.count_nonzero((finite < self.centre - width) & (finite >= self.centre - 3.0 * width)))
        return inside >= max(contrast * (1 + below), TOP_SHARE * len(finite), 10, ABOVE * self.above(finite))

    def above(self, finite: Floats) -> int:
        """Return how many ranges, of (n,), are above it."""
        return int(np.count_nonzero(finite > self.centre + WIDTHS * self.spread))


def top_band(finite: Floats) -> Ceiling | None:
    """Return a narrow band at the top of the ranges, (n,), if there is one."""
    return find_band(finite, FEW_GLITCHES) or find_band(finite, GLITCHES)


def find_band(
    finite: Floats, glitches: float, widest: float = BAND, contrast: float = BAND_CONTRAST
) -> Ceiling | None:
    """Return a band of ranges, of which a share is above, if there is one.

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
    centre = float(np.quantile(finite, max(0.0, 1.0 - max(glitches, 3.0 / len(finite))), method="higher"))
    for _ in range(5):
        near = finite[np.abs(finite - centre) <= widest * centre]
        centre = float(np.median(near))
    centre, spread = cut_off(near) or _uncut(near)
    if WIDTHS * spread > widest * centre:
        return None
    found = _ceiling(finite, centre, spread)
    return found if found.stands_out(finite, contrast) else None


def cut_off(near: Floats) -> tuple[float, float] | None:
    """Return mean and standard deviation of noise that is cut off at its greatest value, if the values show such.

    They are compared by their likelihood with one exact value.

    Parameters
    ----------
    near : (n,) float
        Ranges near the greatest one.
    """
    if len(near) < LEAPS_MIN:
        return None
    values, counts = np.unique(near, return_counts=True)
    cut, at_cut = float(values[counts.argmax()]), int(counts.max())
    free = near[near < cut]
    if at_cut < CUT_SHARE * len(near) or len(free) < LEAPS_MIN or at_cut + len(free) < (1.0 - GLITCHES) * len(near):
        return None
    centre, spread, gain = _fitted(free, cut, max(float(np.median(cut - free)), LEAST_SPREAD * cut), cut, at_cut)
    part = at_cut / (at_cut + len(free))
    gain -= at_cut * math.log(part) + len(free) * math.log(1.0 - part)
    return (centre, spread) if gain > CUT_NAT and centre < cut + spread else None


def _uncut(near: Floats) -> tuple[float, float]:
    """Return mean and standard deviation of the noise of values about one, among others, at least of rounding."""
    least = spread_of(near, 0.0)
    centre, spread, _ = _fitted(near, float(np.median(near)), spread_of(near), math.inf, 0)
    return centre, max(spread, least)


def _fitted(free: Floats, centre: float, spread: float, cut: float, at_cut: int) -> tuple[float, float, float]:
    """Return mean, standard deviation and log-likelihood of normal values among others that are as likely anywhere.

    Parameters
    ----------
    free : (n,) float
        Values below `cut`.
    centre, spread : float
        Where the fit begins.
    cut : float
        All normal values above it are it.
    at_cut : int
        How many are.
    """
    root, least = math.sqrt(2.0 * math.pi), LEAST_SPREAD * centre
    share, width, gain = 0.9, max(float(np.ptp(free)), least), -math.inf
    for _ in range(ROUNDS):
        over = min((cut - centre) / spread, 9.0)
        tail = max(0.5 * math.erfc(over / math.sqrt(2.0)), 1e-12)
        pull = math.exp(-0.5 * over**2) / root / tail
        mean_cut, var_cut = centre + spread * pull, spread**2 * (1.0 + over * pull - pull**2)
        own = share / (root * spread) * np.exp(-0.5 * np.square((free - centre) / spread))
        density = own + (1.0 - share) / width
        weight = own / density
        gain = at_cut * math.log(share * tail) + float(np.log(density * width).sum())
        total = float(weight.sum()) + at_cut
        centre = (float(weight @ free) + at_cut * mean_cut) / total
        off = float(weight @ np.square(free - centre)) + at_cut * (var_cut + (mean_cut - centre) ** 2)
        spread, share = max(math.sqrt(off / total), least), min(total / (len(free) + at_cut), 1.0 - 1e-6)
    return centre, spread, gain


def noisy_about(value: float, finite: Floats) -> Ceiling | None:
    """Return the band of noise that is cut off at a value, if ranges, (n,), show such."""
    noisy = cut_off(finite[np.abs(finite - value) <= BAND * value])
    return _ceiling(finite, *noisy) if noisy else None


def unlike_wall(band: Ceiling | None, moved: Floats) -> Ceiling | None:
    """Return a band, but None if each sensor's readings in it change as slowly as those of a wall along the way.

    `moved`: (rows, sensors), ranges of the rows in which the robot moved.
    """
    if band is None:
        return None
    steps = spread = 0.0
    for column in moved.T:
        inside = column[band.inside(column)]
        if len(inside):
            changed = _without_repeats(inside)
            steps += float(np.square(np.diff(changed)).sum())
            spread += 2.0 * len(changed) * float(changed.var())
    return None if steps < SMOOTH * spread else band


def _without_repeats(values: Floats) -> Floats:
    """Return the values, (n,) with n > 0, that differ from the one before: a table may repeat each until the next."""
    return values[np.r_[True, np.diff(values) != 0.0]]


def spread_of(near: Floats, scale: float = 1.4826) -> float:
    """Return the standard deviation of values about their median, at least half the step between them."""
    centre, steps = float(np.median(near)), np.diff(np.unique(near))
    step = float(steps[steps > LEAST_SPREAD * centre].min(initial=centre))
    least = 0.5 * step if step < LEAST_STEPS * centre else LEAST_SPREAD * centre
    return max(scale * float(np.median(np.abs(near - centre))), least)


def find_spikes(ranges: Floats) -> Ceiling | None:
    """Return the value to which ranges leap for single readings, if there is one.

    A sensor that misses an echo leaps to the value of silence and back. Other leaps end at any range.
    """
    both = []
    for column in ranges.T:
        values = column[np.isfinite(column)]
        one, around = values[1:-1], np.stack([values[:-2], values[2:]])[:, : max(len(values) - 2, 0)]
        both += [one[one > LEAP * around.max(axis=0)], one[LEAP * one < around.min(axis=0)]]
    leaps = np.concatenate(both)
    values, counts = np.unique(leaps, return_counts=True)
    least = max(LEAPS_MIN, LEAPS_SHARE * len(leaps))
    if counts.max(initial=0) < least or values[counts.argmax()] <= ranges[np.isfinite(ranges)].min():
        return None
    value = float(values[counts.argmax()])
    return noisy_about(value, leaps) or Ceiling.exactly(value)


def lone_readings(ranges: Floats) -> Floats:
    """Return the readings that agree with neither of their neighbours, of all sensors, (n,).

    Two readings of a surface in succession agree, and those of silence only by chance.

    Parameters
    ----------
    ranges : (rows, sensors) float
        Of rows in which the robot moved.
    """
    lone = []
    for column in ranges.T:
        values = column[np.isfinite(column)]
        if len(values):
            values = _without_repeats(values)
            differs = np.abs(np.diff(values)) > AGREE * np.minimum(values[1:], values[:-1])
            lone.append(values[np.r_[True, differs] & np.r_[differs, True]])
    return np.concatenate(lone)


def lone_bands(lone: Floats, finite: Floats) -> tuple[Ceiling | None, Ceiling | None]:
    """Return a band at the top of lone readings that shows among all, too, and one that is only denser than below it.

    Parameters
    ----------
    lone : (k,) float
        Of `lone_readings`.
    finite : (n,) float
        All ranges.
    """
    if len(lone) < LEAPS_MIN:
        return None, None
    sure, doubtful = None, find_band(lone, GLITCHES, BAND, DOUBTFUL)
    if doubtful is not None and doubtful.stands_out(lone, BAND_CONTRAST):
        found = _ceiling(finite, doubtful.centre, doubtful.spread)
        is_shown = np.count_nonzero(doubtful.inside(lone)) >= LONE_MIN and found.stands_out(finite, DOUBTFUL)
        sure = found if is_shown else None
    top = float(np.quantile(lone, 1.0 - FEW_GLITCHES, method="lower"))
    inside = lone[(lone > (1.0 - BAND) * top) & (lone <= top)]
    below = np.count_nonzero((lone > (1.0 - 2.0 * BAND) * top) & (lone <= (1.0 - BAND) * top))
    if len(inside) >= max(LONE_MIN, DOUBTFUL * below):
        doubtful = Ceiling(float(inside.min()), float(inside.max()), float(np.median(inside)), float(inside.std()))
    few = FEW_GLITCHES * len(finite)
    sure, doubtful = (one if one is not None and one.above(finite) <= few else None for one in (sure, doubtful))
    return sure, doubtful


def _ceiling(finite: Floats, centre: float, spread: float) -> Ceiling:
    """Return the values that are likelier silence than ranges.

    Silence is normally distributed; ranges are as dense there as they are beside it. On each side it ends where its
    density has fallen to theirs, at σ √(2 ln(greatest density / density beside)), `WIDTHS` σ at most.

    Parameters
    ----------
    finite : (n,) float
        Ranges.
    centre, spread : float
        Mean and standard deviation of silence; that is above 0.
    """
    width = WIDTHS * spread
    count = int(np.count_nonzero(np.abs(finite - centre) <= width))
    ends = []
    for side in (-1.0, 1.0):
        away = side * (finite - centre)
        beside = int(np.count_nonzero((away > width) & (away <= 2.0 * width)))
        ratio = count / (math.sqrt(2.0 * math.pi) * spread) * width / beside if beside else math.inf
        ends.append(centre + side * spread * min(WIDTHS, math.sqrt(2.0 * math.log(max(ratio, 1.0)))))
    return Ceiling(ends[0], ends[1], centre, spread)
