"""Walls: lines that are corrected by echoes and weakened by ranges that pass through them.

Long walls cause false round objects: each part of one, seen alone, might be a large drum's side. So walls are
recognised as early as possible and take their echoes. A short line takes none: every drum has a tangent, and drums
were found metres late when tangents could explain echoes first.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.elements import MAX_LINES
from perception.bayes.noise_estimation import SIGMAS, noise_variance
from perception.bayes.parameters import SettingsRecord
from perception.bayes.range_fit import FAR
from perception.bayes.scratch import ON_LINE, UNEXPLAINED, LineFit, LineScore
from perception.bayes.state import Line, StateRecord
from perception.kernel import kernel

SAME_COS: Final = 0.98
SAME_M: Final = 0.4 * FOOT_M
JOIN_M: Final = 1.0 * FOOT_M
"""A new line this parallel, this near and this little beyond the end of a known one is that one."""
ANGLE_VARIANCE: Final = 0.02
DISTANCE_VARIANCE_M2: Final = 0.01 * FOOT_M * FOOT_M
"""Variance of a new line: rad², m²."""
ANGLE_DRIFT: Final = 1e-8
DISTANCE_DRIFT_M2: Final = 1e-6 * FOOT_M * FOOT_M
"""Variance that each echo adds, rad² and m², so that the line keeps following."""
FRONT_COS: Final = 0.8
"""Least cosine between a sensor's axis and a line's normal at which it observes the line."""
SLACK_M: Final = 0.02 * FOOT_M
"""Error of an explained range allowed beyond the noise."""
GROW_M: Final = 0.5 * FOOT_M
"""A line grows by echoes this far beyond its ends."""
WITHIN_M: Final = 0.2 * FOOT_M
"""Silence counts this far inside its ends."""
CORNER_SLACK_M: Final = 0.05 * FOOT_M
CORNER_GROW_M: Final = 0.7 * FOOT_M
"""The same for echoes from where a cone's edge meets it."""
CORNER_COS: Final = 0.1
"""A line grows by such echoes up to this cosine beyond the beam's edge."""
ECHOES_MIN: Final = 10.0
WALL_MIN_M: Final = 2.0 * FOOT_M
"""A line that explained more echoes than this and is longer than this is called a wall."""
START_LOG_ODDS: Final = 3.0
"""Log odds of a new line, …"""
LOG_ODDS_MAX: Final = 6.0
"""… of any line, …"""
ECHO_LOG_ODDS: Final = 0.5
"""… and what an echo adds to them."""


@kernel
def off_and_along(line: Line, x: float, y: float) -> tuple[float, float]:
    """Return a point's distance before a line, and the position of its foot along the line, m.

    Parameters
    ----------
    line : Line
        The line.
    x, y : float
        The point, m.
    """
    dx = x - line.origin_x
    dy = y - line.origin_y
    return line.distance - line.normal_x * dx - line.normal_y * dy, -line.normal_y * dx + line.normal_x * dy


@kernel
def reaches(line: Line, along: float, beyond: float) -> bool:
    """Return whether a position along a line lies between its ends, or at most `beyond` outside them.

    Parameters
    ----------
    line : Line
        The line.
    along : float
        Position along the line, m.
    beyond : float
        Distance allowed beyond either end, m.
    """
    return bool(line.low - beyond < along < line.high + beyond)


@kernel
def is_wall(line: Line) -> bool:
    """Return whether a line is long enough and has enough echoes to be called a wall."""
    return bool(line.echoes > ECHOES_MIN and line.high - line.low > WALL_MIN_M)


@kernel
def add_line(s: StateRecord, fit: LineFit, ox: float, oy: float, score: LineScore) -> None:
    """Add a fitted line about the origin (ox, oy), unless it is known; replace the least credible line if full.

    Parameters
    ----------
    s : (1,) State
        Updated.
    fit, ox, oy
        The line and its origin, m.
    score : LineScore
        Its extent and its hits.
    """
    nx, ny, c = fit.normal_x, fit.normal_y, fit.distance
    best = -1
    worst = 1e9
    for k in range(MAX_LINES):
        line = s[0].lines[k]
        if line.echoes <= 0.0:
            if worst > -1e9:
                best = k
                worst = -1e9
            continue
        if line.normal_x * nx + line.normal_y * ny > SAME_COS:
            off, along = off_and_along(line, ox + c * nx, oy + c * ny)
            if abs(off) < SAME_M and reaches(line, along, JOIN_M):
                return
        if line.log_odds < worst:
            worst = line.log_odds
            best = k
    line = s[0].lines[best]
    line.normal_x = nx
    line.normal_y = ny
    line.distance = c
    line.origin_x = ox
    line.origin_y = oy
    line.variance_angle = ANGLE_VARIANCE
    line.covariance = 0.0
    line.variance_distance = DISTANCE_VARIANCE_M2
    line.low = score.low
    line.high = score.high
    line.log_odds = START_LOG_ODDS
    line.echoes = score.hits


