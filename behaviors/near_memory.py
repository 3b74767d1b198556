"""Echoes near the robot that are remembered on its way, although the ring hears nothing there any more.

Close to the rim the beams of a ring leave gaps: a post there is heard from every other direction only, and the next
silence of the sensor that heard it removes its echo from the fresh ones. So schemas that drive along something
remember where it was heard, for some metres and not for some seconds.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np

from perception.percept import Floats, Pose

NearEchoes: TypeAlias = tuple[tuple[float, float, float], ...]
"""Places x, y, and how far the robot had driven when each was last heard, m."""

NEAR_M: Final = 1.5
"""What is farther from the centre is heard from anywhere."""
KEPT_M: Final = 2.5
"""Way for which an echo is remembered."""
SPACING_M: Final = 0.1
"""A newer echo replaces older ones within this distance."""
KEPT_MAX: Final = 64


def remember(
    kept: NearEchoes, echoes: Floats, pose: Pose, driven_m: float, body_radius_m: float
) -> tuple[NearEchoes, Floats]:
    """Return what is remembered now, and its places, shape (n, 2), m.

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
    fresh = np.column_stack([echoes, np.full(len(echoes), driven_m)])
    fresh = fresh[_distances(fresh, pose) < NEAR_M]
    old = np.array(kept).reshape(-1, 3)
    away = _distances(old, pose)
    old = old[(away > body_radius_m) & (away < NEAR_M) & (old[:, 2] > driven_m - KEPT_M)]
    if len(old) and len(fresh):
        apart = np.hypot(old[:, 0, None] - fresh[:, 0], old[:, 1, None] - fresh[:, 1])
        old = old[apart.min(axis=1) > SPACING_M]
    rows = np.concatenate([fresh, old])[:KEPT_MAX]
    return tuple((x, y, at) for x, y, at in rows.tolist()), rows[:, :2]


def _distances(rows: Floats, pose: Pose) -> Floats:
    return np.hypot(rows[:, 0] - pose.x, rows[:, 1] - pose.y)
