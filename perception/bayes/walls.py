"""Walls: lines that follow what they explain, and give way to what goes through them.

A long wall is where false round objects come from: each stretch of it, seen alone, might be a large drum's side. So
walls are known as such as early as possible and claim their echoes. A short line claims nothing: every drum has a
tangent, and drums came to light metres late when tangents were let speak first.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.noise_estimation import SIGMAS, noise_variance
from perception.bayes.range_fit import FAR
from perception.bayes.state import (
    LC,
    LHI,
    LLO,
    LLOG,
    LN,
    LNX,
    LNY,
    LOX,
    LOY,
    LP00,
    LP01,
    LP11,
    NL,
    Settings,
    State,
)  # fmt: skip
from perception.kernel import Floats, kernel

SAME_COS: Final = 0.98
SAME_M: Final = 0.4 * FOOT_M
JOIN_M: Final = 1.0 * FOOT_M
"""A new line this parallel, this near and this little beyond the end of a known one is that one."""
ANGLE_VAR: Final = 0.02
DISTANCE_VAR_M2: Final = 0.01 * FOOT_M * FOOT_M
"""How well a new line is known: rad², m²."""
ANGLE_DRIFT: Final = 1e-8
DISTANCE_DRIFT_M2: Final = 1e-6 * FOOT_M * FOOT_M
"""What each echo adds to that, so that it never stops listening."""
FRONT_COS: Final = 0.8
SLACK_M: Final = 0.02 * FOOT_M
GROW_M: Final = 0.5 * FOOT_M
"""A line grows by echoes this far beyond its ends."""
WITHIN_M: Final = 0.2 * FOOT_M
"""Silence counts this far inside its ends."""
CORNER_SLACK_M: Final = 0.05 * FOOT_M
CORNER_GROW_M: Final = 0.7 * FOOT_M
"""The same for echoes from where a cone's edge meets it."""
CORNER_COS: Final = 0.1
ECHOES_MIN: Final = 10.0
WALL_M: Final = 2.0 * FOOT_M
"""A line that explained more echoes than this and is longer than this is called a wall."""
LOG_ODDS: Final = 3.0
LOG_ODDS_MAX: Final = 6.0
PER_ECHO: Final = 0.5


@kernel
def off_and_along(line: Floats, x: float, y: float) -> tuple[float, float]:
    """Return how far a place lies before a line, a row of `State.lines`, and where along it its foot is, m."""
    dx = x - line[LOX]
    dy = y - line[LOY]
    return line[LC] - line[LNX] * dx - line[LNY] * dy, -line[LNY] * dx + line[LNX] * dy


@kernel
def reaches(line: Floats, along: float, beyond: float) -> bool:
    """Tell whether a foot lies between the ends of a line, or `beyond` them at most (m)."""
    return bool(line[LLO] - beyond < along < line[LHI] + beyond)


@kernel
def is_wall(line: Floats) -> bool:
    """Tell whether a line is long and heard often enough to be called a wall."""
    return bool(line[LN] > ECHOES_MIN and line[LHI] - line[LLO] > WALL_M)


@kernel
def new_line(
    s: State, nx: float, ny: float, c: float, ox: float, oy: float, low: float, high: float, echoes: float
) -> None:
    """Remember a line n·(q − o) = c from `low` to `high`, unless it is known; the least credible makes room."""
    best = -1
    worst = 1e9
    for k in range(NL):
        line = s.lines[k]
        if line[LN] <= 0.0:
            if worst > -1e9:
                best = k
                worst = -1e9
            continue
        if line[LNX] * nx + line[LNY] * ny > SAME_COS:
            off, along = off_and_along(line, ox + c * nx, oy + c * ny)
            if abs(off) < SAME_M and reaches(line, along, JOIN_M):
                return
        if line[LLOG] < worst:
            worst = line[LLOG]
            best = k
    line = s.lines[best]
    line[LNX] = nx
    line[LNY] = ny
    line[LC] = c
    line[LOX] = ox
    line[LOY] = oy
    line[LP00] = ANGLE_VAR
    line[LP01] = 0.0
    line[LP11] = DISTANCE_VAR_M2
    line[LLO] = low
    line[LHI] = high
    line[LLOG] = LOG_ODDS
    line[LN] = echoes


