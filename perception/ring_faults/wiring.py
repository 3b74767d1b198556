"""The test of whether two sensors are exchanged, or one looks backwards: the others heard what it hears elsewhere.

While the robot turns, a sensor looks where others looked from the same place a moment ago. What it hears is compared
with what they heard in the direction that the robot file gives it, and in the one that it would have in the place of
another sensor, or turned by half a circle. Only looks for which both are known count, so silence and round rooms say
nothing. As for the tests of `perception.ring_faults.motion_tests`, logarithms of likelihood ratios are summed.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from config.robot import BY_HAND_MAX
from perception.kernel import Floats, Ints, entry_kernel, kernel
from perception.ring_faults.memory import NO_ECHO_M, Reception
from perception.sensor_faults.wall import NOISE_SHARE
from perception.sensor_mounts import RingPose

SENSORS_MAX: Final = BY_HAND_MAX
"""Greatest ring that is tested: the work grows with the third power of its sensors."""
LOOKS: Final = 32
"""Looks of each sensor that are kept, a quarter of the beam apart or more: a turn by 240° of beams of 30°."""
LATER: Final = 8
"""A look is judged after so many later ones: others have looked there before it, or since."""
LOOK_FIELDS: Final = 4
"""The ring's direction (rad) and place x, y (m), and the reading, m; below zero without an echo."""
LOOKS_PLACE_M: Final = 0.15
"""Looks from places that are no farther apart are compared, m."""
AXIS_SHARE: Final = 0.35
"""Looks whose axes differ by no more than this share of half the beam are compared."""
TURN_AXIS_SHARE: Final = 0.5
"""The same for a whole turn, whose looks are half a beam apart or little more: so almost every one has another
sensor's beside it. With .35 those of three sensors 25° apart fell between each other's: 16 of 24 exchanges were
named, and 24 with this."""
HEARD_ALIKE_M: Final = 0.08
"""Echoes from such places that differ by no more are of the same object, m."""
AGREES: Final = 0.45
"""Of an honest sensor's looks where another heard an echo, the share that hears the same."""
SILENT_WHERE_HEARD: Final = 0.3
"""Of these looks the share that hears none."""
SILENT_TOO: Final = 0.75
"""Of an honest sensor's looks where another heard no echo, the share that hears none. In eight drives of a minute, of
four robots, it was .91 of 1,958; and the two above were .83 and .11 of 1,459. They are taken for less, as looks in
succession are alike."""


class Wiring(NamedTuple):
    """What is remembered of how the sensors are wired."""

    looks: Floats
    """(n, LOOKS, LOOK_FIELDS): the last looks of each sensor, the oldest overwritten first."""
    counts: Ints
    """(n,): looks of each sensor so far."""
    exchanged_nat: Floats
    """(n, n): evidence that sensors i < j are exchanged, and for i = j that the sensor looks backwards, nat."""


DEAF: Final = 0.97
"""Share of a deaf sensor's looks that are silent; others are strays."""


@kernel
def density(r: float, heard: float, reach: float) -> float:
    """Return the density of a reading where another sensor heard an echo, 1/m; of a silence the probability.

    Parameters
    ----------
    r, heard : float
        The reading, and the other's, m; below zero without an echo.
    reach : float
        Range up to which the ring listens, m.
    """
    if heard < 0.0:
        return SILENT_TOO if r < 0.0 else (1.0 - SILENT_TOO) / reach
    if r < 0.0:
        return SILENT_WHERE_HEARD
    same = HEARD_ALIKE_M + NOISE_SHARE * heard
    return (1.0 - AGREES - SILENT_WHERE_HEARD) / reach + (AGREES / (2.0 * same) if abs(r - heard) <= same else 0.0)


@kernel
def heard_there(i: int, j: int, axis: float, off: float, count: int, near: Floats) -> float:
    """Return how far from the middle a sensor other than `i` and `j` heard something, m; NaN if none looked there.

    Below zero without an echo.

    Parameters
    ----------
    i, j : int
        The sensors that are left out.
    axis : float
        The direction, rad, from 0 to 2π as those of `near`.
    off : float
        Angle by which the other's axis may differ, rad.
    count : int
        Number of looks in `near`.
    near : (…, 3) float
        Sensor, axis (rad) and distance of each look from about this place.
    """
    heard, nearest = math.nan, off
    for n in range(count):
        away = abs(near[n, 1] - axis)
        away = min(away, math.tau - away)
        if away <= nearest and near[n, 0] not in (i, j):
            heard, nearest = near[n, 2], away
    return heard


@kernel
def along_axis(mounts: Floats, k: int) -> float:
    """Return how far sensor `k` lies from the middle along its axis, m."""
    return float(mounts[k, 0] * math.cos(mounts[k, 2]) + mounts[k, 1] * math.sin(mounts[k, 2]))


@kernel
def beyond(r: float, offset: float) -> float:
    """Return how far from the middle an echo is, m, of a sensor so far along its axis; below zero for silence."""
    return r + offset if r >= 0.0 else NO_ECHO_M


