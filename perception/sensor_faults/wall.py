"""Whether a wall along the path is why a sensor repeats its reading: then it is not stuck."""

from __future__ import annotations

import math
from typing import Final

from perception.angles import wrapped
from perception.kernel import Floats, kernel
from perception.records import Records
from perception.sensor_faults.memory import RingSetup, SensorMemory

BESIDE_MIN_M: Final = 0.5
"""Stuck: a wall along the path is looked for once the base has moved so far, m."""
NOISE_SHARE: Final = 0.04
"""A neighbour's reading has changed only beyond the tolerance and this share: four deviations of 1 % noise."""

SQUARE_MIN: Final = 0.94
"""Least sine of the angle from the path at which a sensor hears a wall along it nearly as one square to it does."""


@kernel
def towards_wall(axis: float, half_angle: float) -> float:
    """Return the angle from the path, in a beam about `axis`, that is nearest to the normal of a wall along it, rad.

    Parameters
    ----------
    axis : float
        Angle of the beam's axis from the path, rad: towards the wall it is between 0 and π.
    half_angle : float
        Half the beam's width, rad.
    """
    return min(max(0.5 * math.pi, axis - half_angle), axis + half_angle)


@kernel
def fits_unseen_wall(
    axis: float,
    change: float,
    moved: float,
    yaw: float,
    mounts: Floats,
    half_angle: float,
    slack: tuple[float, float],
) -> bool:
    """Return whether a range changes as that of a wall along the path does, on a side where no sensor sees one.

    No beam there comes so near to the wall's normal, about 20°, that it would hear how far away the wall is. So it is
    with a ring that only looks ahead, and now and then with one all round whose axes are more than 40° and a beam's
    width apart. Its beams graze the wall all the same, and their ranges stay. The price: a ring that only looks
    ahead by its file, and is mounted turned by 90°, is not found beside walls.

    Parameters
    ----------
    axis : float
        Angle of the beam's axis from the path, rad.
    change, moved : float
        By how much the range has changed, and the sensor has moved, m.
    yaw : float
        Angle of the ring from the path, rad.
    mounts, half_angle
        As of `RingSetup`.
    slack : (float, float)
        Error of the change, m, and angle between wall and path up to which the wall counts as along the path, rad.
    """
    error, lean = slack
    for turn in range(2):
        side = 1.0 - 2.0 * turn
        nearest = towards_wall(side * axis, half_angle)
        if math.sin(nearest) < 1e-3:
            continue
        least = max(1e-3, min(math.sin(nearest - lean), math.sin(nearest + lean)))
        if abs(change) > error + moved * math.sin(lean) / least:
            continue
        is_seen = False
        for k in range(len(mounts)):
            is_seen |= math.sin(towards_wall(side * wrapped(yaw + mounts[k, 2]), half_angle)) >= SQUARE_MIN
        if not is_seen:
            return True
    return False


@kernel
def is_along_wall(
    i: int,
    x: float,
    y: float,
    own_yaw: float,
    yaw: float,
    setup: RingSetup,
    sensors: Records[SensorMemory],
) -> bool:
    """Return whether a wall along the path explains the run of sensor `i`, as a neighbour hears the same wall.

    A healthy sensor repeats a reading on the way only if what answers is parallel to the path. A rough wall beside
    it at the distance h answers a sensor from the direction e in its beam that is nearest to the wall's normal, so
    that the range is h/sin e for as long as the wall goes on.

    Parameters
    ----------
    i : int
        The sensor.
    x, y : float
        Place of the ring, m.
    own_yaw, yaw : float
        Direction of the sensor's part and of the ring, rad.
    setup, sensors
        As for `check_firing`.
    """
    c, mounts, half_angle = sensors[i], setup.mounts, setup.half_angle
    dx, dy = x - c.run_x, y - c.run_y
    if not math.isfinite(c.run_m) or math.hypot(dx, dy) < BESIDE_MIN_M:
        return False
    path = math.atan2(dy, dx)
    side = 1.0 if math.sin(own_yaw + mounts[i, 2] - path) > 0.0 else -1.0
    beside = beside_m(c.run_m, own_yaw - path, side, mounts[i], half_angle)
    for k in setup.neighbours[i]:
        if k >= 0 and math.isfinite(sensors[k].steady_m):
            heard = beside_m(sensors[k].steady_m, yaw + setup.turns[k] - path, side, mounts[k], half_angle)
            if abs(heard - beside) <= setup.tolerance + NOISE_SHARE * min(c.run_m, sensors[k].steady_m):
                return True
    return False


@kernel
def beside_m(r: float, turn: float, side: float, mount: Floats, half_angle: float) -> float:
    """Return how far beside the path of the ring's centre a wall along it lies that answers a sensor, m.

    Parameters
    ----------
    r : float
        The range, m.
    turn : float
        Direction of the sensor's part from the path, rad.
    side : float
        1 for a wall on the left of the path, −1 on the right.
    mount : (3,) float
        The sensor's place x, y (m) and direction (rad) in its part.
    half_angle : float
        Half the beam's width, rad.
    """
    axis = side * wrapped(turn + mount[2])
    nearest = towards_wall(axis, half_angle)
    return float(side * (mount[0] * math.sin(turn) + mount[1] * math.cos(turn)) + r * math.sin(nearest))
