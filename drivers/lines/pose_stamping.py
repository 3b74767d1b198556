"""Odometry and firings from lines: each firing gets the pose between the samples that come before and after it."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from config.robot import RobotConfig
from drivers.firing_pattern import FiringPattern
from drivers.lines.wire import Ranges
from drivers.messages import Firing, Odometry
from drivers.odometry_history import OdometryHistory
from drivers.stamper import Stamper

_HISTORY: Final = 64
"""Samples kept to look up the pose of a firing."""
_WAITING_MAX: Final = 1024
"""Firings that wait for the sample after them."""
_GAP_PERIODS: Final = 4.0
"""Periods of samples, besides the longest silence, to interpolate over."""


class LineStamper(Stamper):
    """Gives samples of the odometry and firings their poses.

    `period_s` is the time from one sample to the next.
    """

    def __init__(self, config: RobotConfig, period_s: float) -> None:
        super().__init__(config.body)
        self._sensors = config.ring.sensor_count
        self._gap_s = _GAP_PERIODS * period_s + config.link.silence_max_s
        """Longest gap between samples in which the pose of a firing counts as known."""
        self._history = OdometryHistory(_HISTORY)
        self._waiting: deque[tuple[float, Ranges]] = deque(maxlen=_WAITING_MAX)
        """Firings for which no later sample has come."""
        self._fired_s = -math.inf
        """Time of the last firing passed on."""

    @property
    def newest_s(self) -> float:
        """The robot's time of the last sample, s; negative infinity before the first."""
        newest = self._history.newest
        return -math.inf if newest is None else newest.robot_s

    def set_pattern(self, pattern: FiringPattern) -> None:
        """Set the firing pattern that the robot carries out."""
        self._limit_firings(pattern.step_period_s)

    def break_off(self) -> None:
        """Discard firings that wait: no sample after them comes on this line."""
        self._waiting.clear()

    def restart(self) -> None:
        """Begin again, as the robot did."""
        self.break_off()
        self._history.clear()
        self._jumps.restart()
        self._fired_s = -math.inf

    def fired(self, robot_s: float, said: Ranges) -> None:
        """Let a firing wait for the sample after it.

        Raises
        ------
        ValueError
            The ring has no such sensor.
        """
        if not all(0 <= sensor < self._sensors for sensor in said.ranges_m):
            raise ValueError("no such sensor")
        self._waiting.append((robot_s, said))

    def moved(self, reported: Odometry, arrived_s: float) -> tuple[Odometry, list[Firing]]:
        """Return a sample without jumps, and the firings that have waited for it."""
        sample = self._without_jump(reported)
        self._history.add(sample)
        firings = []
        while self._waiting and self._waiting[0][0] <= sample.robot_s:
            robot_s, said = self._waiting.popleft()
            place = self._history.at(robot_s, self._gap_s)
            if place is None or robot_s <= self._fired_s:
                self.late_echoes.add()
            elif not self._is_excess(arrived_s):
                ranges = np.full(self._sensors, math.nan)
                ranges[list(said.ranges_m)] = list(said.ranges_m.values())
                firings.append(Firing(robot_s, *place, ranges))
                self._fired_s = robot_s
        return sample, firings
