"""Whether a line is a wall: the evidence of its readings against a large round object in its place.

Every drum has a tangent, and its echoes stay near it for a while. A wall's echoes stay on it however far the robot
goes, and come from the foot of the perpendicular, not from the direction of a centre.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.parameters import OTHER_FIT_STEPS, SYSTEMATIC_M
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.wall_records import Wall
from perception.bayes.walls.bins import is_covered, mean_error, middle_of
from perception.bayes.walls.contact import wall_normal, wall_point
from perception.kernel import kernel

BARREL_RADIUS_M: Final = 0.7
"""Radius of the largest barrel: a wall must explain its echoes better than such a round object."""
DRUM_RADIUS_M: Final = 0.3
"""Radius of a drum, the other round object that a wall must exceed."""
RIVAL_OFF_M: Final = 0.2
"""Standard deviation of a rival's nearest point across the line, before the echoes."""
RIVAL_ALONG_M: Final = 0.5
"""Standard deviation of a rival's nearest point along the line, from its middle."""
STRAY_CHI2: Final = 16.0
"""χ² of an echo that neither explains: the greatest that one counts."""
EXACT_BELOW_CHI2: Final = 200.0
"""A rival that is so much worse after two steps needs no more of them, and no smaller one need be tried."""
OUT_OF_BEAM_CHI2: Final = 4.0
"""Evidence of an echo whose beam does not contain the round object's centre."""
FLAT_BINS_MIN: Final = 4
"""With fewer bins a curve does not stand out from noise."""
MISFIT_UNKNOWN: Final = 1e9
"""The misfit of fewer bins."""
SURE_SPAN_WEIGHT: Final = 6.0
"""Least weight of a span of a new wall, or of one that a corner proves; its places are sure to be its wall's."""
LINE_MISFIT_MAX: Final = 2.5
"""Greatest χ² of the line of a new wall for each degree of freedom."""
WALL_MISFIT_MAX: Final = 3.0
"""The same of a wall that stays, and of a reported one."""
SPAN_CHI2_MIN: Final = -2.0
"""Least evidence of each single span."""
WALL_MIN_M: Final = 0.5
"""Least length of a wall's longest span."""


@kernel
def line_chi2(wall: Wall, first: int, end: int) -> tuple[float, int]:
    """Return χ² of the best line through some spans of a wall, each bin's bounded, and the number of bins.

    Parameters
    ----------
    wall : Wall
        The wall.
    first, end : int
        The spans, end excluded.
    """
    middle = 0.5 * (wall.spans[first].low + wall.spans[end - 1].high)
    n = 0
    s0 = su = suu = se = sue = 0.0
    for k in range(first, end):
        for b in range(wall.spans[k].first_bin, wall.spans[k].end_bin):
            of = wall.bins[b]
            if is_covered(of):
                n += 1
                u = middle_of(b) - middle
                w = 1.0 / (1.0 / of.precision + SYSTEMATIC_M**2)
                e = mean_error(wall, b)
                s0 += w
                su += w * u
                suu += w * u * u
                se += w * e
                sue += w * u * e
    det = s0 * suu - su * su
    if n < FLAT_BINS_MIN or not det > 0.0:
        return 0.0, 0
    offset = (suu * se - su * sue) / det
    slope = (s0 * sue - su * se) / det
    chi2 = 0.0
    for k in range(first, end):
        for b in range(wall.spans[k].first_bin, wall.spans[k].end_bin):
            of = wall.bins[b]
            if is_covered(of):
                e = mean_error(wall, b) - offset - slope * (middle_of(b) - middle)
                chi2 += min(STRAY_CHI2, e * e / (1.0 / of.precision + SYSTEMATIC_M**2))
    return chi2, n


