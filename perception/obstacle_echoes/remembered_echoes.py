"""Steady echoes of the last seconds, wherever they were heard: the robot must not drive fast at what it heard before.

A robot that turns looks with other sensors at what it heard, and a robot that comes back looks again. Where those
sensors have heard nothing since, nothing shows that they hear: their silence contradicts no echo. An echo from its
place or from behind it does, and so does the silence of a sensor that has heard something since, or that of the very
sensor, twice, while the ring stands as it stood: what was there has left.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Pose
from perception.bounds import CONSTANT, Flag, Place, bounds, index_of
from perception.kernel import Floats, Ints, entry_kernel, kernel
from perception.records import Record, Records, records, zeros
from perception.sensor_mounts import RingPose, SensorPose, sensor_pose

REMEMBERED_S: Final = 30.0
"""An echo is remembered for so long, s: a robot that turns away from what it hears is back at it within that."""
HEARS_S: Final = 1.5
"""A sensor that has heard something so much later than an echo hears, s. With this, ten drives in which all ahead had
fallen silent, or nine of ten readings, and something had been touched, end without a contact."""
REMEMBERED_PLACES: Final = 64
"""Echoes that are remembered; the oldest makes room. In furnished rooms rings of 16 to 24 sensors keep up to 40."""
ONE_PLACE_M: Final = 0.1
"""Echoes that are nearer to each other are one, m. With 0.3, two of those ten drives touch something."""
HAS_MOVED_M: Final = 1e-3
"""What is nearer or farther by this since a sensor looked last, or beside where it was, has moved, m."""


class RememberedEcho(Record):
    """One echo."""

    is_kept: Flag
    t: Place
    """When it was heard last, s."""
    x: Place
    """Its place, m."""
    y: Place
    sensor: Annotated[int, index_of(256)]
    """What heard it last, on its axis."""
    range_m: Place
    """How far from there, m."""


class LastHeard(Record):
    """When one sensor heard its last echoes; of one on a servo `is_echo` is that of a bearing."""

    is_echo: Flag
    """Whether its last look there heard an echo."""
    t: Place
    """When it last heard two in succession, s, 0 for never: a single one may be random, or all that a broken sensor
    hears."""


@kernel
def enter_echo(i: int, r: float, sensor: SensorPose, t: float, echoes: Records[RememberedEcho]) -> None:
    """Enter an echo of sensor `i` at a range, m, heard from where it was at a time, s; the oldest one makes room."""
    free = 0
    for k in range(len(echoes)):
        if not echoes[k].is_kept:
            free = k
            break
        if echoes[k].t < echoes[free].t:
            free = k
    one, (x, y, axis) = echoes[free], sensor
    one.is_kept, one.t, one.sensor, one.range_m = 1, t, i, r
    one.x, one.y = x + r * math.cos(axis), y + r * math.sin(axis)


@kernel
def contradict_remembered(
    i: int,
    r: float,
    sensor: SensorPose,
    hears_s: float,
    reach: float,
    slope: float,
    echoes: Records[RememberedEcho],
) -> None:
    """Forget the echoes that a reading contradicts.

    Parameters
    ----------
    i : int
        The sensor; −1 if it has just fallen silent, as of an echo that it misses now and then.
    r : float
        Its reading, m.
    sensor : SensorPose
        Where it was.
    hears_s : float
        Its silence contradicts what was heard before this, s.
    reach : float
        Up to which it hears, m.
    slope : float
        Tangent of the angle from its axis within which it hears.
    echoes
        As for `remember`. Updated.
    """
    x, y, axis = sensor
    c, s = math.cos(axis), math.sin(axis)
    for k in range(len(echoes)):
        one = echoes[k]
        dx, dy = one.x - x, one.y - y
        ahead, across = dx * c + dy * s, abs(dy * c - dx * s)
        if not one.is_kept or ahead <= 0.0:
            continue
        is_seen = ahead < min(r, reach) and across < ahead * slope
        if r < reach:
            is_over = is_seen or (abs(ahead - r) < ONE_PLACE_M and across < ONE_PLACE_M)
        else:
            has_left = one.sensor == i and abs(ahead - one.range_m) < HAS_MOVED_M and across < HAS_MOVED_M
            is_over = has_left or (is_seen and one.t < hears_s)
        if is_over:
            one.is_kept = 0


@entry_kernel
def remember(
    ranges: Floats,
    mounts: Floats,
    pose: RingPose,
    t: float,
    reception: tuple[float, float, float],
    agreed: NDArray[np.bool_],
    sensor_of: Ints,
    echoes: Records[RememberedEcho],
    last_heard: Records[LastHeard],
) -> None:
    """Enter the readings of a firing.

    Parameters
    ----------
    ranges, mounts, pose, t, agreed
        As in `fresh_echoes.record_echoes`; only echoes with which another look agrees count.
    reception : (float, float, float)
        A sensor hears what is so near to its axis, rad, and up to so far away, m; radius of the ring, m.
    sensor_of : (n,) int
        As `config.robot.RingConfig.sensor_of`.
    echoes : (REMEMBERED_PLACES,) records
        The echoes. Updated.
    last_heard : (n,) records
        Of each sensor. Updated.
    """
    core, reach, radius = reception
    x, y, _ = pose
    for k in range(len(echoes)):
        one = echoes[k]
        one.t = min(one.t, t)  # the robot's clock may leap back
        if one.t < t - REMEMBERED_S or math.hypot(one.x - x, one.y - y) < radius:
            one.is_kept = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if math.isnan(r):
            continue
        own, is_echo = last_heard[sensor_of[i]], r < reach
        again = last_heard[i].is_echo == is_echo
        last_heard[i].is_echo = 1 if is_echo else 0
        own.t = t if is_echo and again else min(own.t, t)
        if is_echo and not agreed[i]:
            continue
        sensor = sensor_pose(mounts, i, pose)
        contradict_remembered(i if again else -1, r, sensor, own.t - HEARS_S, reach, math.tan(core), echoes)
        if is_echo:
            enter_echo(i, r, sensor, t, echoes)


@kernel
def find_ahead(pose: RingPose, half_width: float, echoes: Records[RememberedEcho], found: Floats) -> int:
    """Find the echoes ahead; return how many there are.

    Parameters
    ----------
    pose : RingPose
        The robot's, m and rad, turned into the direction in which it drives.
    half_width : float
        Half the width of the way ahead, m.
    echoes
        As for `remember`.
    found : (REMEMBERED_PLACES, 2) float
        The first ones are the places, m. Overwritten.
    """
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    count = 0
    for k in range(len(echoes)):
        dx, dy = echoes[k].x - x, echoes[k].y - y
        if echoes[k].is_kept and c * dx + s * dy > 0.0 and abs(c * dy - s * dx) < half_width:
            found[count, 0], found[count, 1] = echoes[k].x, echoes[k].y
            count += 1
    return count


class RememberedEchoes:
    """What a ring has heard in the last seconds.

    Parameters
    ----------
    sensor_of : tuple of int
        As `config.robot.RingConfig.sensor_of`.
    """

    SCRATCH: Final = ("_echo_records", "_heard_records")
    """Not part of a snapshot: views of arrays that are."""
    BOUNDS: Final = bounds(_sensor_of=CONSTANT, _echoes=RememberedEcho.BOUNDS, _heard=LastHeard.BOUNDS)

    def __init__(self, sensor_of: tuple[int, ...]) -> None:
        self._sensor_of = np.array(sensor_of, np.int64)
        self._echoes, self._heard = zeros(RememberedEcho, REMEMBERED_PLACES), zeros(LastHeard, len(sensor_of))
        self._echo_records, self._heard_records = (
            records(RememberedEcho, self._echoes),
            records(LastHeard, self._heard),
        )

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
        of = (self._sensor_of, self._echo_records, self._heard_records)
        remember(ranges_m, mounts, pose, robot_s, reception, agreed, *of)

    def ahead(self, pose: Pose, half_width_m: float) -> Floats:
        """Return the places within the way ahead, shape (k, 2), m."""
        found = np.empty((REMEMBERED_PLACES, 2))
        place = (float(pose.x), float(pose.y), float(pose.theta))
        return found[: find_ahead(place, half_width_m, self._echo_records, found)]

    def clear(self) -> None:
        """Forget all echoes, and what has heard."""
        self._echoes[...] = np.zeros((), self._echoes.dtype)
        self._heard[...] = np.zeros((), self._heard.dtype)
