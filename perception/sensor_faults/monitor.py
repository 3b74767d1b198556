"""Detection of faulty sensors: stuck, failing, silent and cross-talking ones are found and masked.

A single reading proves nothing; how readings change while the robot moves and while other sensors fire does.

- *Stuck.* The sensor repeats one reading although its base has moved towards or away from any surface in its beam
  that could give that reading, or although its neighbours saw objects pass. The same reading is legitimate at rest,
  along a wall and with slipping wheels: then the base moves across the beam, the neighbours' readings do not change,
  or those of the whole ring do not. Or it repeats one through a full turn in place, while others read otherwise
  (`perception.sensor_faults.turning`). One that hears alone is found by its motion
  (`perception.ring_faults.motion_tests.STUCK_SENSOR`).
- *Silent.* The sensor hears nothing of what others heard where it looks, from both sides of its axis
  (`perception.sensor_faults.silence`). Its silence, which would mean free space, is not mapped; its first echo is. It
  still counts as a look (`perception.obstacle_echoes.fresh_echoes`), which has no echo.
- *Too near.* The sensor answers ranges below the least that it can measure, or several do so in turn.
- *Failing.* The sensor should fire and reports no range, however often the ring fires.
- *At its maximum.* The ring answers its greatest range where it hears nothing
  (`perception.sensor_faults.maximum`): then that is a silence.
- *Crosstalk.* EERUF's idea (Borenstein & Koren 1995): a true echo does not depend on which other sensors fired. A
  reading that is shorter than the one before it in another set of sensors is not trusted until a reading in another
  set agrees, which delays a true echo by one firing. If a sensor repeatedly reads short in one set only, it is masked
  in that set. So crosstalk shows if the firing pattern gives a sensor different partners in turn, as the preset
  `alternating` does; with other patterns nothing is compared and nothing is lost.

Masked sensors are still tested and return to use when they behave.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from drivers.messages import CrossPaths, Firing
from perception.angles import SAME_RAD
from perception.bounds import CONSTANT, COUNT, FLAG, bounds
from perception.kernel import Floats, Ints, kernel
from perception.records import Records, records, zeros
from perception.sensor_faults.memory import SETS_MAX, RingMemory, RingSetup, SensorMemory
from perception.sensor_faults.reading_tests import FAULTS_CHANGED, LESS_POSSIBLE, LESS_TRUSTED, check_firing
from perception.sensor_faults.report import AT_MAXIMUM, SILENT, STUCK, SensorReport, describe_fault
from perception.sensor_faults.silence import miss_share
from perception.sensor_mounts import mounts_array, ring_pose

NEIGHBOUR_MAX_RAD: Final = math.radians(31.0)
"""Largest angle between neighbours' axes, two places of a ring of 24 and some slack; beyond it sensors see different
surfaces."""
NEAR_SHARE: Final = 0.45
"""Share of the ring's reach beyond which an echo does not predict what another sensor hears: along a straight wall a
beam measures up to 2.2 times as far as its neighbour 15° nearer to the wall."""
LEAST_SHARE: Final = 0.95
"""What is below this share of the least range cannot be measured: temperature changes ranges by at most 5 %."""
TOLERANCE_MIN_M: Final = 0.005
"""Least tolerance for equal readings, for rings that do not quantise."""
SAME_STEP_M: Final = 1e-6
"""Rounding of a range, m."""
TOLERANCE_STEPS: Final = 1.1
"""Tolerance for equal readings in steps of the ring's quantisation: one step and some rounding."""


def neighbours_of(axes: Floats, turning: tuple[int, ...] = ()) -> Ints:
    """Return the sensors that look next to each one on the left and on the right.

    Parameters
    ----------
    axes : (n,) float
        Direction of each sensor in the ring, rad.
    turning : tuple of int
        The sensors that turn with the wheels: none of them is the neighbour of one that does not.

    Returns
    -------
    (n, 2) int
        Indices of the neighbours, −1 twice for a sensor that has not two.
    """
    neighbours: Ints = np.full((len(axes), 2), -1, np.int64)
    turns = np.isin(np.arange(len(axes)), turning)
    for i, axis in enumerate(axes):
        bearings = np.where(turns == turns[i], np.remainder(axes - axis, 2.0 * math.pi), 0.0)
        left = [k for k in np.argsort(bearings) if SAME_RAD < bearings[k] <= NEIGHBOUR_MAX_RAD]
        right = [
            k
            for k in np.argsort(-bearings)
            if 2.0 * math.pi - NEIGHBOUR_MAX_RAD <= bearings[k] < 2.0 * math.pi - SAME_RAD
        ]
        if left and right:
            neighbours[i] = left[0], right[0]
    return neighbours


def fires(ring: RingConfig) -> NDArray[np.bool_]:
    """Return for each sensor whether it fires at all in the ring's pattern, shape (n,)."""
    count, firing = ring.sensor_count, ring.firing
    if firing.sets is None:
        return np.ones(len(ring.mounts), np.bool_)
    named = np.zeros(count, np.bool_)
    for turn in range(firing.rotations):
        for numbers in firing.sets:
            named[[(i + turn) % count for i in numbers]] = True
    return named[list(ring.sensor_of)]


@kernel
def are_sound(sensors: Records[SensorMemory]) -> bool:
    """Return whether no sensor has a fault but in what it reports for nothing, which does not touch what it hears."""
    faults = 0
    for i in range(len(sensors)):
        faults |= sensors[i].faults
    return faults & ~(SILENT | AT_MAXIMUM) == 0


