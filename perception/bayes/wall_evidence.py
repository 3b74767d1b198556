"""Whether a line is a wall: the evidence of its readings against a large round object in its place.

Every drum has a tangent, and its echoes stay near it for a while. A wall's echoes stay on it however far the robot
goes, and come from the foot of the perpendicular, not from the direction of a centre.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.settings_record import SettingsRecord
from perception.bayes.wall_bins import is_covered, mean_error, middle_of
from perception.bayes.wall_contact import wall_normal, wall_point
from perception.bayes.wall_records import Wall
from perception.kernel import kernel

RIVAL_RADIUS_M: Final = 0.7
"""Radius of the round object that a wall must exceed: the largest barrel."""
OUT_OF_BEAM_CHI2: Final = 4.0
"""Evidence of an echo whose beam does not contain the round object's centre."""
FLAT_BINS_MIN: Final = 4
MISFIT_UNKNOWN: Final = 1e9
"""Of fewer bins."""
SYSTEMATIC_M: Final = 0.005
"""Error that the mean of many readings keeps."""
SPAN_CHI2_MIN: Final = -2.0
"""Least evidence of each single span."""
WALL_MIN_M: Final = 0.5
"""Least length of a wall's longest span."""


@kernel
def flatness(wall: Wall, first: int, end: int, p: SettingsRecord) -> tuple[float, float]:
    """Return the evidence for a line against a circle with its own place and turn, and how well the line fits.

    Parameters
    ----------
    wall, p
        The wall and the settings.
    first, end : int
        The spans compared, end excluded.

    Returns
    -------
    (float, float)
        χ² of the circle less χ² of the line, and χ² of the line for each degree of freedom.
    """
    middle = 0.5 * (wall.spans[first].low + wall.spans[end - 1].high)
    nx, ny = wall_normal(wall)
    x, y = wall_point(wall, middle)
    # The rival's centre.
    x += RIVAL_RADIUS_M * nx
    y += RIVAL_RADIUS_M * ny
    n = 0
    outside = 0
    # Weighted sums over the bins: of the position u, the error e and the sagitta g.
    s0 = su = suu = se = sue = see = sg = sug = sgg = seg = 0.0
    for k in range(first, end):
        for b in range(wall.spans[k].first_bin, wall.spans[k].end_bin):
            of = wall.bins[b]
            if not is_covered(of):
                continue
            n += 1
            u = middle_of(b) - middle
            d = of.range_sum / of.precision
            w = 1.0 / (1.0 / of.precision + SYSTEMATIC_M**2)
            e = mean_error(wall, b)
            g = math.sqrt((d + RIVAL_RADIUS_M) ** 2 + u * u) - d - RIVAL_RADIUS_M
            s0 += w
            su += w * u
            suu += w * u * u
            se += w * e
            sue += w * u * e
            see += w * e * e
            sg += w * g
            sug += w * u * g
            sgg += w * g * g
            seg += w * e * g
            q = of.newest
            dx = x - q.x
            dy = y - q.y
            is_foot = nx * q.axis_x + ny * q.axis_y >= p[0].cos_half_angle
            if is_foot and dx * q.axis_x + dy * q.axis_y < p[0].cos_may_answer * math.sqrt(dx * dx + dy * dy):
                outside += 1
    det = s0 * suu - su * su
    if n < FLAT_BINS_MIN or not det > 0.0:
        return 0.0, MISFIT_UNKNOWN
    # Less what a line of its own takes away from each.
    g0 = (suu * sg - su * sug) / det
    g1 = (s0 * sug - su * sg) / det
    bend = sgg - g0 * sg - g1 * sug - 2.0 * (seg - g0 * se - g1 * sue)
    left = see - (se * (suu * se - su * sue) + sue * (s0 * sue - su * se)) / det
    return bend + OUT_OF_BEAM_CHI2 * outside, left / (n - 2)


@kernel
def judge(wall: Wall, p: SettingsRecord) -> None:
    """Write the weights and the evidence of a fitted wall, and of each of its spans.

    Parameters
    ----------
    wall, p
        The wall, updated, and the settings.
    """
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
