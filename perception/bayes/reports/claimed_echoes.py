"""Echoes of a circle that walls and corners explain: only the others show that another object stands there.

Before a wall is known, its echoes start round objects at it and behind it. Once it is sure, nothing denies these:
every range towards them ends at the wall. So they are reported only for echoes of their own. An echo belongs to a
wall that answers at its range, and to no object that is hidden by a wall.
"""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.inference.cross_path import LENGTH_MIN_M
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import Memory
from perception.bayes.walls.contact import CORNER_SLACK_M, EXPLAINED_SIGMAS
from perception.bayes.walls.report import has_mirrors
from perception.kernel import Floats, Ints
from perception.records import Structured
from perception.shared_numbers import FAR


def own_echoes(circles: Structured, surfaces: Floats, memory: Memory, p: SettingsRecord) -> Ints:
    """Return how many of the echoes that each circle explains no surface does, shape (k,).

    Parameters
    ----------
    circles : (k,) record of `CircleTrack`
        The circles.
    surfaces : (n, 4) float
        The ends x, y, x, y of walls that are sure, m; a corner has both in one place.
    memory, p
        The noise and whether walls are mirrors, and the settings.
    """
    bins = circles["bins"]
    kept = np.arange(bins["readings"].shape[-1]) < bins["count"][..., None]
    owner, held = kept.nonzero()[0], bins["readings"][kept]
    centres = np.column_stack([circles["x"], circles["y"]])[owner]
    sensors, ranges = np.column_stack([held["x"], held["y"]]), held["range_m"]
    to = centres - sensors
    away = np.hypot(*to.T)
    is_own = (np.abs(ranges - away + circles["radius"][owner]) < p[0].gate_m) & (ranges < FAR) & (away > 0.0)
    owner, sensors, ranges, to = owner[is_own], sensors[is_own], ranges[is_own], to[is_own] / away[is_own, None]
    axes = np.column_stack([held["axis_x"], held["axis_y"]])[is_own]
    room = memory.state["room"][0]
    variance = float(room["variance_m2"]) + float(room["relative_variance"]) * ranges**2
    slack = (CORNER_SLACK_M + EXPLAINED_SIGMAS * np.sqrt(variance))[:, None]
    error = np.abs(ranges[:, None] - _nearest(sensors, axes, surfaces, has_mirrors(memory), p))
    is_claimed = (error < slack) | (_along_ray(sensors, to, surfaces) < ranges[:, None] - slack)
    return np.bincount(owner[~is_claimed.any(axis=1)], minlength=len(circles))


def _nearest(sensors: Floats, axes: Floats, surfaces: Floats, are_mirrors: bool, p: SettingsRecord) -> Floats:
    """Return the range at which each surface answers each sensor, m, (m, n); +inf where it is not in the beam."""
    tx, ty = (surfaces[:, 2:] - surfaces[:, :2]).T
    length = np.maximum(np.hypot(tx, ty), LENGTH_MIN_M)
    tx, ty = tx / length, ty / length
    dx, dy = (surfaces[:, k] - sensors[:, k, None] for k in range(2))
    along = np.clip(-(dx * tx + dy * ty), 0.0, length)
    dx, dy = dx + along * tx, dy + along * ty
    distance = np.hypot(dx, dy)
    is_in_beam = dx * axes[:, :1] + dy * axes[:, 1:] >= p[0].cos_may_answer * distance
    nearest = np.where(is_in_beam, distance, math.inf)
    if not are_mirrors:
        c, s = float(p[0].cos_half_angle), float(p[0].sin_half_angle)
        for side in (s, -s):
            nearest = np.minimum(nearest, _along_ray(sensors, axes @ np.array([[c, side], [-side, c]]), surfaces))
    return nearest


def _along_ray(sensors: Floats, rays: Floats, surfaces: Floats) -> Floats:
    """Return how far along its ray, a unit vector, each sensor meets each surface, m, (m, n); +inf: it does not."""
    ax, ay = (surfaces[:, 2:] - surfaces[:, :2]).T
    dx, dy = (surfaces[:, k] - sensors[:, k, None] for k in range(2))
    rx, ry = rays[:, :1], rays[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = rx * ay - ry * ax
        reach, share = (dx * ay - dy * ax) / turn, (dx * ry - dy * rx) / turn
        return np.where((reach > 0.0) & (share >= 0.0) & (share <= 1.0), reach, math.inf)
