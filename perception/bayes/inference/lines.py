"""Walls: lines that are corrected by echoes and weakened by ranges that pass through them.

Long walls cause false round objects: each part of one, seen alone, might be a large drum's side. So walls are
recognised as early as possible and take their echoes. A short line takes none: every drum has a tangent, and drums
were found metres late when tangents could explain echoes first.
"""

from __future__ import annotations

import math

from perception.bayes.inference.cross_path import is_crossed, over_line
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.memory.elements import MAX_LINES, Reading
from perception.bayes.memory.parameters import (
    CIRCLE_WALL_BEHIND,
    CIRCLE_WALL_BEYOND_M,
    LINE_ANGLE_DRIFT_RAD2,
    LINE_ANGLE_VARIANCE_RAD2,
    LINE_DISTANCE_DRIFT_M2,
    LINE_DISTANCE_VARIANCE_M2,
    LINE_ECHO_LOG_ODDS,
    LINE_EDGE_COS,
    LINE_EDGE_GROW_M,
    LINE_EDGE_SLACK_M,
    LINE_FRONT_COS,
    LINE_GROW_M,
    LINE_JOIN_M,
    LINE_LOG_ODDS_MAX,
    LINE_SAME_M,
    LINE_SILENCE_WITHIN_M,
    LINE_SLACK_M,
    LINE_START_LOG_ODDS,
    PARALLEL_COS,
    WALL_ECHOES_MIN,
    WALL_FRONT_RADII,
    WALL_LENGTH_MIN_M,
)
from perception.bayes.memory.scratch import ON_LINE, UNEXPLAINED, LineFit, LineScore
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import Line, StateRecord
from perception.kernel import kernel
from perception.shared_numbers import FAR, OUTLIER_SIGMAS


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
def is_sure_line(line: Line) -> bool:
    """Return whether a line is long enough and has enough echoes to be called a wall."""
    return bool(line.echoes > WALL_ECHOES_MIN and line.high - line.low > WALL_LENGTH_MIN_M)


@kernel
def is_in_wall(s: StateRecord, x: float, y: float, radius: float) -> bool:
    """Return whether a circle's centre lies in a known wall, or just before or behind it.

    Parameters
    ----------
    s, x, y, radius
        Memory, and the circle, m.
    """
    for k in range(MAX_LINES):
        line = s[0].lines[k]
        if is_sure_line(line):
            off, along = off_and_along(line, x, y)
            if (
                reaches(line, along, CIRCLE_WALL_BEYOND_M)
                and CIRCLE_WALL_BEHIND * radius < off < WALL_FRONT_RADII * radius
            ):
                return True
    return False


@kernel
def enter_line(s: StateRecord, fit: LineFit, ox: float, oy: float, score: LineScore) -> None:
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
        if line.normal_x * nx + line.normal_y * ny > PARALLEL_COS:
            off, along = off_and_along(line, ox + c * nx, oy + c * ny)
            if abs(off) < LINE_SAME_M and reaches(line, along, LINE_JOIN_M):
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
    line.variance_angle = LINE_ANGLE_VARIANCE_RAD2
    line.covariance = 0.0
    line.variance_distance = LINE_DISTANCE_VARIANCE_M2
    line.low = score.low
    line.high = score.high
    line.log_odds = LINE_START_LOG_ODDS
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
    line.variance_angle += LINE_ANGLE_DRIFT_RAD2
    line.variance_distance += LINE_DISTANCE_DRIFT_M2
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
def explain(s: StateRecord, i: int, k: int) -> None:
    """Let line `k` explain fired reading `i`, if nothing does yet."""
    explained_by = s[0].scratch.explained_by
    if explained_by[i] == UNEXPLAINED:
        explained_by[i] = ON_LINE - k


@kernel
def at_beam_edge(
    line: Line, q: Reading, p: SettingsRecord, dot: float, foot: float, expected: float
) -> tuple[float, float]:
    """Return the range of a slanting wall, of which a cone's nearest point lies on the beam's edge, and its place.

    Parameters
    ----------
    line, q, p
        The wall's line, the reading and the settings.
    dot : float
        Cosine of the angle between the line's normal and the sensor's axis.
    foot, expected : float
        Place of the sensor's foot along the line, and its distance, m.
    """
    off = math.acos(min(1.0, dot)) - p[0].half_angle_rad
    side = 1.0 if line.normal_x * q.axis_y - line.normal_y * q.axis_x < 0.0 else -1.0
    return expected / math.cos(off), foot - expected * math.tan(off) * side


@kernel
def goes_through(line: Line, q: Reading, p: SettingsRecord, dot: float, foot: float, error: float) -> bool:
    """Return whether a range that is longer by `error` (m) goes through a line; arguments as of `at_beam_edge`."""
    if is_crossed(q) or error <= p[0].gate_m or dot < p[0].cos_must_answer:
        return False
    return reaches(line, foot, -LINE_SILENCE_WITHIN_M)


@kernel
def update_lines(s: StateRecord, p: SettingsRecord, m: int) -> None:
    """Associate fired readings with lines, correct the lines, and weaken those that a range goes through."""
    var0, rel2 = noise_variance(s, p)
    scratch, half_box = s[0].scratch, p[0].half_resolution_m
    for k in range(MAX_LINES):
        line = s[0].lines[k]
        if line.echoes <= 0.0:
            continue
        for i in range(m + scratch.crosses):
            q = scratch.fired[i]
            dot = line.normal_x * q.axis_x + line.normal_y * q.axis_y
            if dot < LINE_FRONT_COS:
                continue
            # A line answers two sensors, but for the length of the way, as one midway between them.
            x, y = q.x + 0.5 * q.listener_x, q.y + 0.5 * q.listener_y
            expected, foot = off_and_along(line, x, y)
            if expected <= 0.0:
                continue
            r = q.range_m
            if is_crossed(q):
                across = line.normal_x * q.listener_x + line.normal_y * q.listener_y
                expected, _, _ = over_line(q, line.normal_x, line.normal_y, expected + 0.5 * across)
            var = var0 + rel2 * expected * expected
            tight = half_box + LINE_SLACK_M + OUTLIER_SIGMAS * math.sqrt(max(var - half_box**2 / 3.0, 0.0))
            associates = line.high - line.low > p[0].associating_line_m
            if dot >= p[0].cos_may_answer:
                e = r - expected
                if abs(e) < tight and reaches(line, foot, LINE_GROW_M):
                    if associates:
                        explain(s, i, k)
                    line.low = min(line.low, foot)
                    line.high = max(line.high, foot)
                    line.log_odds = min(line.log_odds + LINE_ECHO_LOG_ODDS, LINE_LOG_ODDS_MAX)
                    line.echoes += 1.0
                    correct_line(line, x - line.origin_x, y - line.origin_y, e, var)
                elif goes_through(line, q, p, dot, foot, e):
                    line.log_odds -= 1.0
                    if line.log_odds < 0.0:
                        line.echoes = 0.0
                        break
            elif r < FAR and not is_crossed(q):
                answer, at = at_beam_edge(line, q, p, dot, foot, expected)
                if abs(r - answer) < tight + LINE_EDGE_SLACK_M and reaches(line, at, LINE_EDGE_GROW_M):
                    if associates:
                        explain(s, i, k)
                    if dot >= p[0].cos_half_angle - LINE_EDGE_COS:
                        line.low = min(line.low, at)
                        line.high = max(line.high, at)
