"""Echoes that fell silent as the robot came nearer: they stay obstacles until something contradicts them.

What a sensor heard stands where it was heard, and comes nearer as the robot does. A mirror may leave the beam, and a
sensor may have failed, or not hear what is near: the robot must not drive fast at what it heard before. One such echo
of each sensor is kept, the nearest. It is dropped when a sensor that looks there hears it again, or something behind
it; when the ring hears, and is farther from it than where it was lost, so that it could have heard it again; and when
the ring stands on it. Echoes of the same surface in other directions contradict nothing. What falls silent before a
robot that stands has left, and is not kept.

While no sensor hears anything, the ring itself may have failed: several echoes that are lost in such a silence are
kept, even if the robot stood or turned on the spot. A sensor that has moved, if only as the ring turns, and repeats
its reading to the bit may not have heard it, so it does not end such a silence: some sensors of a frozen ring repeat
an echo, others silence.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Pose
from perception.bounds import COUNT, PLACE, Flag, Place, bounds, index_of
from perception.kernel import Floats, Ints, entry_kernel, kernel
from perception.obstacle_echoes.blind_walls import TURN_DIRECTIONS, WIDTH_RAD, BlindWalls, middle_walls
from perception.obstacle_echoes.remembered_echoes import HAS_MOVED_M, RememberedEchoes
from perception.records import Record, Records, records, zeros
from perception.sensor_mounts import RingPose, SensorPose, sensor_pose
from perception.shared_numbers import SAME_ECHO_M

AWAY_M: Final = 0.1
"""A robot that is farther from an echo by this than where it was lost has had the chance to hear it again, m."""
SILENT_ROUNDS: Final = 4
"""A ring has fallen silent if it has heard nothing for so many looks of each sensor."""

SUDDEN_MIN: Final = 3
"""So many sensors do not lose their echoes between two echoes of the whole ring, unless it has failed."""

CLOSING_MIN: Final = 0.05
"""A robot that comes nearer to a wall by less than this share of its way drives along it."""

NOT_KEPT, LEFT, KEPT, ALONE = range(4)
"""Of a sensor's echo: none is kept; one was lost that was random or before which the robot stood, and the ring has
heard nothing new since; one is kept; and one is kept and the ring has heard nothing new since."""
SILENT, UNCHANGED = range(2)
"""Looks that are counted: since the ring last heard anything, and since it last heard anything new."""


class UnheardEcho(Record):
    """What is remembered of one sensor."""

    ring_x: Place
    """Place of the ring when the sensor looked last, m."""
    ring_y: Place
    yaw: Place
    """Direction of the ring then, rad."""
    range_m: Place
    """What the sensor heard then, m; below zero for nothing."""
    state: Annotated[int, index_of(4)]
    """`NOT_KEPT`, `LEFT`, `KEPT` or `ALONE`."""
    x: Place
    """Place of the echo, m."""
    y: Place
    lost_m: Place
    """How far the ring was from it when it was lost, m."""
    is_steady: Flag
    """Whether another look agreed with it: else it may have been random."""


@kernel
def lose_echo(c: UnheardEcho, px: float, py: float, is_steady: bool, x: float, y: float) -> None:
    """Keep an echo at a place where the sensor hears nothing, for good if it was steady and the ring came nearer.

    Parameters
    ----------
    c : record
        What is remembered of the sensor. Updated.
    px, py : float
        Place of the echo, m.
    is_steady : bool
        Whether another look agreed with it.
    x, y : float
        Place of the ring, m.
    """
    now = math.hypot(px - x, py - y)
    state = ALONE if is_steady and now < math.hypot(px - c.ring_x, py - c.ring_y) - HAS_MOVED_M else LEFT
    if c.state < KEPT or (state == ALONE and now < math.hypot(c.x - x, c.y - y)):
        c.state, c.x, c.y, c.lost_m = state, px, py, now
        c.is_steady = 1 if is_steady else 0


@kernel
def reaches(r: float, sensor: SensorPose, core: float, one: UnheardEcho) -> bool:
    """Return whether a sensor heard an echo from where a lost one stands, or from behind it.

    Parameters
    ----------
    r : float
        The range that it heard, m.
    sensor : SensorPose
        Where it was.
    core
        As in `contradict_echoes`.
    one : record
        The lost echo.
    """
    x, y, axis = sensor
    dx, dy, c, s = one.x - x, one.y - y, math.cos(axis), math.sin(axis)
    ahead, across = dx * c + dy * s, abs(dy * c - dx * s)
    return bool(0.0 < ahead < r + SAME_ECHO_M and across < ahead * math.tan(core))


@entry_kernel
def contradict_echoes(
    ranges: Floats,
    mounts: Floats,
    pose: RingPose,
    core: float,
    reach: float,
    radius: float,
    agreed: NDArray[np.bool_],
    echoes: Records[UnheardEcho],
    silences: Ints,
) -> None:
    """Drop the echoes that a firing contradicts, after `lose_echo`.

    Parameters
    ----------
    ranges, mounts, pose, reach
        As in `fresh_echoes.record_echoes`.
    core : float
        A sensor whose axis is this near to the direction of a place would have heard it, rad.
    radius : float
        The ring's, m.
    agreed : (n,) bool
        Whether another look agrees with the sensor's echo in this firing: a random one contradicts nothing.
    echoes : (n,) records
        What is remembered of each sensor. Updated.
    silences : (2,) int
        Looks since the ring last heard anything, and since it heard anything new. Updated.
    """
    x, y, yaw = pose
    kept = 0
    hears = False
    is_new = False
    for i in range(ranges.shape[0]):
        one = echoes[i]
        if not math.isnan(ranges[i]):
            r = ranges[i] if ranges[i] < reach else -1.0
            turned = math.hypot(mounts[i, 0], mounts[i, 1]) * abs(yaw - one.yaw)
            has_moved = math.hypot(one.ring_x - x, one.ring_y - y) + turned > HAS_MOVED_M
            silences[SILENT] += 1
            silences[UNCHANGED] += 1
            hears |= r >= 0.0
            is_new = is_new or (r >= 0.0 and (r != one.range_m or not has_moved))
            one.ring_x, one.ring_y, one.yaw, one.range_m = x, y, yaw, r
        kept += one.state != NOT_KEPT
    if hears:
        silences[SILENT] = 0
    if is_new:
        silences[UNCHANGED] = 0
    if kept == 0:
        return
    for k in range(ranges.shape[0]):
        one = echoes[k]
        if one.state == NOT_KEPT:
            continue
        away = math.hypot(one.x - x, one.y - y)
        if away < radius:
            one.state = NOT_KEPT
            continue
        if not is_new:  # nor has it had the chance to hear the echo again
            continue
        if away > one.lost_m + AWAY_M:
            one.state = NOT_KEPT
            continue
        one.state = KEPT if one.state >= KEPT else NOT_KEPT
        for i in range(ranges.shape[0]):
            if ranges[i] < reach and agreed[i] and reaches(ranges[i], sensor_pose(mounts, i, pose), core, one):
                one.state = NOT_KEPT
                break


@kernel
def keep_sudden(
    points: Floats,
    times: Floats,
    heard: NDArray[np.bool_],
    steady: NDArray[np.bool_],
    since: float,
    x: float,
    y: float,
    echoes: Records[UnheardEcho],
) -> None:
    """Keep what a ring that hears nothing heard a moment ago, if that is too much to have left at once.

    Parameters
    ----------
    points, times : (n, looks, 2), (n, looks) float
        As in `fresh_echoes.record_echoes`.
    heard : (n, looks) bool
        Whether it is an echo that no look has removed.
    steady : (n, looks) bool
        Whether another look agreed with it.
    since : float
        Older looks do not count, s; with +inf only what was lost does.
    x, y : float
        Place of the ring, m.
    echoes : (n,) records
        What is remembered of each sensor. Updated.
    """
    sudden = 0
    for turn in range(2):
        for i in range(len(echoes)):
            one = echoes[i]
            is_young = False
            for k in range(times.shape[1]):
                if heard[i, k] and times[i, k] >= since:
                    is_young = True
                    px, py = points[i, k, 0], points[i, k, 1]
                    away = math.hypot(px - x, py - y)
                    if turn == 1 and (one.state < KEPT or away < math.hypot(one.x - x, one.y - y)):
                        one.state, one.x, one.y, one.lost_m = ALONE, px, py, away
                        one.is_steady = 1 if steady[i, k] else 0
            if turn == 1 and one.state == LEFT:
                one.state = ALONE
            sudden += is_young or one.state == LEFT or one.state == ALONE
        if sudden < SUDDEN_MIN:
            return


class UnheardEchoes:
    """The echo of each sensor that it lost and that nothing has contradicted since, and what all heard lately.

    Parameters
    ----------
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    sensor_of : tuple of int
        As of `FreshEchoes`.
    """

    SCRATCH: Final = ("records", "_places", "_are_steady")
    """Not part of a snapshot: views of an array that is."""
    BOUNDS: Final = bounds(_echoes=UnheardEcho.BOUNDS, silences=COUNT, _walls_m=PLACE._replace(infinite=True))

    def __init__(self, mounts: Floats, sensor_of: tuple[int, ...] = ()) -> None:
        self._echoes = zeros(UnheardEcho, len(mounts))
        self.records = records(UnheardEcho, self._echoes)
        self._places = self._echoes[["state", "x", "y"]]
        self._are_steady = self._echoes["is_steady"]
        self.silences = np.zeros(2, np.int64)
        self._walls_m = np.full(TURN_DIRECTIONS, math.inf)
        self.remembered = RememberedEchoes(sensor_of or tuple(range(len(mounts))))

    def falls_silent(self, which: int) -> bool:
        """Return whether half of the ring's sensors have looked since it heard anything (new), and not all twice."""
        return len(self._echoes) <= 2 * int(self.silences[which]) <= 4 * len(self._echoes)

    @property
    def hears_nothing_new(self) -> bool:
        """Whether half of the ring's sensors have looked since it heard anything new."""
        return 2 * int(self.silences[UNCHANGED]) >= len(self._echoes)

    def presume_walls(self, x: float, y: float, blind_walls: BlindWalls) -> None:
        """Keep the walls that a ring at a place (m) has heard: call it when the ring begins to hear nothing new."""
        self._walls_m[:] = blind_walls.offsets(x, y)

    def presumed_way_m(self, pose: Pose, radius_m: float) -> float:
        """Return how far a disc can drive straight ahead to where a wall goes on that the ring heard last, m.

        Infinite where there is none, and while the ring hears anything new. The direction of a wall is known to that
        of its neighbours in `TURN_DIRECTIONS`, so the wall may be crossed and still count.

        Parameters
        ----------
        pose
            Of the disc, m and rad.
        radius_m
            The disc's, m.
        """
        if not self.hears_nothing_new:
            return math.inf
        directions = WIDTH_RAD * np.arange(TURN_DIRECTIONS)
        c, s = np.cos(directions), np.sin(directions)
        closing = math.cos(pose.theta) * c + math.sin(pose.theta) * s
        away = middle_walls(self._walls_m) - pose.x * c - pose.y * s
        is_ahead = (closing > CLOSING_MIN) & np.isfinite(away)
        return float((np.maximum(away - radius_m, 0.0)[is_ahead] / closing[is_ahead]).min(initial=math.inf))

    @property
    def is_ring_silent(self) -> bool:
        """Whether echoes were lost since the ring heard anything new, and half of its sensors have looked since.

        Of a ring that repeats what it hears, several must have been lost.
        """
        if not self.hears_nothing_new:
            return False
        count = len(self._echoes)
        least = 1 if 2 * int(self.silences[SILENT]) >= count else SUDDEN_MIN
        alone = [state for state, _, _ in self._places.tolist() if state == ALONE]
        return len(alone) >= least

    @property
    def has_been_silent(self) -> bool:
        """Whether the ring has heard nothing new for `SILENT_ROUNDS`."""
        return int(self.silences[UNCHANGED]) >= SILENT_ROUNDS * len(self._echoes)

    def points(self, least: int = KEPT) -> Floats:
        """Return the places of what is kept, or with `ALONE` of what was lost since the ring heard: (k, 2), m."""
        kept = [(x, y) for state, x, y in self._places.tolist() if state >= least]  # numpy's calls would take longer
        return np.array(kept, float).reshape(-1, 2)

    def take_ahead(self, pose: Pose, near_m: float, half_width_m: float) -> float | None:
        """Return how far ahead the nearest steady one of a silent ring stands, m; all lost ones are then forgotten.

        None if there is none in the robot's way so near, or if the ring has not been silent for `SILENT_ROUNDS`. Few
        sensors among mirrors are often silent for so long, and hear random echoes now and then.

        Parameters
        ----------
        pose : Pose
            The robot's, in odometry's frame.
        near_m, half_width_m : float
            Length and half the width of the way ahead, m.
        """
        if not (self.has_been_silent and self.is_ring_silent):
            return None
        dx, dy = (self.points(ALONE)[self._are_steady[self._echoes["state"] == ALONE] == 1] - (pose.x, pose.y)).T
        c, s = math.cos(pose.theta), math.sin(pose.theta)
        ahead, across = c * dx + s * dy, c * dy - s * dx
        near = ahead[(ahead > 0.0) & (ahead < near_m) & (np.abs(across) < half_width_m)]
        if not len(near):
            return None
        self._forget_lost()
        return float(near.min())

    def _forget_lost(self) -> None:
        """Forget all lost echoes and walls."""
        self._echoes["state"] = NOT_KEPT
        self._walls_m[:] = math.inf

    def clear(self) -> None:
        """Forget all echoes and walls."""
        self._forget_lost()
        self.remembered.clear()