class SensorMonitor:
    """Removes untrustworthy readings from firings.

    Parameters
    ----------
    ring : RingConfig
        The sensors, and which of them should fire.
    """

    SCRATCH: Final = ("_trusted", "_possible", "_turns", "_setup", "_sensor_records", "_ring_records")
    """Not part of a snapshot: overwritten before each use, or a view of arrays that are."""
    BOUNDS: Final = bounds(
        changes=COUNT,
        _mounts=CONSTANT,
        _neighbours=CONSTANT,
        _half_angle=CONSTANT,
        _tolerance=CONSTANT,
        _least=CONSTANT,
        _near=CONSTANT,
        _sensors=SensorMemory.BOUNDS,
        _ring=RingMemory.BOUNDS,
        _sets=FLAG,
    )

    def __init__(self, ring: RingConfig) -> None:
        mounts = mounts_array(ring.mounts)
        count = len(mounts)
        self.changes = 0
        """How often a sensor's faults have changed."""
        self._mounts = mounts
        self._turns = np.zeros(count)
        self._turning = list(ring.turning)
        self._neighbours = neighbours_of(mounts[:, 2], ring.turning)
        self._expected = fires(ring)
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._tolerance = max(TOLERANCE_STEPS * ring.resolution_m, TOLERANCE_MIN_M)
        self._least = LEAST_SHARE * ring.range_min_m
        self._near = NEAR_SHARE * ring.range_max_m
        half_step = max(0.5 * ring.resolution_m, SAME_STEP_M)
        last_step = ring.range_max_m - half_step, ring.range_max_m + half_step
        self._setup = RingSetup(
            mounts,
            self._turns,
            self._neighbours,
            self._expected,
            self._half_angle,
            self._tolerance,
            self._least,
            self._near,
            last_step,
        )
        self._sensors = zeros(SensorMemory, count)
        self._sensor_records = records(SensorMemory, self._sensors)
        self._ring = zeros(RingMemory, 1)
        self._ring_records = records(RingMemory, self._ring)
        self._sets = np.zeros((SETS_MAX, count), np.uint8)
        self._trusted = np.zeros(count)
        self._possible = np.zeros(count)

    def filter(self, firing: Firing) -> tuple[Firing, Firing]:
        """Test a firing; return it with trusted readings only, and with trusted and doubtful readings.

        Doubtful readings are not mapped, but the robot keeps clear of them. Other readings are NaN, as if the sensor
        had not fired.
        """
        ranges_m = np.ascontiguousarray(firing.ranges_m, np.float64)  # kernels look at their types no more
        if ranges_m is not firing.ranges_m:
            firing = replace(firing, ranges_m=ranges_m)
        pose, trusted, possible = firing.pose, self._trusted, self._possible
        if self._turning:
            self._turns[self._turning] = pose.theta - firing.ring_yaw
        changed = check_firing(
            firing.ranges_m,
            ring_pose(firing),
            self._setup,
            self._sensor_records,
            self._ring_records,
            self._sets,
            trusted,
            possible,
        )
        self.changes += changed & FAULTS_CHANGED
        if firing.cross_paths is not None and not are_sound(self._sensor_records):
            firing = replace(firing, cross_paths=self._between_sound(firing.cross_paths))
        return (
            _with_ranges(firing, trusted) if changed & LESS_TRUSTED else firing,
            _with_ranges(firing, possible) if changed & LESS_POSSIBLE else firing,
        )

    def _between_sound(self, heard: CrossPaths) -> CrossPaths:
        """Return the cross paths without those of sensors that have a fault; what a silent one hears is real."""
        faulty = (self._sensors["faults"] & ~(SILENT | AT_MAXIMUM)) != 0
        sound = ~(faulty[heard.transmitters] | faulty[heard.listeners])
        return CrossPaths(heard.transmitters[sound], heard.listeners[sound], heard.half_paths_m[sound])

    def mask_stuck(self, sensor: int | None) -> None:
        """Mask a sensor, if any, that repeats a reading against the robot's motion, until it reads something else."""
        if sensor is None:
            return
        one = self._sensor_records[sensor]
        one.faults |= STUCK
        one.stuck_m, one.off_stuck = one.last_m, 0
        self.changes += 1

    def set_firing_pattern(self, ring: RingConfig) -> None:
        """Expect another firing pattern of the same sensors."""
        self._expected[:] = fires(ring)
        self._sensors["missed"] = 0

    def reset(self) -> None:
        """Start again after the odometry was reset; known faults stay."""
        for name in ("readings", "run_length", "missed"):
            self._sensors[name] = 0

    def reports(self) -> tuple[SensorReport, ...]:
        """Return a report on each faulty sensor, in the order of the sensors."""
        return tuple(self._report(i) for i in np.flatnonzero(self._sensors["faults"]).tolist())

    def _report(self, i: int) -> SensorReport:
        one, partners = self._sensors[i], self._crosstalk_partners(i)
        misses = miss_share(self._sensor_records[i], self._ring_records[0])
        return describe_fault(i, int(one["faults"]), float(one["stuck_m"]), partners, int(one["deaf_looks"]), misses)

    def _crosstalk_partners(self, i: int) -> list[int]:
        """Return the sensors that fire in the sets in which sensor `i` is masked."""
        fired = self._sets[self._sensors["is_crossed"][i] == 1].any(axis=0)
        return [int(k) for k in np.flatnonzero(fired) if k != i]


def _with_ranges(firing: Firing, ranges: Floats) -> Firing:
    return replace(firing, ranges_m=ranges.copy())
