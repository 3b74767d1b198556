"""The ring as a laser scan, for programs that take nothing else, as slam_toolbox.

A scan is complete when each sensor has fired since the last one. Every echo is moved to the base at that moment, by
the odometry between; it is one beam, in the middle of the sonar's. A beam along which no sensor looks is NaN: not
measured.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from typing import Final

from drivers.messages import Pose, wrap_angle
from runtime.analysis.export.ros_messages import Output, header
from runtime.bridges.console_client import Message

BEAMS: Final = 360
HISTORY: Final = 200
"""States kept: ten seconds."""
WAIT_MAX_S: Final = 1.0
"""A sensor that has not fired for so long is left out."""


class RingScan:
    """Collects the readings of a ring; the frame is that of the base."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._ring: Message = {}
        self._poses: deque[tuple[float, Pose, float]] = deque(maxlen=HISTORY)
        """Time by the robot's clock (s), pose of the base, and the ring's yaw (rad) of the last states."""
        self._done_s = -math.inf
        """Time of the newest firing in the last scan."""

    def begin(self, ring: Message) -> None:
        """Begin with a ring, as a session has it."""
        self._ring, self._done_s = ring, -math.inf
        self._poses.clear()

    def take(self, state: Message, at: int) -> Output | None:
        """Return the scan at a state, which is that of a time (ns); None until one is complete."""
        robot_s, here = state["robot_s"], Pose(*state["pose"])
        if not self._poses or robot_s > self._poses[-1][0]:
            self._poses.append((robot_s, here, state["ring_yaw"]))
        fired_s = {
            k: robot_s - age_s
            for k, age_s in enumerate(state["age"])
            if age_s is not None and age_s < WAIT_MAX_S and state["ranges"][k] is not None
        }
        if not fired_s or min(fired_s.values()) <= self._done_s:
            return None
        self._done_s = max(fired_s.values())
        ranges, to = [math.nan] * BEAMS, here.inverse()
        for sensor, time_s in sorted(fired_s.items()):
            base, ring_yaw = self._at(time_s)
            yaw = base.theta if sensor in self._ring["turning"] else ring_yaw
            eye = to.compose(Pose(base.x, base.y, yaw)).compose(Pose(*self._ring["mounts"][sensor]))
            range_m = state["ranges"][sensor]
            is_silent = range_m < 0.0
            reach = self._ring["range_max"] if is_silent else range_m
            x, y = eye.x + reach * math.cos(eye.theta), eye.y + reach * math.sin(eye.theta)
            beam = round((math.atan2(y, x) + math.pi) * BEAMS / (2.0 * math.pi)) % BEAMS
            length = math.inf if is_silent else math.hypot(x, y)
            if not length >= ranges[beam]:
                ranges[beam] = length
        reach_m = self._ring["range_max"] + max(math.hypot(x, y) for x, y, _ in self._ring["mounts"])
        return Output(
            "scan",
            "sensor_msgs/LaserScan",
            {
                "header": header(self._frame, at),
                "angle_min": -math.pi,
                "angle_max": math.pi - 2.0 * math.pi / BEAMS,
                "angle_increment": 2.0 * math.pi / BEAMS,
                "range_min": self._ring["range_min"],
                "range_max": reach_m,
                "ranges": ranges,
            },
        )

    def _at(self, time_s: float) -> tuple[Pose, float]:
        """Return the base and the ring's yaw at a time of the robot's clock, between two states."""
        after = bisect_left(self._poses, time_s, key=lambda row: row[0])
        if after == 0 or after == len(self._poses):
            _, pose, yaw = self._poses[min(after, len(self._poses) - 1)]
            return pose, yaw
        (s0, p0, y0), (s1, p1, y1) = self._poses[after - 1], self._poses[after]
        share = (time_s - s0) / (s1 - s0)
        theta = p0.theta + share * wrap_angle(p1.theta - p0.theta)
        between = Pose(p0.x + share * (p1.x - p0.x), p0.y + share * (p1.y - p0.y), theta)
        return between, y0 + share * wrap_angle(y1 - y0)
