"""The avoid-past schema (Balch & Arkin, *Avoiding the Past*, ICRA 1993): where the robot has been repels it.

Theirs counts the cycles spent in each cell of a grid, so that its strength depends on the rate of the cycle and on
how long the robot stands. Here a place is marked for each piece of way, and a robot that stands marks none.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np

from behaviors.response import Response
from config.behaviors import AvoidPastConfig
from config.bounded import Coordinate
from perception.percept import Percept

SCHEMA: Final = "avoid_past"

Trail: TypeAlias = tuple[tuple[Coordinate, Coordinate], ...]
"""Places x, y that the robot has passed, m, oldest first."""

MARK_M: Final = 0.1
"""Way between two marks."""
MARKS_MAX: Final = 600
"""The oldest marks are forgotten."""


def avoid_past(percept: Percept, trail: Trail, config: AvoidPastConfig) -> tuple[Response, Trail]:
    """Return the vector away from the marks near the robot, and the trail for the next call.

    Marks within a square about the robot count alike: as many more lie to one side as to the other, so far the vector
    points to the other. Its length grows with the marks in the square up to the gain.

    Parameters
    ----------
    percept
        Only the pose is used.
    trail
        As the last call returned it; empty for a new goal.
    config
        The schema's settings.
    """
    x, y = percept.pose.x, percept.pose.y
    if not trail or math.dist(trail[-1], (x, y)) >= MARK_M:
        trail = (*trail[-MARKS_MAX + 1 :], (x, y))
    away = np.array([[x, y]]) - np.array(trail)
    away = away[(np.abs(away) <= config.horizon_m).all(axis=1)]
    sides = np.sign(away).sum(axis=0)
    length = float(np.hypot(*sides))
    if length == 0.0:
        return Response(SCHEMA, 0.0, 0.0), trail
    magnitude = config.avoid_past_gain * min(1.0, len(away) * MARK_M / config.saturation_m)
    return Response(SCHEMA, magnitude * float(sides[0]) / length, magnitude * float(sides[1]) / length), trail