@kernel
def follow(line: Floats, px: float, py: float, e: float, var: float) -> None:
    """Correct a line by one range: an extended Kalman filter on its angle and distance.

    Parameters
    ----------
    line : (12,) float
        Updated.
    px, py : float
        The sensor's place about the line's origin, m.
    e, var : float
        Range heard less predicted (m) and its variance (m²).
    """
    lever = line[LNY] * px - line[LNX] * py
    line[LP00] += ANGLE_DRIFT
    line[LP11] += DISTANCE_DRIFT_M2
    p00, p01, p11 = line[LP00], line[LP01], line[LP11]
    k0 = p00 * lever + p01
    k1 = p01 * lever + p11
    innovation = lever * k0 + k1 + var
    k0 /= innovation
    k1 /= innovation
    line[LC] += k1 * e
    line[LP00] = p00 - k0 * (lever * p00 + p01)
    line[LP01] = p01 - k0 * (lever * p01 + p11)
    line[LP11] = p11 - k1 * (lever * p01 + p11)
    nx = line[LNX] - k0 * e * line[LNY]
    ny = line[LNY] + k0 * e * line[LNX]
    length = math.hypot(nx, ny)
    line[LNX] = nx / length
    line[LNY] = ny / length


@kernel
def update_lines(s: State, p: Settings, m: int) -> None:
    """Let lines claim what they explain of the `m` readings in `s.cur`, follow it, and lose by what goes through."""
    var0, rel2 = noise_variance(s, p)
    for k in range(NL):
        line = s.lines[k]
        if line[LN] <= 0.0:
            continue
        for i in range(m):
            dot = line[LNX] * s.cur[i, 2] + line[LNY] * s.cur[i, 3]
            if dot < FRONT_COS:
                continue
            expected, foot = off_and_along(line, s.cur[i, 0], s.cur[i, 1])
            if expected <= 0.0:
                continue
            r = s.cur[i, 4]
            var = var0 + rel2 * expected * expected
            tight = p.half_box + SLACK_M + SIGMAS * math.sqrt(max(var - p.half_box**2 / 3.0, 0.0))
            claims = line[LHI] - line[LLO] > p.claim
            if dot >= p.cos_opt:
                e = r - expected
                if abs(e) < tight and reaches(line, foot, GROW_M):
                    if s.owner[i] == -1 and claims:
                        s.owner[i] = -2 - k
                    line[LLO] = min(line[LLO], foot)
                    line[LHI] = max(line[LHI], foot)
                    line[LLOG] = min(line[LLOG] + PER_ECHO, LOG_ODDS_MAX)
                    line[LN] += 1.0
                    follow(line, s.cur[i, 0] - line[LOX], s.cur[i, 1] - line[LOY], e, var)
                elif e > p.gate and dot >= p.cos_in and reaches(line, foot, -WITHIN_M):
                    line[LLOG] -= 1.0
                    if line[LLOG] < 0.0:
                        line[LN] = 0.0
                        break
            elif r < FAR:
                # A cone's nearest point of a slanting wall lies on the beam's edge.
                off = math.acos(min(1.0, dot)) - p.half_angle
                side = 1.0 if line[LNX] * s.cur[i, 3] - line[LNY] * s.cur[i, 2] < 0.0 else -1.0
                at = foot - expected * math.tan(off) * side
                near = abs(r - expected / math.cos(off)) < tight + CORNER_SLACK_M
                if near and reaches(line, at, CORNER_GROW_M):
                    if s.owner[i] == -1 and claims:
                        s.owner[i] = -2 - k
                    if dot >= p.cos_half - CORNER_COS:
                        line[LLO] = min(line[LLO], at)
                        line[LHI] = max(line[LHI], at)
