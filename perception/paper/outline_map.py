"""The outline map: the paper's raw map of segments (§3.3). Old and contradicted segments leave it.

Segments are kept in order of arrival in a ring buffer of fixed capacity, so that ageing moves the tail and a new
segment always costs the same. A pinned segment does not leave: when it reaches the tail it moves to the head.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from config.settings import MapConfig
from drivers.messages import Firing
from perception.bounds import CONSTANT, COUNT, PLACE, bounds, index_of, up_to
from perception.edits import Segments
from perception.kernel import Floats, Ints, kernel
from perception.paper.parameters import PINNED_SHARE_MAX
from perception.sensor_mounts import RingPose, mounts_at, ring_pose, sensor_pose

EMPTY, PRESENT, PINNED = range(3)
"""Values of `OutlineMap.status`."""


@kernel
def erase_contradicted(
    segments: Floats,
    status: Ints,
    start: int,
    count: int,
    ranges: Floats,
    mounts: Floats,
    pose: RingPose,
    half_angle: float,
    margin: float,
) -> int:
    """Remove segments that a sensor faced squarely while its echo came from behind them; return their number.

    A sensor faces a segment squarely if the foot of its perpendicular lies on the segment and inside the beam: only
    then the segment, if it existed, would have returned the first echo.

    Parameters
    ----------
    segments : (capacity, 5) float
        End points x1, y1, x2, y2 (m), direction of the normal (rad).
    status : (capacity,) int
        `PRESENT` for a segment that may be contradicted. Updated.
    start, count : int
        Oldest slot and number of slots in use, circular.
    ranges, mounts, pose, half_angle
        The firing, as in `perception.paper.segments.pair_readings`.
    margin : float
        By how much farther than the segment the echo must be, m.

    Returns
    -------
    int
        How many were removed.
    """
    capacity = segments.shape[0]
    erased = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not math.isfinite(r):
            continue
        x, y, axis = sensor_pose(mounts, i, pose)
        ax, ay = math.cos(axis), math.sin(axis)
        cos_half = math.cos(half_angle)
        for k in range(count):
            slot = (start + k) % capacity
            if status[slot] != PRESENT:
                continue
            x1, y1, x2, y2 = segments[slot, 0], segments[slot, 1], segments[slot, 2], segments[slot, 3]
            ex = x2 - x1
            ey = y2 - y1
            length2 = ex * ex + ey * ey
            if length2 == 0.0:
                continue
            along = ((x - x1) * ex + (y - y1) * ey) / length2
            if along < 0.0 or along > 1.0:
                continue
            fx = x1 + along * ex - x
            fy = y1 + along * ey - y
            distance = math.hypot(fx, fy)
            if distance < r - margin and fx * ax + fy * ay >= distance * cos_half:
                status[slot] = EMPTY
                erased += 1
    return erased


class OutlineMap:
    """Outline segments in order of arrival, in preallocated arrays.

    Parameters
    ----------
    config : MapConfig
        Capacity, age limit and the margin of a contradiction.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame, for contradictions.
    half_angle : float
        Half the beam's width, rad.
    turning : tuple of int
        The sensors that turn with the wheels, as `config.robot.RingConfig.turning`.
    """

    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _half_angle=CONSTANT,
        segments=PLACE,
        times=PLACE,
        status=up_to(PINNED),
        numbers=COUNT,
        pinned=lambda self: up_to(int(PINNED_SHARE_MAX * len(self.times))),
        start=lambda self: index_of(len(self.times)),
        count=lambda self: up_to(len(self.times)),
        total=COUNT,
    )

    def __init__(self, config: MapConfig, mounts: Floats, half_angle: float, turning: tuple[int, ...] = ()) -> None:
        self._config = config
        self._mounts, self._turning = mounts, turning
        self._half_angle = half_angle
        self.segments = np.zeros((config.capacity, 5))
        """(capacity, 5): end points x1, y1, x2, y2 (m) and direction of the normal (rad), away from the sensors."""
        self.times = np.zeros(config.capacity)
        """(capacity,): when each segment was completed, s."""
        self.status = np.zeros(config.capacity, dtype=np.int64)
        """(capacity,): `EMPTY`, `PRESENT` or `PINNED`."""
        self.numbers = np.zeros(config.capacity, dtype=np.int64)
        """(capacity,): each segment's number; numbers are never reused."""
        self.pinned = 0
        """Pinned segments."""
        self.start = 0
        self.count = 0
        """Oldest slot in use, and the number of slots in use, empty ones included."""
        self.total = 0
        """Segments ever added."""

    def contradiction(self) -> str | None:
        """Return why removing the oldest segments would never end, None if it does."""
        held = int(np.count_nonzero(self.status == PINNED))
        return None if self.pinned == held else f"pinned is {self.pinned}, but {held} segments are pinned"

    @property
    def size(self) -> int:
        """Segments in the map."""
        return int(np.count_nonzero(self.status))

    def add(self, segments: Floats, t: float) -> None:
        """Add segments of shape (m, 5), completed at `t` (s); if the map is full, the oldest are removed."""
        capacity = len(self.times)
        for row in segments:
            while self.count == capacity:
                self._pop_oldest()
            self.total += 1
            self._append(row, t, PRESENT, self.total)

    def age(self, t: float) -> bool:
        """Remove segments that are older than the age limit at time `t` (s); return whether any slot changed."""
        start = self.start
        while self.count > self.pinned:  # otherwise pinned segments would rotate forever
            if self.status[self.start] and t - self.times[self.start] <= self._config.age_max_s:
                break
            self._pop_oldest()
        return self.start != start

    def delete(self, numbers: Collection[int]) -> set[int]:
        """Remove segments; return the numbers that are not in the map."""
        slots = self._slots_of(numbers)
        self.pinned -= int(np.count_nonzero(self.status[slots] == PINNED))
        self.status[slots] = EMPTY
        return set(numbers) - set(self.numbers[slots].tolist())

    def pin(self, numbers: Collection[int], *, pinned: bool) -> set[int] | None:
        """Pin or unpin segments; return the numbers that are not in the map, None if too many would be pinned."""
        slots = self._slots_of(numbers)
        others = self.pinned - int(np.count_nonzero(self.status[slots] == PINNED))
        if pinned and others + len(slots) > int(PINNED_SHARE_MAX * len(self.times)):
            return None
        self.status[slots] = PINNED if pinned else PRESENT
        self.pinned = others + (len(slots) if pinned else 0)
        missing = set(numbers) - set(self.numbers[slots].tolist())
        if not pinned:
            self._sort()
        return missing

    def restore(self, rows: Sequence[Sequence[float]]) -> str | None:
        """Put deleted segments back in the order of their arrival; return None, or why that is impossible.

        Parameters
        ----------
        rows : sequence of sequence of float
            As of `edits.RestoreSegments`; finite. Those that are in the map are left as they are.
        """
        present = set(self.numbers[self.status > EMPTY].tolist())
        back = list({int(row[0]): row for row in rows if int(row[0]) not in present}.values())
        if any(row[0] > self.total for row in back):
            return "no segment ever had such a number"
        pins = sum(row[7] == 1.0 for row in back)
        if self.size + len(back) > len(self.times) or self.pinned + pins > int(PINNED_SHARE_MAX * len(self.times)):
            return f"the map has no room for {len(back)} further segments"
        self._sort()
        for number, x1, y1, x2, y2, normal, time_s, pinned in back:
            status = PINNED if pinned == 1.0 else PRESENT
            self._append(np.array([x1, y1, x2, y2, normal]), time_s, status, int(number))
        self.pinned += pins
        self._sort()
        return None

    def listed(self) -> Segments:
        """Return the segments in the map."""
        present = self.status > EMPTY
        return Segments(
            self.numbers[present],
            self.segments[present],
            self.times[present],
            (self.status[present] == PINNED).astype(np.int64),
        )

    def apply_settings(self, config: MapConfig) -> None:
        """Use another age limit and margin; the capacity stays."""
        self._config = config

    def remove_contradicted(self, firing: Firing) -> int:
        """Remove segments behind which `firing` heard an echo; return how many."""
        return erase_contradicted(
            self.segments,
            self.status,
            self.start,
            self.count,
            firing.ranges_m,
            mounts_at(firing, self._mounts, self._turning),
            ring_pose(firing),
            self._half_angle,
            self._config.contradiction_margin_m,
        )

    def clear(self) -> None:
        """Remove every segment."""
        self.status[:] = EMPTY
        self.start = 0
        self.count = 0
        self.pinned = 0

    def _append(self, row: Floats, t: float, status: int, number: int) -> None:
        """Put a segment at the head."""
        slot = (self.start + self.count) % len(self.times)
        self.segments[slot] = row
        self.times[slot] = t
        self.status[slot] = status
        self.numbers[slot] = number
        self.count += 1

    def _pop_oldest(self) -> None:
        """Free the tail's slot; a pinned segment moves to the head."""
        tail = self.start
        status, self.status[tail] = self.status[tail], EMPTY
        self.start = (tail + 1) % len(self.times)
        self.count -= 1
        if status == PINNED:
            self._append(self.segments[tail], float(self.times[tail]), PINNED, int(self.numbers[tail]))

    def _slots_of(self, numbers: Collection[int]) -> Ints:
        """Return the slots that hold segments of these numbers."""
        wanted = np.array(sorted(numbers), np.int64)
        return np.flatnonzero((self.status > EMPTY) & np.isin(self.numbers, wanted))

    def _sort(self) -> None:
        """Restore the order of arrival, which pinned segments have left by moving to the head."""
        slots = np.flatnonzero(self.status > EMPTY)
        slots = slots[np.argsort(self.numbers[slots])]
        for array in (self.segments, self.times, self.status, self.numbers):
            array[: len(slots)] = array[slots]
        self.status[len(slots) :] = EMPTY
        self.start, self.count = 0, len(slots)
