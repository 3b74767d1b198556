"""The test of whether a sensor is deaf: silent where what others hear passes through its own beam.

A surface answers a sensor from some directions only: a mirror where its normal lies in the beam, something rough or
round from all sides. So the silence of a sensor says little while others hear echoes in other directions. But what
was heard at a place from one direction, and also from another one, is heard from those between them: the looks whose
axes lie between two others that heard the same place are compared with them. A robot that turns brings a sensor where
another one was, and what it passes goes from beam to beam.

How often healthy sensors miss such an echo is learned from the other sensors as the run goes on. The sensor is deaf
if its silence in all of these looks since its last echo has a chance of less than `exp(-DEAF_NAT)`.
"""

from __future__ import annotations

import math
from typing import Final

from perception.angles import wrapped
from perception.kernel import kernel
from perception.records import Records
from perception.sensor_faults.memory import LOOKS_KEPT, RingMemory, SensorLook, SensorMemory
from perception.shared_numbers import SAME_ECHO_M

DEAF_NAT: Final = math.log(1e8)
"""Evidence that names a sensor, nat: a day has some 10⁵ such looks of each of two dozen sensors."""
HEALTHY_MISSES: Final = 3.0
"""Misses, among `HEALTHY_LOOKS`, that stand for what is known of healthy sensors before a run."""
HEALTHY_LOOKS: Final = 10.0
"""Looks that stand for what is known of healthy sensors before a run."""
HEALTHY_MISS_MIN: Final = 0.2
"""A healthy sensor misses no less than this: the looks at one object are alike."""
LOOKS_APART_M: Final = 0.1
"""A look that is nearer than this to the one before, and turned by less than a quarter of the beam, is not kept."""
AGAIN_M: Final = 0.3
"""Looks that count are this far apart, or turned by a whole beam, as others are alike."""
BESIDE_RAD: Final = math.radians(60.0)
"""Only echoes whose axes differ by less than this from that of a look are compared with it."""


@kernel
def was_audible(i: int, look: SensorLook, half_angle: float, near: float, sensors: Records[SensorMemory]) -> bool:
    """Return whether others have heard a place in the middle of a look's beam from both sides of its axis.

    Parameters
    ----------
    i : int
        The sensor.
    look : record
        Its look.
    half_angle : float
        Half the beam's width, rad.
    near : float
        What is farther away does not count, m.
    sensors : (n,) records
        What is remembered of each sensor.
    """
    core = math.tan(0.5 * half_angle)
    c, s = math.cos(look.axis), math.sin(look.axis)
    place, nearest = -1.0, BESIDE_RAD
    for turn in range(2):
        is_left = is_right = False
        for k in range(len(sensors)):
            if k == i:
                continue
            for j in range(LOOKS_KEPT):
                other = sensors[k].looks[j]
                if not other.range_m > 0.0:
                    continue
                turned = wrapped(other.axis - look.axis)
                if abs(turned) >= BESIDE_RAD:
                    continue
                dx = other.x + other.range_m * math.cos(other.axis) - look.x
                dy = other.y + other.range_m * math.sin(other.axis) - look.y
                ahead, across = c * dx + s * dy, c * dy - s * dx
                if not (0.0 < ahead < near and abs(across) < ahead * core):
                    continue
                if turn == 0:
                    if abs(turned) < nearest:
                        place, nearest = ahead, abs(turned)
                elif abs(ahead - place) < SAME_ECHO_M:
                    is_left = is_left or turned > -0.25 * half_angle
                    is_right = is_right or turned < 0.25 * half_angle
        if turn == 0 and place < 0.0:
            return False
        if turn == 1:
            return is_left and is_right
    return False


@kernel
def weigh_silence(
    i: int,
    r: float,
    x: float,
    y: float,
    axis: float,
    half_angle: float,
    near: float,
    sensors: Records[SensorMemory],
    ring: Records[RingMemory],
) -> bool:
    """Take a reading of a sensor, and return whether its silence shows that it is deaf.

    A look is judged after half of `LOOKS_KEPT` later ones: others have heard what is there before it, or since.

    Parameters
    ----------
    i : int
        The sensor.
    r : float
        Its reading, m; infinite without an echo.
    x, y, axis : float
        Its place (m) and direction (rad).
    half_angle, near, sensors
        As for `was_audible`. Updated.
    ring : (1,) record
        What is remembered of the ring. Updated.
    """
    c, all_of = sensors[i], ring[0]
    hears = math.isfinite(r)
    if hears:
        c.deaf_looks, c.heard_looks = 0, c.looks_made
    last = c.looks[(c.looks_made - 1) % LOOKS_KEPT]
    is_new = math.hypot(x - last.x, y - last.y) >= LOOKS_APART_M or abs(wrapped(axis - last.axis)) >= 0.5 * half_angle
    if c.looks_made > 0 and not is_new:
        if hears and last.range_m < 0.0:
            last.range_m = r
        return c.deaf_looks * math.log(1.0 / miss_share(c, all_of)) >= DEAF_NAT
    judged = c.looks_made - LOOKS_KEPT // 2
    past = c.looks[judged % LOOKS_KEPT]
    if judged >= 0 and was_audible(i, past, half_angle, near, sensors):
        missed = past.range_m < 0.0
        c.audible += 1
        c.misses += missed
        all_of.audible += 1
        all_of.misses += missed
        apart = math.hypot(past.x - c.deaf_x, past.y - c.deaf_y) >= AGAIN_M
        if (
            missed
            and judged >= c.heard_looks
            and (apart or abs(wrapped(past.axis - c.deaf_axis)) >= 2.0 * half_angle)
        ):
            c.deaf_looks += 1
            c.deaf_x, c.deaf_y, c.deaf_axis = past.x, past.y, past.axis
    new = c.looks[c.looks_made % LOOKS_KEPT]
    new.x, new.y, new.axis = x, y, axis
    new.range_m = r if hears else -1.0
    c.looks_made += 1
    return c.deaf_looks * math.log(1.0 / miss_share(c, all_of)) >= DEAF_NAT


@kernel
def miss_share(c: SensorMemory, all_of: RingMemory) -> float:
    """Return the share of such looks that healthy sensors miss, by those of the others than `c`."""
    looks, misses = all_of.audible - c.audible, all_of.misses - c.misses
    return min(0.99, max(HEALTHY_MISS_MIN, (misses + HEALTHY_MISSES) / (looks + HEALTHY_LOOKS)))
