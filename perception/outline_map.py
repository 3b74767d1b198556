"""The outline map: the paper's raw map of segments (§3.3), preallocated, where the old and the wrong leave.

Segments are kept in the order in which they came, in a circle of fixed capacity, so that ageing is a step of the
tail and a new segment costs the same in the first minute and after a week.
"""

from __future__ import annotations

import math

import numpy as np

from config.settings import MapConfig
from drivers.messages import Firing
from perception.kernel import Floats, Ints, kernel


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
        1 where a slot holds a segment. Updated.
    start, count : int
        Oldest slot and number of slots in use, circular.
    ranges, mounts, pose_x, pose_y, yaw, half_angle
        The firing, as in `perception.segments.pair_readings`.
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
            if alive[slot] == 0:
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

    def __init__(self, config: MapConfig, mounts: Floats, half_angle: float) -> None:
        self._config = config
        self._mounts = mounts
        self._half_angle = half_angle
        self.segments = np.zeros((config.capacity, 5))
        """(capacity, 5): ends x, y, x, y (m) and the direction of the normal (rad)."""
        self.times = np.zeros(config.capacity)
        """(capacity,): when each segment was completed, s."""
        self.alive = np.zeros(config.capacity, dtype=np.int64)
        """(capacity,): 1 where a slot holds a segment that still counts."""
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
            if self.count == capacity:
                self._drop_oldest()
            slot = (self.start + self.count) % capacity
            self.segments[slot] = row
            self.times[slot] = t
            self.alive[slot] = 1
            self.count += 1
            self.total += 1

    def age(self, t: float) -> None:
        """Let segments leave that are older than the age limit at time `t`."""
        while self.count and (not self.alive[self.start] or t - self.times[self.start] > self._config.age_max_s):
            self._drop_oldest()

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
        self.alive[:] = 0
        self.start = 0
        self.count = 0

    def _drop_oldest(self) -> None:
        self.alive[self.start] = 0
        self.start = (self.start + 1) % len(self.times)
        self.count -= 1
