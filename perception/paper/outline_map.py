"""The outline map: the paper's raw map of segments (§3.3), preallocated, where the old and the wrong leave.

Segments are kept in the order in which they came, in a circle of fixed capacity, so that ageing is a step of the
tail and a new segment costs the same in the first minute and after a week. A pinned one does not leave: come to the
tail, it goes round to the head.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final

import numpy as np

from config.settings import MapConfig
from drivers.messages import Firing
from perception.edits import Segments
from perception.kernel import Floats, Ints, kernel

GONE, ALIVE, PINNED = range(3)
"""What a slot of `OutlineMap.alive` may say."""


@kernel
def erase_contradicted(
    segments: Floats,
    alive: Ints,
    start: int,
    count: int,
    ranges: Floats,
    mounts: Floats,
    pose_x: float,
    pose_y: float,
    yaw: float,
    half_angle: float,
    margin: float,
) -> int:
    """Mark segments dead that a sensor faced squarely while its echo came from behind them.

    A sensor faces a segment squarely where the foot of its perpendicular lies on the segment and inside the beam:
    only then must the segment, were it there, have answered first.

    Parameters
    ----------
    segments : (capacity, 5) float
        Ends x, y, x, y (m), normal (rad).
    alive : (capacity,) int
        1 where a slot holds a segment that may be contradicted. Updated.
    start, count : int
        Oldest slot and number of slots in use, circular.
    ranges, mounts, pose_x, pose_y, yaw, half_angle
        The firing, as in `perception.paper.segments.pair_readings`.
    margin : float
        How much farther than the segment the echo must be, m.

    Returns
    -------
    int
        How many were marked.
    """
    capacity = segments.shape[0]
    c = math.cos(yaw)
    s = math.sin(yaw)
    erased = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not math.isfinite(r):
            continue
        x = pose_x + c * mounts[i, 0] - s * mounts[i, 1]
        y = pose_y + s * mounts[i, 0] + c * mounts[i, 1]
        ax = math.cos(yaw + mounts[i, 2])
        ay = math.sin(yaw + mounts[i, 2])
        cos_half = math.cos(half_angle)
        for k in range(count):
            slot = (start + k) % capacity
            if alive[slot] != 1:
                continue
            ex = segments[slot, 2] - segments[slot, 0]
            ey = segments[slot, 3] - segments[slot, 1]
            length2 = ex * ex + ey * ey
            if length2 == 0.0:
                continue
            along = ((x - segments[slot, 0]) * ex + (y - segments[slot, 1]) * ey) / length2
            if along < 0.0 or along > 1.0:
                continue
            fx = segments[slot, 0] + along * ex - x
            fy = segments[slot, 1] + along * ey - y
            distance = math.hypot(fx, fy)
            if distance < r - margin and fx * ax + fy * ay >= distance * cos_half:
                alive[slot] = 0
                erased += 1
    return erased


class OutlineMap:
    """Outline segments by age, in preallocated arrays.

    Parameters
    ----------
    config : MapConfig
        Capacity, age limit and the margin of a contradiction.
    mounts : (n, 3) float
        Sensors of the ring, for contradictions.
    half_angle : float
        Half the beam's opening, rad.
    """

    LATER: Final = ("numbers", "pinned")
    """What recordings of older programs do not hold."""

    def __init__(self, config: MapConfig, mounts: Floats, half_angle: float) -> None:
        self._config = config
        self._mounts = mounts
        self._half_angle = half_angle
        self.segments = np.zeros((config.capacity, 5))
        """(capacity, 5): ends x, y, x, y (m) and the direction of the normal (rad)."""
        self.times = np.zeros(config.capacity)
        """(capacity,): when each segment was completed, s."""
        self.alive = np.zeros(config.capacity, dtype=np.int64)
        """(capacity,): 1 where a slot holds a segment that still counts, 2 where it is pinned."""
        self.numbers = np.zeros(config.capacity, dtype=np.int64)
        """(capacity,): by which each segment is known; none is used twice."""
        self.pinned = 0
        """Segments that are pinned."""
        self.start = 0
        """Oldest slot in use."""
        self.count = 0
        """Slots in use, dead ones included."""
        self.total = 0
        """Segments ever added."""

    @property
    def living(self) -> int:
        """Segments that count now."""
        return int(np.count_nonzero(self.alive))

    def add(self, segments: Floats, t: float) -> None:
        """Add segments of shape (m, 5), completed at `t`; the oldest make room where the map is full."""
        capacity = len(self.times)
        for row in segments:
            while self.count == capacity:
                self._drop_or_pass_on_oldest()
            self.total += 1
            self._enter(row, t, ALIVE, self.total)

    def age(self, t: float) -> bool:
        """Let segments leave that are older than the age limit at time `t`; return whether any slot changed."""
        start = self.start
        while self.count > self.pinned:  # else pinned ones would be passed round for ever
            if self.alive[self.start] and t - self.times[self.start] <= self._config.age_max_s:
                break
            self._drop_or_pass_on_oldest()
        return self.start != start

    def delete(self, numbers: Collection[int]) -> set[int]:
        """Take segments out; return the numbers that are not there."""
        slots = self._slots_of(numbers)
        self.pinned -= int(np.count_nonzero(self.alive[slots] == PINNED))
        self.alive[slots] = GONE
        return set(numbers) - set(self.numbers[slots].tolist())

    def pin(self, numbers: Collection[int], *, pinned: bool) -> set[int] | None:
        """Pin segments or let them go; return the numbers that are not there, None where so many cannot be pinned."""
        slots = self._slots_of(numbers)
        others = self.pinned - int(np.count_nonzero(self.alive[slots] == PINNED))
        if pinned and others + len(slots) > len(self.times) // 2:
            return None
        self.alive[slots] = PINNED if pinned else ALIVE
        self.pinned = others + (len(slots) if pinned else 0)
        missing = set(numbers) - set(self.numbers[slots].tolist())
        if not pinned:
            self._sort()
        return missing

    def listed(self) -> Segments:
        """Return what counts now."""
        living = self.alive > GONE
        return Segments(
            self.numbers[living],
            self.segments[living],
            self.times[living],
            (self.alive[living] == PINNED).astype(np.int64),
        )

    def restored(self) -> None:
        """Give numbers to the segments of a recording that has none: those that they got when they came."""
        if self.total > 0 and not self.numbers.any():
            slots = (self.start + np.arange(self.count)) % len(self.times)
            self.numbers[slots] = self.total - self.count + 1 + np.arange(self.count)

    def adopt(self, config: MapConfig) -> None:
        """Go on with another age limit and margin; the capacity stays."""
        self._config = config

    def contradict(self, firing: Firing) -> int:
        """Remove segments behind which `firing` heard an echo; return how many."""
        return erase_contradicted(
            self.segments, self.alive, self.start, self.count, firing.ranges_m, self._mounts,
            firing.pose.x, firing.pose.y, firing.ring_yaw, self._half_angle, self._config.contradiction_margin_m,
        )  # fmt: skip

    def clear(self) -> None:
        """Forget every segment."""
        self.alive[:] = GONE
        self.start = 0
        self.count = 0
        self.pinned = 0

    def _enter(self, row: Floats, t: float, state: int, number: int) -> None:
        """Put a segment at the head."""
        slot = (self.start + self.count) % len(self.times)
        self.segments[slot] = row
        self.times[slot] = t
        self.alive[slot] = state
        self.numbers[slot] = number
        self.count += 1

    def _drop_or_pass_on_oldest(self) -> None:
        tail = self.start
        state, self.alive[tail] = self.alive[tail], GONE
        self.start = (tail + 1) % len(self.times)
        self.count -= 1
        if state == PINNED:
            self._enter(self.segments[tail], float(self.times[tail]), PINNED, int(self.numbers[tail]))

    def _slots_of(self, numbers: Collection[int]) -> Ints:
        """Return the slots in which living segments of these numbers are."""
        wanted = np.array(sorted(numbers), np.int64)
        return np.flatnonzero((self.alive > GONE) & np.isin(self.numbers, wanted))

    def _sort(self) -> None:
        """Put living segments in the order in which they came, as those passed round are not."""
        slots = np.flatnonzero(self.alive > GONE)
        slots = slots[np.argsort(self.numbers[slots])]
        for array in (self.segments, self.times, self.alive, self.numbers):
            array[: len(slots)] = array[slots]
        self.alive[len(slots) :] = GONE
        self.start, self.count = 0, len(slots)
