"""Whether a sensor repeats its reading through a full turn of the ring in place: then it is stuck.

At one place all sensors look into the same directions in turn. So one that hears the same all around contradicts
others that hear something else, and no way is needed to see that: a robot that turns away from what a stuck sensor
shows it would turn for ever.
"""

from __future__ import annotations

import math
from typing import Final

from perception.angles import wrapped
from perception.kernel import kernel
from perception.records import Records
from perception.sensor_faults.memory import RingMemory, SensorMemory
from perception.sensor_faults.report import STUCK
from perception.sensor_faults.wall import NOISE_SHARE
from perception.shared_numbers import SAME_ECHO_M

IN_PLACE_M: Final = 0.1
"""A ring that moves farther no longer turns in place, m."""


@kernel
def follow_turn(x: float, y: float, yaw: float, ring: Records[RingMemory]) -> None:
    """Follow how far the ring has turned in place; after two full turns begin anew, for readings that began later.

    Parameters
    ----------
    x, y, yaw : float
        Pose of the ring, m and rad.
    ring : (1,) record
        What is remembered of the ring, with this firing counted. Updated.
    """
    c = ring[0]
    is_elsewhere = math.hypot(x - c.turn_x, y - c.turn_y) > IN_PLACE_M
    if c.firings <= 1 or is_elsewhere or abs(c.turned) >= 2.0 * math.tau:
        c.turn_x, c.turn_y, c.turned, c.turn_firing = x, y, 0.0, c.firings
    else:
        c.turned += wrapped(yaw - c.turn_yaw)
    c.turn_yaw = yaw


@kernel
def repeats_through_turn(i: int, r: float, sensors: Records[SensorMemory], ring: Records[RingMemory]) -> bool:
    """Return whether sensor `i` has read the same through a full turn in place, and most others read otherwise.

    Parameters
    ----------
    i : int
        The sensor.
    r : float
        Its echo's range, m.
    sensors, ring
        What is remembered of each sensor, and of the ring.
    """
    if abs(ring[0].turned) < math.tau or sensors[i].run_firing > ring[0].turn_firing:
        return False
    elsewhere = 0
    others = 0
    for k in range(len(sensors)):
        c = sensors[k]
        if k != i and c.readings > 0 and math.isfinite(c.last_m) and c.faults & STUCK == 0:
            others += 1
            elsewhere += abs(c.last_m - r) > SAME_ECHO_M + NOISE_SHARE * min(c.last_m, r)
    return bool(elsewhere >= 2 and 2 * elsewhere >= others)
