"""The noise of the ranges, estimated from the echoes of known walls.

A wall is straight, so the errors of its echoes are noise. Recognition estimates the noise too, from consecutive
readings of one sensor and from the residuals of its objects; where firings are far apart it has neither, and walls
are all there is. Its estimate counts as a few echoes.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.memory.parameters import RANGE_VARIANCE_MIN_M2, READINGS_MEMORY
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.bayes.memory.wall_records import MAX_WALLS, WALL_BINS, Wall, WallMap
from perception.bayes.walls.contact import line_variance, range_sigma
from perception.kernel import kernel

PRIOR_ECHOES: Final = 6.0
"""The estimate of recognition counts as so many echoes at each of `PRIOR_RANGES_M`."""
PRIOR_RANGES_M: Final = (0.5, 1.5, 3.0)
"""Ranges at which the estimate of recognition is taken for known."""
SURE_SHARE: Final = 0.1
"""Greatest variance of a wall's line, as a share of the range's, at which an error of the range is noise."""
CHANGE_MIN: Final = 0.1
"""Least change of a variance that is applied."""


@kernel
def add_residual(room: WallMap, wall: Wall, error: float, along: float, range_m: float) -> None:
    """Count the error of an echo of a wall, if the wall is sure.

    Parameters
    ----------
    room, wall
        The sums, updated, and the wall.
    error, along, range_m : float
        Range less predicted, position along the wall, and the predicted range, m.
    """
    variance = range_sigma(room, range_m) ** 2
    if line_variance(wall, along) > SURE_SHARE * variance:
        return
    w = 1.0 / variance**2
    r2 = range_m * range_m
    sums = room.noise_sums
    for k in range(len(sums)):
        sums[k] *= READINGS_MEMORY
    sums[0] += w
    sums[1] += w * r2
    sums[2] += w * r2 * r2
    sums[3] += w * error * error
    sums[4] += w * r2 * error * error


@kernel
def estimate_noise(s: StateRecord, p: SettingsRecord) -> None:
    """Fit the variance a + b · r² to the squared errors by least squares; weigh all bins anew if it changed."""
    room = s[0].room
    variance_m2, relative = noise_variance(s, p)
    if room.firings == 0:
        room.variance_m2 = variance_m2
        room.relative_variance = relative
    s0, s1, s2, t0, t1 = room.noise_sums
    for r in PRIOR_RANGES_M:
        expected = variance_m2 + relative * r * r
        w = PRIOR_ECHOES / expected**2
        s0 += w
        s1 += w * r * r
        s2 += w * r**4
        t0 += w * expected
        t1 += w * r * r * expected
    det = s0 * s2 - s1 * s1
    least = p[0].half_resolution_m ** 2 / 3.0 + RANGE_VARIANCE_MIN_M2
    a = (s2 * t0 - s1 * t1) / det
    b = max((s0 * t1 - s1 * t0) / det, 0.0)
    if a < least:
        a = least
        b = max((t1 - a * s1) / s2, 0.0)
    elif b == 0.0:
        a = max(t0 / s0, least)
    for r in PRIOR_RANGES_M:
        now = room.variance_m2 + room.relative_variance * r * r
        if abs(a + b * r * r - now) > CHANGE_MIN * now:
            change_noise(room, a, b)
            return


@kernel
def change_noise(room: WallMap, variance_m2: float, relative_variance: float) -> None:
    """Set the noise assumed, and weigh the echoes in all bins, and their errors, by it.

    Parameters
    ----------
    room : WallMap
        Updated.
    variance_m2, relative_variance : float
        Of a range r: `variance_m2` + `relative_variance` · r².
    """
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        for b in range(WALL_BINS):
            of = wall.bins[b]
            if wall.weight > 0.0 and of.weight > 0.0:
                r = of.range_sum / of.precision
                share = range_sigma(room, r) ** 2 / (variance_m2 + relative_variance * r * r)
                of.precision *= share
                of.offset_sum *= share
                of.range_sum *= share
    sums = room.noise_sums
    if sums[0] > 0.0:
        # Else errors that were counted while the noise seemed small would outweigh all others.
        r = math.sqrt(sums[1] / sums[0])
        share = range_sigma(room, r) ** 2 / (variance_m2 + relative_variance * r * r)
        for k in range(len(sums)):
            sums[k] *= share**2
    room.variance_m2 = variance_m2
    room.relative_variance = relative_variance
