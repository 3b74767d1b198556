"""ROS time of the robot's own clock.

Ranges, odometry and frames of one state carry the robot's times, which are exact to each other; when a state arrives
varies. So the offset between the two clocks is the smallest seen, and rises slowly in order to follow their drift. A
state that comes late, after a stall, keeps the time of its measurement.
"""

from __future__ import annotations

import math
from typing import Final

DRIFT: Final = 1e-3
"""How fast the offset may rise, s/s: ten times the drift of two quartz clocks."""
JUMP_S: Final = 0.5
"""A clock that differs by more from what the other one says has jumped."""
LATE_MAX_S: Final = 5.0
"""If states come later than `JUMP_S` for this long, the robot's clock stood still: stalls of a busy machine and what
queues up in them last a second or two."""


class StampClock:
    """Converts times of the robot's clock to ROS time."""

    def __init__(self) -> None:
        self._offset_s = math.nan
        self._robot_s = self._ros_s = self._host_s = 0.0
        self._late_since_s = math.inf

    def update(self, robot_s: float, ros_s: float, host_s: float, *, is_steady: bool) -> str | None:
        """Update the offset when a state arrives; return a message if a clock has jumped, else None.

        `nanoseconds` needs it to have been called once.

        The clocks are the robot's in the state, ROS time and this machine's monotonic one when it arrived.
        `is_steady`: the robot's time runs as fast as ROS time, not so while an emulated run is paused or slowed down.
        """
        if is_steady and robot_s == self._robot_s and not math.isnan(self._offset_s):
            return None  # nothing new was measured
        offset_s, before_s, elapsed_s = ros_s - robot_s, self._offset_s, ros_s - self._ros_s
        was_set = abs(elapsed_s - (host_s - self._host_s)) > JUMP_S
        restarted = robot_s < self._robot_s
        self._robot_s, self._ros_s, self._host_s = robot_s, ros_s, host_s
        if math.isnan(before_s) or not is_steady:
            self._offset_s, self._late_since_s = offset_s, math.inf
            return None
        self._late_since_s = min(self._late_since_s, host_s) if offset_s - before_s > JUMP_S else math.inf
        stood_still = host_s - self._late_since_s > LATE_MAX_S
        # A delay only raises the offset, so a fall is a jump; a rise is one if a clock was set, restarted or stood.
        has_jumped = abs(offset_s - before_s) > JUMP_S
        if has_jumped and (was_set or restarted or stood_still or offset_s < before_s):
            self._offset_s, self._late_since_s = offset_s, math.inf
            return (
                f"clock jump: ROS time and the robot's clock differ by {offset_s - before_s:+.2f} s from before; the "
                f"robot restarted, its clock stood still, or the time of ROS or of this machine was set: stamps "
                f"follow the new time"
            )
        self._offset_s = min(offset_s, before_s + DRIFT * max(0.0, elapsed_s))
        return None

    def nanoseconds(self, robot_s: float) -> int:
        """Return the ROS time of a time of the robot's clock, ns."""
        return max(0, round(1e9 * (self._offset_s + robot_s)))
