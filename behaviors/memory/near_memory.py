"""Echoes near the robot that are remembered on its way, although the ring hears nothing there any more.

Close to the rim the beams of a ring leave gaps: a post there is heard from every other direction only, and the next
silence of the sensor that heard it removes its echo from the fresh ones. So schemas that drive along something
remember where it was heard, for some metres and not for some seconds.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np

from config.bounded import Coordinate
from perception.percept import Floats, Pose

NearEchoes: TypeAlias = tuple[tuple[Coordinate, Coordinate, Coordinate], ...]
"""Places x, y, and how far the robot had driven when each was last heard, m."""

NEAR_M: Final = 1.5
"""What is farther from the centre is heard from anywhere."""
KEPT_M: Final = 2.5
"""Way for which an echo is remembered."""
SPACING_M: Final = 0.1
"""A newer echo replaces older ones within this distance."""
KEPT_MAX: Final = 64


def remember(kept: NearEchoes, echoes: Floats, pose: Pose, driven_m: float, body_radius_m: float) -> NearEchoes:
    """Return what is remembered now.

    Parameters
    ----------
    kept
        What was remembered.
    echoes
        The fresh ones, shape (k, 2), m.
    pose
        The robot's.
    driven_m
        How far it has driven.
    body_radius_m
        What the body stands on was no obstacle.
    """
    here = (pose.x, pose.y)  # of five and ten places: numpy's calls would take longer
    fresh = [(x, y, driven_m) for x, y in echoes.tolist() if math.dist((x, y), here) < NEAR_M][:KEPT_MAX]
    old = [
        (x, y, at)
        for x, y, at in kept
        if at > driven_m - KEPT_M
        and body_radius_m < math.dist((x, y), here) < NEAR_M
        and not any(math.dist((x, y), (newer_x, newer_y)) <= SPACING_M for newer_x, newer_y, _ in fresh)
    ]
    return (*fresh, *old)[:KEPT_MAX]


def places(kept: NearEchoes) -> Floats:
    """Return where what is remembered was heard, shape (n, 2), m."""
    return np.array(kept).reshape(-1, 3)[:, :2]
