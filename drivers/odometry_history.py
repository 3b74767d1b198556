"""The odometry of the last few seconds, to look up where the base was when an older firing took place."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

from drivers.messages import Odometry, Pose
from drivers.se2 import interpolate


class OdometryHistory:
    """A fixed number of odometry samples, times ascending; the oldest leaves for a new one."""

    def __init__(self, capacity: int) -> None:
        self._samples: deque[Odometry] = deque(maxlen=capacity)

    def __len__(self) -> int:
        return len(self._samples)

    @property
    def newest(self) -> Odometry | None:
        """The last sample, None where there is none."""
        return self._samples[-1] if self._samples else None

    def add(self, sample: Odometry) -> None:
        """Take the next sample; one that is not later than the newest is ignored."""
        if not self._samples or sample.robot_s > self._samples[-1].robot_s:
            self._samples.append(sample)

    def clear(self) -> None:
        """Forget all samples."""
        self._samples.clear()

    def at(self, t_s: float, gap_max_s: float) -> tuple[Pose, float] | None:
        """Return the pose and ring yaw at `t_s`, interpolated between the samples around it.

        Returns None where no sample is as old or as new, or the two around it are more than `gap_max_s` apart.
        """
        newest = self.newest
        if newest is None or t_s > newest.robot_s:
            return None
        if t_s == newest.robot_s:
            return newest.pose, newest.ring_yaw
        # A firing is a few samples old, so the search from the newest back is short.
        for after, before in pairwise(reversed(self._samples)):
            if before.robot_s <= t_s:
                gap_s = after.robot_s - before.robot_s
                if gap_s > gap_max_s and t_s != before.robot_s:
                    return None
                share = (t_s - before.robot_s) / gap_s
                yaw = before.ring_yaw + share * (after.ring_yaw - before.ring_yaw)
                return interpolate(before.pose, after.pose, share), yaw
        return None