@kernel
def circle_chi2(wall: Wall, first: int, end: int, radius: float, p: SettingsRecord, limit: float) -> float:
    """Return χ² of the best circle of a radius in the place of some spans of a wall, each echo's bounded.

    The range of each bin is that of a sensor before its middle, at the mean of its echoes' ranges.

    Parameters
    ----------
    wall, p
        The wall and the settings.
    first, end : int
        The spans, end excluded.
    radius : float
        The circle's, m.
    limit : float
        Where χ² exceeds this after two steps, it is returned as it is.
    """
    along = middle = 0.5 * (wall.spans[first].low + wall.spans[end - 1].high)
    behind = radius
    nx, ny = wall_normal(wall)
    chi2 = 0.0
    for step in range(OTHER_FIT_STEPS + 1):
        if step == 3 and chi2 > limit:
            break
        chi2 = 0.0
        h_aa = 1.0 / RIVAL_ALONG_M**2
        h_bb = 1.0 / RIVAL_OFF_M**2
        h_ab = 0.0
        g_a = (middle - along) * h_aa
        g_b = (radius - behind) * h_bb
        x, y = wall_point(wall, along)
        for k in range(first, end):
            for b in range(wall.spans[k].first_bin, wall.spans[k].end_bin):
                of = wall.bins[b]
                if not is_covered(of):
                    continue
                d = of.range_sum / of.precision
                across = d - mean_error(wall, b) + behind
                beside = middle_of(b) - along
                reach = math.sqrt(across * across + beside * beside)
                e = d - reach + radius
                w = 1.0 / (1.0 / of.precision + SYSTEMATIC_M**2)
                if step < OTHER_FIT_STEPS:
                    chi2 += min(STRAY_CHI2, w * e * e)
                if step == OTHER_FIT_STEPS:
                    q = of.newest
                    dx = x + behind * nx - q.x
                    dy = y + behind * ny - q.y
                    is_foot = nx * q.axis_x + ny * q.axis_y >= p[0].cos_half_angle
                    is_outside = dx * q.axis_x + dy * q.axis_y < p[0].cos_may_answer * math.sqrt(dx * dx + dy * dy)
                    chi2 += min(STRAY_CHI2, w * e * e + (OUT_OF_BEAM_CHI2 if is_foot and is_outside else 0.0))
                elif step == 0 or w * e * e < STRAY_CHI2:
                    ja = -beside / reach
                    jb = across / reach
                    h_aa += w * ja * ja
                    h_ab += w * ja * jb
                    h_bb += w * jb * jb
                    g_a += w * ja * e
                    g_b += w * jb * e
        if step < OTHER_FIT_STEPS:
            det = h_aa * h_bb - h_ab * h_ab
            along += (h_bb * g_a - h_ab * g_b) / det
            behind += (h_aa * g_b - h_ab * g_a) / det
    return chi2


@kernel
def flatness(wall: Wall, first: int, end: int, p: SettingsRecord) -> tuple[float, float]:
    """Return the evidence for a line against a circle in the best place, and how well the line fits.

    Parameters
    ----------
    wall, p
        The wall and the settings.
    first, end : int
        The spans compared, end excluded.

    Returns
    -------
    (float, float)
        χ² of the circle less χ² of the line, and χ² of the line for each degree of freedom, each bin's bounded: a few
        echoes of other surfaces do not make a long line crooked.
    """
    line, n = line_chi2(wall, first, end)
    if n < FLAT_BINS_MIN:
        return 0.0, MISFIT_UNKNOWN
    circle = circle_chi2(wall, first, end, BARREL_RADIUS_M, p, line + EXACT_BELOW_CHI2)
    if circle < line + EXACT_BELOW_CHI2:
        circle = min(circle, circle_chi2(wall, first, end, DRUM_RADIUS_M, p, math.inf))
    return circle - line, line / (n - 2)


@kernel
def judge(wall: Wall, p: SettingsRecord) -> None:
    """Write the weights and the evidence of a fitted wall, and of each of its spans."""
    for k in range(wall.span_count):
        span = wall.spans[k]
        span.weight = 0.0
        span.passes = 0.0
        for b in range(span.first_bin, span.end_bin):
            span.weight += wall.bins[b].weight
            span.passes += wall.bins[b].passes
        span.chi2, wall.misfit = flatness(wall, k, k + 1, p)
    wall.chi2 = wall.spans[0].chi2
    if wall.span_count > 1:
        wall.chi2, wall.misfit = flatness(wall, 0, wall.span_count, p)
