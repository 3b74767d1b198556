"""Echoes of a circle that walls and corners explain: only the others show that another object stands there.

Before a wall is known, its echoes start round objects at it and behind it. Once it is sure, nothing denies these:
every range towards them ends at the wall. So they are reported only for echoes of their own. An echo belongs to a
wall that answers at its range, and to no object that is hidden by a wall.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.range_fit import FAR
from perception.bayes.settings_record import SettingsRecord
from perception.bayes.state import Memory
from perception.bayes.wall_contact import CORNER_SLACK_M, EXPLAINED_SIGMAS
from perception.bayes.wall_report import has_mirrors
from perception.kernel import Floats

POINT_M: Final = 1e-9
"""Length of a surface that is a point."""


def own_echoes(circle: NDArray[Any], surfaces: Floats, memory: Memory, p: SettingsRecord) -> int:
    """Return how many of the echoes that a circle explains no surface does.

    Parameters
    ----------
    circle : record of `CircleTrack`
        The circle.
    surfaces : (n, 4) float
        The ends x, y, x, y of walls that are sure, m; a corner has both in one place.
    memory, p
        The noise and whether walls are mirrors, and the settings.
    """
    bins, x, y = circle["bins"], float(circle["x"]), float(circle["y"])
    held = bins["readings"][np.arange(bins["readings"].shape[1]) < bins["count"][:, None]]
    ranges, sensors = held["range_m"], np.column_stack([held["x"], held["y"]])
    away = np.hypot(x - sensors[:, 0], y - sensors[:, 1])
    is_own = (np.abs(ranges - away + float(circle["radius"])) < p[0].gate_m) & (ranges < FAR) & (away > 0.0)
    held, sensors, ranges = held[is_own], sensors[is_own], ranges[is_own]
    axes = np.column_stack([held["axis_x"], held["axis_y"]])
    room = memory.state["room"][0]
    slack = CORNER_SLACK_M + EXPLAINED_SIGMAS * np.sqrt(
        float(room["variance_m2"]) + float(room["relative_variance"]) * ranges**2
    )
    is_claimed = np.zeros(len(ranges), np.bool_)
    for surface in surfaces:
        begin, end = surface[:2], surface[2:]
        expected = _nearest(sensors, axes, begin, end, has_mirrors(memory), p)
        to = np.array([x, y]) - sensors
        before = _along_ray(sensors, to / np.hypot(*to.T)[:, None], begin, end)
        is_claimed |= (np.abs(ranges - expected) < slack) | (before < ranges - slack)
    return int(np.count_nonzero(~is_claimed))


def _nearest(
    sensors: Floats, axes: Floats, begin: Floats, end: Floats, is_mirror: bool, p: SettingsRecord
) -> Floats:  # fmt: skip
    """Return the range at which a surface answers each sensor, m; +inf where it is not in the beam."""
    length = max(math.dist(begin, end), POINT_M)
    tangent = (end - begin) / length
    foot = begin + np.clip((sensors - begin) @ tangent, 0.0, length)[:, None] * tangent
    distance = np.hypot(*(foot - sensors).T)
    nearest = np.where(_is_in_beam(foot - sensors, axes, p), distance, math.inf)
    if is_mirror:
        return nearest
    c, s = float(p[0].cos_half_angle), float(p[0].sin_half_angle)
    for side in (s, -s):
        ray = axes @ np.array([[c, side], [-side, c]])
        nearest = np.minimum(nearest, _along_ray(sensors, ray, begin, end))
    return nearest


def _is_in_beam(to: Floats, axes: Floats, p: SettingsRecord) -> NDArray[np.bool_]:
    return np.asarray((to * axes).sum(axis=1) >= p[0].cos_may_answer * np.hypot(*to.T))


def _along_ray(sensors: Floats, rays: Floats, begin: Floats, end: Floats) -> Floats:
    """Return how far along its ray, a unit vector, each sensor meets a surface, m; +inf where it does not."""
    along, to = end - begin, begin - sensors
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = rays[:, 0] * along[1] - rays[:, 1] * along[0]
        reach = (to[:, 0] * along[1] - to[:, 1] * along[0]) / turn
        share = (to[:, 0] * rays[:, 1] - to[:, 1] * rays[:, 0]) / turn
        return np.where((reach > 0.0) & (share >= 0.0) & (share <= 1.0), reach, math.inf)
