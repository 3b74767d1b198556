"""A robot that slipped, and objects that moved: the echoes of one cycle of the ring against all landmarks at once.

An object that moved leaves the other echoes where they were expected. A robot that slipped, or was pushed, displaces
all of them by the same motion, which `perception.localization.drift.joint_compatibility` finds.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from drivers.messages import Pose
from perception.kernel import Floats
from perception.localization.drift.joint_compatibility import (
    Disc,
    Displacement,
    Echo,
    find_displacement,
    share_improved,
)
from perception.localization.drift.landmark_tracker import POSE, LandmarkTracker
from perception.sensor_mounts import turned_mounts

CYCLE_M: Final = 0.3
"""Echoes from farther back than this are not of the same place."""
SLIPPED_SHARE: Final = 0.4
"""Where fewer of the landmarks fit clearly better after a displacement, some landmarks moved, and not the robot."""


def echoes_of_cycle(
    rows: Floats, mounts: Floats, turning: tuple[int, ...], range_min_m: float, range_max_m: float, scale: float
) -> list[Echo]:
    """Return each sensor's last echo of the last cycle, as seen from the ring at the last firing.

    Parameters
    ----------
    rows : (n, POSE + sensors) float
        The last firings, the newest first, as `LandmarkTracker` takes them.
    mounts : (sensors, 3) float
        Place (m) and direction (rad) of each sensor in the ring's frame.
    turning : tuple of int
        The sensors that turn with the wheels, as `config.robot.RingConfig.turning`.
    range_min_m, range_max_m : float
        Ranges of the ring; one at either end is no echo.
    scale : float
        Reported range over true range.
    """
    x, y, _, yaw = rows[0, :POSE].tolist()
    here = Pose(x, y, yaw).inverse()
    heard: set[int] = set()
    echoes = []
    for row in rows:
        row_x, row_y, row_theta, row_yaw = row[:POSE].tolist()
        fired = np.flatnonzero(row[POSE:] > 0.0).tolist()
        if math.hypot(row_x - x, row_y - y) > CYCLE_M or not heard.isdisjoint(fired):
            break
        heard.update(fired)
        at, row_mounts = (
            here.compose(Pose(row_x, row_y, row_yaw)),
            turned_mounts(mounts, turning, row_theta - row_yaw),
        )
        for i in fired:
            if range_min_m < row[POSE + i] < range_max_m:
                sensor = at.compose(Pose(*row_mounts[i].tolist()))
                echoes.append(Echo(sensor.x, sensor.y, sensor.theta, float(row[POSE + i]) / scale))
    return echoes


def find_slip(tracker: LandmarkTracker, echoes: list[Echo], half_angle: float, reach_m: float) -> Displacement | None:
    """Return how the ring is displaced from where the filter believes it is; None where that remains unknown.

    Where most landmarks fit as well without a displacement, that is the identity: the robot did not slip.

    Parameters
    ----------
    tracker : LandmarkTracker
        The filter.
    echoes : list of Echo
        Of one cycle.
    half_angle, reach_m : float
        Half the beam's width (rad); landmarks farther than this do not answer (m).
    """
    e = tracker.e[0]
    here = Pose(e.x, e.y, e.heading).inverse()
    discs = []
    for x, y, radius in zip(*tracker.landmarks("x", "y", "radius"), strict=True):
        seen = here.compose(Pose(x, y, 0.0))
        if math.hypot(seen.x, seen.y) < reach_m:
            discs.append(Disc(seen.x, seen.y, radius))
    found = find_displacement(echoes, discs, half_angle)
    if found is None or share_improved(found, echoes, discs, half_angle) > SLIPPED_SHARE:
        return found
    return found._replace(pose=Pose(0.0, 0.0, 0.0))
