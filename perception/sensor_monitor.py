"""Which sensors to believe: stuck ones, failing ones and those that hear a neighbour are found out and masked.

A reading proves nothing by itself; what it does while the robot moves and while others fire beside it does.

- *Stuck.* A sensor that reads the same while its base has moved towards or away from whatever answers it, whichever
  way in its beam that lies, lies; so does one past which its neighbours saw things come and go. At rest, along a wall
  and behind a slipping wheel the same reading is honest: then the beam is crossed sideways, the neighbours saw
  nothing change, or the whole ring stands still.
- *Silent.* A sensor that hears nothing while both neighbours hear echoes, over a long way: its silence, which would
  say that nothing is there, is not believed, and its first echo is.
- *Failing.* A sensor that should fire and reports no range, however often the ring fires.
- *Crosstalk.* EERUF's idea (Borenstein & Koren 1995): a true echo does not ask who else fired. A reading that is
  shorter than the one before it in another set of sensors is not believed until one in another set says the same:
  that costs a true echo one firing. One that is short in a set again and again, and long before and after in others,
  masks the sensor in that set. So crosstalk is exposed where the firing pattern gives a sensor different partners in
  turn, as the preset `alternating` does; where it does not, nothing is compared and nothing lost.

Masked sensors are listened to all the same, and come back when they behave.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from drivers.messages import Firing
from perception.kernel import Floats, Ints
from perception.sensor_mounts import mounts_array
from perception.sensor_report import SensorReport, report
from perception.sensor_tests import (
    AT,
    CHANGED,
    COLUMNS,
    COUNT,
    EVER,
    LESS_BELIEVED,
    LESS_POSSIBLE,
    MISSED,
    RING,
    SETS,
    watch,
)

NEIGHBOUR_MAX_RAD: Final = math.radians(31.0)
"""A sensor that looks farther aside than this sees other things."""
NEAR_SHARE: Final = 0.45
"""Of the ring's reach: along a straight wall a beam hears up to 2.2 times as far as its neighbour 15° nearer to the
wall, so beyond this an echo says nothing of what the next beam should hear."""


def neighbours(axes: Floats) -> Ints:
    """Return the sensors that look next to each one on either side, shape (n, 2); −1 where it has not two."""
    sides: Ints = np.full((len(axes), 2), -1, np.int64)
    for i, axis in enumerate(axes):
        aside = np.remainder(axes - axis, 2.0 * math.pi)
        left = [k for k in np.argsort(aside) if 1e-6 < aside[k] <= NEIGHBOUR_MAX_RAD]
        right = [
            k for k in np.argsort(-aside) if 2.0 * math.pi - NEIGHBOUR_MAX_RAD <= aside[k] < 2.0 * math.pi - 1e-6
        ]
        if left and right:
            sides[i] = left[0], right[0]
    return sides


def fires(ring: RingConfig) -> NDArray[np.bool_]:
    """Return who fires at all in the ring's pattern, shape (n,)."""
    count, firing = len(ring.mounts), ring.firing
    if firing.sets is None:
        return np.ones(count, np.bool_)
    named = np.zeros(count, np.bool_)
    for turn in range(firing.rotations):
        for numbers in firing.sets:
            named[[(i + turn) % count for i in numbers]] = True
    return named


class SensorMonitor:
    """Takes in firings and gives them back without what is not to be believed.

    Parameters
    ----------
    ring : RingConfig
        The sensors, and which of them should fire.

    Attributes
    ----------
    changes
        How often a verdict on a sensor has changed.
    """

    SCRATCH: Final = ("_believed", "_possible")
    """No memory."""

    def __init__(self, ring: RingConfig) -> None:
        mounts = mounts_array(ring.mounts)
        count = len(mounts)
        self.changes = 0
        self._axes = np.ascontiguousarray(mounts[:, 2])
        self._sides = neighbours(self._axes)
        self._expected = fires(ring)
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._tolerance = max(1.1 * ring.resolution_m, 0.005)
        self._near = NEAR_SHARE * ring.range_max_m
        self._memory = np.zeros((count, COLUMNS))
        self._ring = np.zeros(RING)
        self._sets = np.zeros((SETS, count), np.uint8)
        self._shorts = np.zeros((count, SETS))
        self._crossed = np.zeros((count, SETS), np.uint8)
        self._faults = np.zeros(count, np.int64)
        self._believed = np.zeros(count)
        self._possible = np.zeros(count)

    def filter(self, firing: Firing) -> tuple[Firing, Firing]:
        """Take in a firing; return what is to be believed of it, and that with what is in doubt.

        What is in doubt makes no map, and is kept clear of all the same. Ranges that are neither are NaN there, as if
        the sensor had not fired.
        """
        pose, ranges = firing.pose, firing.ranges_m
        believed, possible = self._believed, self._possible
        news = watch(
            ranges, float(pose.x), float(pose.y), float(firing.ring_yaw), self._axes, self._sides, self._expected,
            self._half_angle, self._tolerance, self._near, self._memory, self._ring, self._sets, self._shorts,
            self._crossed, self._faults, believed, possible,
        )  # fmt: skip
        self.changes += news & CHANGED
        return (
            _only(firing, believed) if news & LESS_BELIEVED else firing,
            _only(firing, possible) if news & LESS_POSSIBLE else firing,
        )

    def set_firing_pattern(self, ring: RingConfig) -> None:
        """Expect another firing pattern of the same sensors from now on."""
        self._expected[:] = fires(ring)
        self._memory[:, MISSED] = 0.0

    def reset(self) -> None:
        """Begin anew, as after the odometry did; what is wrong with a sensor stays wrong."""
        self._memory[:, [COUNT, EVER, MISSED]] = 0.0

    def reports(self) -> tuple[SensorReport, ...]:
        """Return what is wrong, by sensor."""
        return tuple(
            report(i, int(bits), float(self._memory[i, AT]), self._partners(i))
            for i, bits in enumerate(self._faults)
            if bits
        )

    def _partners(self, i: int) -> list[int]:
        """Return who fires in the sets in which sensor `i` is masked."""
        fired = self._sets[self._crossed[i] == 1].any(axis=0)
        return [int(k) for k in np.flatnonzero(fired) if k != i]


def _only(firing: Firing, ranges: Floats) -> Firing:
    return Firing(firing.robot_s, firing.pose, firing.ring_yaw, ranges.copy())