@kernel
def find_near(i: int, judged: Floats, mounts: Floats, wiring: Wiring, near: Floats) -> int:
    """Enter the looks of the other sensors from about the place of a look of sensor `i`; return how many there are.

    A sensor that heard nothing in any of its looks may be deaf: it is no witness.

    Parameters
    ----------
    i : int
        The sensor.
    judged : (LOOK_FIELDS,) float
        Its look.
    mounts, wiring, near
        As for `weigh_wiring`.
    """
    count, size = 0, wiring.looks.shape[1]
    for k in range(wiring.looks.shape[0]):
        offset, seen = along_axis(mounts, k), min(wiring.counts[k], size)
        hears = False
        for m in range(seen):
            hears = hears or (k != i and wiring.looks[k, m, 3] >= 0.0)
        for m in range(seen):
            look = wiring.looks[k, m]
            if hears and math.hypot(look[1] - judged[1], look[2] - judged[2]) <= LOOKS_PLACE_M:
                near[count, 0], near[count, 1] = k, (look[0] + mounts[k, 2]) % math.tau
                near[count, 2] = beyond(look[3], offset)
                count += 1
    return count


@kernel
def weigh_place(
    i: int, j: int, judged: Floats, mounts: Floats, off: float, reach: float, count: int, near: Floats
) -> float:
    """Return the evidence of a look that sensor `i` is in the place of `j`, or looks backwards if it is `j`, nat.

    It is 0 unless others looked in both directions.

    Parameters
    ----------
    i, j, judged, off, count, near
        As of `find_near` and `heard_there`.
    mounts : (n, 3) float
        As for `motion_tests.check_motion`.
    reach : float
        Range up to which the ring listens, m.
    """
    own, towards, r = along_axis(mounts, i), judged[0], judged[3]
    mounted = heard_there(i, j, (towards + mounts[i, 2]) % math.tau, off, count, near)
    other, axis = -own, towards + mounts[i, 2] + math.pi
    if i != j:
        other, axis = along_axis(mounts, j), towards + mounts[j, 2]
    there = heard_there(i, j, axis % math.tau, off, count, near)
    if math.isnan(mounted + there):
        return 0.0
    return math.log(density(beyond(r, other), there, reach) / density(beyond(r, own), mounted, reach))


@kernel
def weigh_turn(mounts: Floats, reception: Reception, wiring: Wiring, near: Floats, nats: Floats) -> None:
    """Weigh the looks of a whole turn in place, each against all the others.

    Parameters
    ----------
    mounts, reception
        As for `motion_tests.check_motion`.
    wiring, near
        As for `weigh_wiring`.
    nats : (n, n + 1) float
        Out: evidence that sensors i < j are exchanged, for i = j that the sensor looks backwards, and for j = n that
        it is deaf, nat.
    """
    reach, off = reception[2], TURN_AXIS_SHARE * reception[0]
    n, size = wiring.looks.shape[0], wiring.looks.shape[1]
    nats[:] = 0.0
    for i in range(n):
        own = along_axis(mounts, i)
        for m in range(min(wiring.counts[i], size)):
            judged = wiring.looks[i, m]
            count = find_near(i, judged, mounts, wiring, near)
            for j in range(n):
                nats[min(i, j), max(i, j)] += weigh_place(i, j, judged, mounts, off, reach, count, near)
            axis = (judged[0] + mounts[i, 2]) % math.tau
            mounted = heard_there(i, i, axis, off, count, near)
            if mounted >= 0.0 or (judged[3] >= 0.0 and not math.isnan(mounted)):  # where all are silent, it may hear
                deaf = DEAF if judged[3] < 0.0 else (1.0 - DEAF) / reach
                nats[i, n] += math.log(deaf / density(beyond(judged[3], own), mounted, reach))


@entry_kernel
def weigh_wiring(
    ranges: Floats, pose: RingPose, mounts: Floats, reception: Reception, wiring: Wiring, near: Floats, most: float
) -> int:
    """Weigh the readings of a firing; return i·n + j for sensors i and j that are exchanged, i = j for one backwards.

    Returns −1 where nothing is found. A sensor's next look counts when it has turned by a quarter of the beam.

    Parameters
    ----------
    ranges, pose, mounts, reception
        As for `motion_tests.check_motion`.
    wiring : Wiring
        What is remembered. Updated.
    near : (n·LOOKS, 3) float
        Overwritten.
    most : float
        Evidence that suffices, nat.
    """
    x, y, yaw = pose
    half_angle, tolerance, reach = reception
    looks, counts, exchanged_nat = wiring
    n, size, found = looks.shape[0], looks.shape[1], -1
    for i in range(n):
        if math.isnan(ranges[i]) or not math.isfinite(x + y + yaw):
            continue
        last = looks[i, (counts[i] - 1) % size]
        if counts[i] > 0 and (abs(yaw - last[0]) < 0.5 * half_angle or ranges[i] == last[3]):  # stuck ones agree
            continue
        new = looks[i, counts[i] % size]
        new[0], new[1], new[2] = yaw, x, y
        new[3] = ranges[i] if ranges[i] < reach - tolerance else NO_ECHO_M
        counts[i] += 1
        if counts[i] <= LATER:
            continue
        judged = looks[i, (counts[i] - 1 - LATER) % size]
        count = find_near(i, judged, mounts, wiring, near)
        for j in range(n):
            first, second = min(i, j), max(i, j)
            nats = weigh_place(i, j, judged, mounts, AXIS_SHARE * half_angle, reach, count, near)
            exchanged_nat[first, second] = max(-most, exchanged_nat[first, second] + nats)
            if exchanged_nat[first, second] >= most:
                found = first * n + second
    if found >= 0:
        exchanged_nat[:] = 0.0
    return found
