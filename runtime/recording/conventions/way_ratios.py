"""How much ranges change for each unit of the way: the unit of positions over that of ranges, whatever both are."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.robot import RobotConfig
from drivers.messages import Floats
from runtime.recording.conventions.table import Table

PAIR_ALONG: Final = 0.85
"""Least cosine between the way and the beam where a range's change is compared with the way."""
PAIR_LN: Final = 0.12
"""Spread of the logarithm of the ratio of both."""
CHANCE: Final = 3.0
"""Standard deviations of chance by which more ranges must become shorter than longer."""


def way_ratios(table: Table, robot: RobotConfig, yaw: Floats, hand: int) -> Floats:
    """Return how much ranges changed for each unit of way along the beam, where the robot drove along one.

    Parameters
    ----------
    table : Table
        In the file's units.
    robot : RobotConfig
        Its ring.
    yaw : (n,) float
        Direction of the ring, rad counter-clockwise in the frame of x and hand · y.
    hand : int
        As `HeadingRule.hand`.
    """
    x, y = table.pose[:, 0], hand * table.pose[:, 1]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    least = way[-1] / 300.0
    found: list[Floats] = []
    for sensor, mount in enumerate(robot.ring.mounts):
        rows = np.flatnonzero(np.isfinite(table.ranges[:, sensor]))
        if len(rows) < 3 or least <= 0.0:
            continue
        later = np.searchsorted(way[rows], way[rows] + least)
        begin = np.flatnonzero(later < len(rows))
        a, b = rows[begin], rows[later[begin]]
        dx, dy = x[b] - x[a], y[b] - y[a]
        far = np.hypot(dx, dy)
        turned = np.abs(np.angle(np.exp(1j * (yaw[b] - yaw[a]))))
        beam = yaw[a] + mount.angle_rad
        along = (dx * np.cos(beam) + dy * np.sin(beam)) / np.maximum(far, 1e-300)
        good = (np.abs(along) > PAIR_ALONG) & (turned < 0.1) & (far < 3.0 * least)
        found.append((table.ranges[a[good], sensor] - table.ranges[b[good], sensor]) / (far * along)[good])
    return without_noise(np.concatenate(found)) if found else np.empty(0)


def without_noise(ratios: Floats) -> Floats:
    """Return the positive ratios, (n,), but for as many of each size as there are negative ones.

    Noise on a range that stays, as of a wall beside the way, is as often negative as positive.
    """
    shown, noise = ratios[ratios > 0.0], -ratios[ratios < 0.0]
    if len(shown) - len(noise) <= CHANCE * math.sqrt(len(shown) + len(noise)):
        return np.empty(0)
    kept = []
    of_shown, of_noise = (np.floor(np.log(each) / PAIR_LN) for each in (shown, noise))
    for size in np.unique(of_shown):
        alike = shown[of_shown == size]
        left = max(len(alike) - int(np.count_nonzero(of_noise == size)), 0)
        kept.append(alike[np.linspace(0, len(alike), left, endpoint=False).astype(np.int64)])
    return np.concatenate(kept)
