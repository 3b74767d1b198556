"""The odometry of the last few seconds, to look up the pose of an earlier firing."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

from drivers.messages import Odometry, Pose
from drivers.se2 import interpolate


class OdometryHistory:
    """A limited number of odometry samples with ascending times; a new one replaces the oldest."""

    def __init__(self, capacity: int) -> None:
        self._samples: deque[Odometry] = deque(maxlen=capacity)

    def __len__(self) -> int:
        return len(self._samples)

    @property
    def newest(self) -> Odometry | None:
        """The newest sample, None if the history is empty."""
        return self._samples[-1] if self._samples else None

    def add(self, sample: Odometry) -> None:
        """Add a sample; one that is not later than the newest is ignored."""
        if not self._samples or sample.robot_s > self._samples[-1].robot_s:
            self._samples.append(sample)

    def clear(self) -> None:
        """Remove all samples."""
        self._samples.clear()

    def at(self, robot_s: float, gap_max_s: float) -> tuple[Pose, float] | None:
        """Return the pose and ring yaw at a time, interpolated between the samples around it.

        None where the time is outside the samples, or the two around it are more than `gap_max_s` apart.
        """
        newest = self.newest
        if newest is None or robot_s > newest.robot_s:
            return None
        if robot_s == newest.robot_s:
            return newest.pose, newest.ring_yaw
        # A firing is only a few samples old, so the search from the newest backwards is short.
        for after, before in pairwise(reversed(self._samples)):
            if before.robot_s <= robot_s:
                gap_s = after.robot_s - before.robot_s
                if gap_s > gap_max_s and robot_s != before.robot_s:
                    return None
                share = (robot_s - before.robot_s) / gap_s
                yaw = before.ring_yaw + share * (after.ring_yaw - before.ring_yaw)
                return interpolate(before.pose, after.pose, share), yaw
        return None
