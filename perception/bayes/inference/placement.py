"""The readings of a firing in the odometry frame, and which of them are evidence: what repeats itself is left out."""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.noise_estimation import noise_variance, tolerance_m
from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.parameters import STILL_COS, STILL_M
from perception.bayes.memory.scratch import UNEXPLAINED
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import Sensor, StateRecord
from perception.kernel import Floats, kernel
from perception.shared_numbers import FAR

COORDINATE_MAX_M: Final = 0.5 * FAR
"""A position farther than this from the odometry's origin is invalid: ranges this long mean silence."""
STANDING_M: Final = 0.005
"""A sensor that moved less is where it was; odometry trembles by less than this."""
CHANGED_MIN: Final = 3
"""So many readings in turn that differ from the first one say that the surroundings have changed: of drop-outs of
10 % one in a thousand series is so long. Each doubling of the looks before them asks for one more."""
LOOKS_MAX: Final = 8
"""Readings from one place that can be evidence, of what is new there."""
COUNTED: Final = LOOKS_MAX + 1
"""Looks with which a sensor arrives at a place, so that its further ones there are no evidence."""


@kernel
def says_new(sensor: Sensor, range_m: float, tolerance: float) -> bool:
    """Return whether a reading from the place of the sensor's last one is evidence; count it.

    The errors of readings from one place are not independent: what their mean is off by stays, however many they are.
    So a sensor that arrived here is evidence once: what was sure then stays, until the surroundings have changed, as
    several readings in turn show that differ from the first one. Where two surfaces answer in turn, long series come
    by chance; so the longer the first range was heard, the longer the series must be. After a change, and before the
    sensor ever moved, nothing else is known: the first, second, fourth and eighth count, whatever they read. If those
    that repeat the last range were left out instead, ranges that vary by a count would outnumber silences, and the
    surroundings would seem to answer at any angle.

    Parameters
    ----------
    sensor : Sensor
        Updated.
    range_m : float
        The range, m.
    tolerance : float
        Greatest difference between two ranges of one surface, m.
    """
    sensor.looks += 1
    sensor.changed = sensor.changed + 1 if abs(range_m - sensor.last.range_m) > tolerance else 0
    if sensor.changed >= CHANGED_MIN + math.log2(max(1, sensor.looks - sensor.changed)):
        sensor.looks = 1
        sensor.changed = 0
    return bool(sensor.looks <= LOOKS_MAX and sensor.looks & (sensor.looks - 1) == 0)


@kernel
def place_readings(
    s: StateRecord, p: SettingsRecord, mounts: Floats, px: float, py: float, yaw: float, ranges: Floats
) -> int:
    """Write the fired readings to the scratch in the odometry frame; return how many of them are not redundant.

    An invalid pose or range is left out, because it would corrupt every sum. So is the least range that the ring can
    report: whatever is nearer reads so, by up to a decimetre too far, and drums that were passed closely lost their
    names.

    Parameters
    ----------
    s, p, mounts, px, py, yaw, ranges
        As for `associate`.
    """
    s[0].scratch.crosses = 0
    if not (abs(px) < COORDINATE_MAX_M and abs(py) < COORDINATE_MAX_M and math.isfinite(yaw)):
        return 0
    scratch = s[0].scratch
    var0, rel2 = noise_variance(s, p)
    half_box = p[0].half_resolution_m
    least = p[0].range_min_m + half_box
    c = math.cos(yaw)
    sn = math.sin(yaw)
    m = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not r >= 0.0:  # also true for NaN
            continue
        if r >= p[0].range_max_m:
            r = 2.0 * FAR
        x = px + c * mounts[i, 0] - sn * mounts[i, 1]
        y = py + sn * mounts[i, 0] + c * mounts[i, 1]
        ux = math.cos(yaw + mounts[i, 2])
        uy = math.sin(yaw + mounts[i, 2])
        sensor = s[0].sensors[i]
        last = sensor.last
        moved = math.hypot(x - last.x, y - last.y)
        is_near = moved < STILL_M and ux * last.axis_x + uy * last.axis_y > STILL_COS
        if is_near and moved < STANDING_M:
            if not says_new(sensor, r, tolerance_m(2.0 * half_box, 2.0 * (var0 + rel2 * min(r, last.range_m) ** 2))):
                continue
        elif is_near and abs(r - last.range_m) <= half_box:
            continue
        else:
            sensor.looks = 1 if sensor.looks == 0 else COUNTED
            sensor.changed = 0
        q = scratch.fired[m]
        q.x = x
        q.y = y
        q.axis_x = ux
        q.axis_y = uy
        q.range_m = r
        q.listener_x = q.listener_y = 0.0
        if sensor.looks == 1 or sensor.looks == COUNTED:  # Later ones from there may be strays.
            copy_reading(q, last)
        if r <= least:  # after the above, or the next range from here would be the first look
            continue
        scratch.fired_sensors[m] = i
        scratch.explained_by[m] = UNEXPLAINED
        m += 1
    return m
