"""How many of the recent readings support a line, and which of them may touch it, computed several at a time.

Each echo that nothing explains tries up to eight lines against hundreds of readings, of which a few bear on each. So
the readings are copied field by field once, and each line is compared with all of them without a branch.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.scratch import NearReadings
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.wall_records import IS_FREE, RecentReading, Wall, WallMap
from perception.bayes.walls.contact import SAME_SIGMAS, SLANTING_MIN_COS, edges_answer
from perception.kernel import kernel, loop_kernel
from perception.shared_numbers import PASSED_M

TOUCH_REACH_M: Final = 3.0
"""Readings that touch a candidate farther away than this do not count."""
SCORE_LEVER: Final = 0.03
"""Further error of a range that supports a candidate, beyond `SAME_SIGMAS`, for each metre along it: its direction is
uncertain by so many metres over the pair's distance."""
SCORE_LEVER_MAX_M: Final = 1.5
"""That error grows no more beyond this distance along the candidate."""
SCORE_EDGE: Final = 0.6
"""Weight of an echo from the beam's edge."""
SCORE_PASS: Final = 0.7
"""Weight of a range that passed through."""
PASS_WITHIN_M: Final = 0.5
"""A range that passed through counts where it touches the candidate this near the echo."""


@kernel
def copy_near(recent: RecentReading, near: NearReadings, n: int) -> None:
    """Copy a recent reading to place `n` of those that are compared with lines."""
    q = recent.reading
    near.x[n] = q.x
    near.y[n] = q.y
    near.axis_x[n] = q.axis_x
    near.axis_y[n] = q.axis_y
    near.range_m[n] = q.range_m
    near.is_free[n] = 1.0 if recent.is_free == IS_FREE else 0.0


@loop_kernel
def weigh(
    near: NearReadings,
    n: int,
    wall: Wall,
    p: SettingsRecord,
    edges: bool,
    variance_m2: float,
    relative: float,
    base: float,
) -> None:
    """Write the weight of each reading for or against a line; see `support`, and `contact.touch` for a line.

    Parameters
    ----------
    near, n, wall, p, base
        As for `support`; the weights are written.
    edges : bool
        Whether slanting walls answer from the beam's edge.
    variance_m2, relative : float
        The noise, as `contact.range_sigma` takes it.
    """
    nx, ny, ox, oy, offset = wall.normal_x, wall.normal_y, wall.origin_x, wall.origin_y, wall.offset
    cosine, sine, must = p[0].cos_half_angle, p[0].sin_half_angle, p[0].cos_must_answer
    for j in range(n):
        x, y, ax, ay = near.x[j], near.y[j], near.axis_x[j], near.axis_y[j]
        dx, dy = x - ox, y - oy
        dot = nx * ax + ny * ay
        distance = offset - (nx * dx + ny * dy)
        is_foot = dot >= cosine
        side = sine if ax * ny - ay * nx > 0.0 else -sine
        ex, ey = ax * cosine - ay * side, ay * cosine + ax * side
        reach = distance / (nx * ex + ny * ey)
        along_edge = nx * (y + reach * ey - oy) - ny * (x + reach * ex - ox)
        expected = distance if is_foot else reach
        away = abs(nx * dy - ny * dx if is_foot else along_edge)
        touches = (dot >= SLANTING_MIN_COS) & (distance > 0.0) & (away <= TOUCH_REACH_M) & (is_foot | edges)
        e = near.range_m[j] - expected
        slack = SAME_SIGMAS * math.sqrt(variance_m2 + relative * expected * expected)
        slack += SCORE_LEVER * min(away, SCORE_LEVER_MAX_M) / base
        is_near = abs(e) < slack
        passed = (e > PASSED_M) & (away < PASS_WITHIN_M) & is_foot & (dot >= must)
        for_it = near.is_free[j] * (1.0 if is_foot else SCORE_EDGE)
        against = SCORE_PASS if passed else 0.0
        weight = for_it if is_near else -against
        near.weight[j] = weight if touches else 0.0


@kernel
def support(room: WallMap, near: NearReadings, n: int, wall: Wall, base: float, p: SettingsRecord) -> float:
    """Return how many recent echoes a line explains, less those that passed through it near its origin.

    Parameters
    ----------
    room : WallMap
        The noise.
    near, n : NearReadings, int
        The recent readings that may bear on the line, and their number.
    wall : Wall
        The line; its slope is 0, its origin the place of an echo's sensor.
    base : float
        Distance of the sensor of the other echo through which it goes, m.
    p : (1,) Settings
        Beam.
    """
    weigh(near, n, wall, p, edges_answer(room), room.variance_m2, room.relative_variance, base)
    score = 1.0
    for j in range(n):
        score += near.weight[j]
    return score