@kernel
def correct_line(line: Line, px: float, py: float, e: float, var: float) -> None:
    """Correct a line by one range, by an extended Kalman filter on its angle and distance.

    Parameters
    ----------
    line : Line
        Updated.
    px, py : float
        The sensor's place about the line's origin, m.
    e, var : float
        Range heard less predicted (m) and its variance (m²).
    """
    lever = line.normal_y * px - line.normal_x * py
    line.variance_angle += ANGLE_DRIFT
    line.variance_distance += DISTANCE_DRIFT_M2
    p00, p01, p11 = line.variance_angle, line.covariance, line.variance_distance
    k0 = p00 * lever + p01
    k1 = p01 * lever + p11
    innovation = lever * k0 + k1 + var
    k0 /= innovation
    k1 /= innovation
    line.distance += k1 * e
    line.variance_angle = p00 - k0 * (lever * p00 + p01)
    line.covariance = p01 - k0 * (lever * p01 + p11)
    line.variance_distance = p11 - k1 * (lever * p01 + p11)
    nx = line.normal_x - k0 * e * line.normal_y
    ny = line.normal_y + k0 * e * line.normal_x
    length = math.hypot(nx, ny)
    line.normal_x = nx / length
    line.normal_y = ny / length


@kernel
def update_lines(s: StateRecord, p: SettingsRecord, m: int) -> None:
    """Associate fired readings with lines, correct the lines, and weaken those that a range goes through.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    m : int
        Readings.
    """
    var0, rel2 = noise_variance(s, p)
    scratch, half_box = s[0].scratch, p[0].half_resolution_m
    for k in range(MAX_LINES):
        line = s[0].lines[k]
        if line.echoes <= 0.0:
            continue
        for i in range(m):
            q = scratch.fired[i]
            dot = line.normal_x * q.axis_x + line.normal_y * q.axis_y
            if dot < FRONT_COS:
                continue
            expected, foot = off_and_along(line, q.x, q.y)
            if expected <= 0.0:
                continue
            r = q.range_m
            var = var0 + rel2 * expected * expected
            tight = half_box + SLACK_M + SIGMAS * math.sqrt(max(var - half_box**2 / 3.0, 0.0))
            associates = line.high - line.low > p[0].associating_line_m
            if dot >= p[0].cos_may_answer:
                e = r - expected
                if abs(e) < tight and reaches(line, foot, GROW_M):
                    if scratch.explained_by[i] == UNEXPLAINED and associates:
                        scratch.explained_by[i] = ON_LINE - k
                    line.low = min(line.low, foot)
                    line.high = max(line.high, foot)
                    line.log_odds = min(line.log_odds + ECHO_LOG_ODDS, LOG_ODDS_MAX)
                    line.echoes += 1.0
                    correct_line(line, q.x - line.origin_x, q.y - line.origin_y, e, var)
                elif e > p[0].gate_m and dot >= p[0].cos_must_answer and reaches(line, foot, -WITHIN_M):
                    line.log_odds -= 1.0
                    if line.log_odds < 0.0:
                        line.echoes = 0.0
                        break
            elif r < FAR:
                # A cone's nearest point of a slanting wall lies on the beam's edge.
                off = math.acos(min(1.0, dot)) - p[0].half_angle_rad
                side = 1.0 if line.normal_x * q.axis_y - line.normal_y * q.axis_x < 0.0 else -1.0
                at = foot - expected * math.tan(off) * side
                near = abs(r - expected / math.cos(off)) < tight + CORNER_SLACK_M
                if near and reaches(line, at, CORNER_GROW_M):
                    if scratch.explained_by[i] == UNEXPLAINED and associates:
                        scratch.explained_by[i] = ON_LINE - k
                    if dot >= p[0].cos_half_angle - CORNER_COS:
                        line.low = min(line.low, at)
                        line.high = max(line.high, at)
