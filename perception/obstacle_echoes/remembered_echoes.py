"""Steady echoes of the last seconds, wherever they were heard: the robot must not drive fast at what it heard before.

A robot that turns looks with other sensors at what it heard, and a robot that comes back looks again. Where those
sensors have heard nothing at all since, nothing shows that they hear: their silence contradicts no echo. What a
sensor heard from behind a place does, and so does the silence of one that has heard anything since.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Pose
from perception.angles import wrapped
from perception.bounds import PLACE, bounds
from perception.kernel import Floats, kernel
from perception.sensor_mounts import RingPose

REMEMBERED_S: Final = 15.0
"""An echo is remembered for so long, s: a robot that turns away from what it hears is back at it within that."""
HEARS_S: Final = 1.5
"""A sensor whose last echo came so much later than another one hears, s: as long as echoes count as fresh."""
REMEMBERED_PLACES: Final = 128
"""Echoes that are remembered; the oldest makes room. At .3 m/s a ring of 24 sensors fills it in 5 to 15 s."""
ONE_PLACE_M: Final = 0.1
"""Echoes that are nearer to each other are one, m."""


@kernel
def remember(
    ranges: Floats,
    mounts: Floats,
    pose: RingPose,
    t: float,
    reception: tuple[float, float, float],
    agreed: NDArray[np.bool_],
    places: Floats,
    sensors: Floats,
) -> None:
    """Enter the readings of a firing.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    pose : RingPose
        Place (m) and direction (rad) of the ring.
    t : float
        Time of the firing, s.
    reception : (float, float, float)
        A sensor hears what is so near to its axis, rad, and up to so far away, m; radius of the ring, m.
    agreed : (n,) bool
        Whether another look agrees with the sensor's echo in this firing: only such echoes are remembered.
    places : (REMEMBERED_PLACES, 3) float
        x, y (m) and time (s) of each echo; −inf for none. Updated.
    sensors : (n, 2) float
        When each sensor heard its last echo, s, −inf for never; and its axis now, rad. Updated.
    """
    x, y, yaw = pose
    core, reach, radius = reception
    c, s = math.cos(yaw), math.sin(yaw)
    for k in range(places.shape[0]):
        is_over = not t - REMEMBERED_S <= places[k, 2] <= t
        if is_over or math.hypot(places[k, 0] - x, places[k, 1] - y) < radius:
            places[k, 2] = -math.inf
    for i in range(ranges.shape[0]):
        if math.isnan(ranges[i]):
            continue
        axis = yaw + mounts[i, 2]
        sensors[i, 1] = axis
        if ranges[i] >= reach:
            continue
        sensors[i, 0] = t
        if not agreed[i]:
            continue
        own_x, own_y = x + c * mounts[i, 0] - s * mounts[i, 1], y + s * mounts[i, 0] + c * mounts[i, 1]
        px, py = own_x + ranges[i] * math.cos(axis), own_y + ranges[i] * math.sin(axis)
        oldest = 0
        for k in range(places.shape[0]):
            dx, dy = places[k, 0] - own_x, places[k, 1] - own_y
            ahead, across = dx * math.cos(axis) + dy * math.sin(axis), abs(dy * math.cos(axis) - dx * math.sin(axis))
            is_before = 0.0 < ahead < ranges[i] - ONE_PLACE_M and across < ahead * math.tan(core)
            if is_before or math.hypot(places[k, 0] - px, places[k, 1] - py) < ONE_PLACE_M:
                places[k, 2] = -math.inf
            if places[k, 2] < places[oldest, 2]:
                oldest = k
        places[oldest, 0], places[oldest, 1], places[oldest, 2] = px, py, t


@kernel
def find_ahead(
    pose: RingPose,
    length: float,
    half_width: float,
    half_angle: float,
    places: Floats,
    sensors: Floats,
    found: Floats,
) -> int:
    """Find the echoes ahead that no sensor contradicts which looks there now; return how many there are.

    Parameters
    ----------
    pose : RingPose
        The robot's, m and rad, turned into the direction in which it drives.
    length, half_width : float
        Length and half the width of the way ahead, m.
    half_angle : float
        Half the width of a beam, rad.
    places, sensors
        As for `remember`.
    found : (REMEMBERED_PLACES, 2) float
        The first ones are the places, m. Overwritten.
    """
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    count = 0
    for k in range(places.shape[0]):
        dx, dy = places[k, 0] - x, places[k, 1] - y
        if places[k, 2] == -math.inf or not 0.0 < c * dx + s * dy < length or abs(c * dy - s * dx) >= half_width:
            continue
        bearing, hears = math.atan2(dy, dx), False
        for i in range(sensors.shape[0]):
            looks = abs(wrapped(sensors[i, 1] - bearing)) < half_angle
            hears = hears or (looks and sensors[i, 0] > places[k, 2] + HEARS_S)
        if not hears:
            found[count, 0], found[count, 1] = places[k, 0], places[k, 1]
            count += 1
    return count


class RememberedEchoes:
    """What a ring has heard in the last seconds.

    Parameters
    ----------
    count : int
        The number of its sensors.
    """

    BOUNDS: Final = bounds(_places=PLACE._replace(infinite=True), _sensors=PLACE._replace(infinite=True))

    def __init__(self, count: int) -> None:
        self._places, self._sensors = np.zeros((REMEMBERED_PLACES, 3)), np.zeros((count, 2))
        self.clear()

    def enter(
        self,
        ranges_m: Floats,
        mounts: Floats,
        pose: RingPose,
        robot_s: float,
        reception: tuple[float, float, float],
        agreed: NDArray[np.bool_],
    ) -> None:
        """Enter the readings of a firing, as `remember`."""
        remember(ranges_m, mounts, pose, robot_s, reception, agreed, self._places, self._sensors)

    def ahead(self, pose: Pose, length_m: float, half_width_m: float, half_angle_rad: float) -> Floats:
        """Return the places ahead that no sensor contradicts which looks there now, shape (k, 2), m."""
        found = np.empty((REMEMBERED_PLACES, 2))
        place = (float(pose.x), float(pose.y), float(pose.theta))
        count = find_ahead(place, length_m, half_width_m, half_angle_rad, self._places, self._sensors, found)
        return found[:count]

    def clear(self) -> None:
        """Forget all echoes."""
        self._places[:, 2] = -math.inf
        self._sensors[:, 0] = -math.inf
