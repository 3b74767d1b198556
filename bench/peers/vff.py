"""VFF: the virtual force field of Borenstein & Koren, SMC 19(5), 1989, on their certainty grid.

Each echo raises the one cell on the axis of its sensor; the cells before it are lowered (HIMM, the later rule). Each
cell of the active window pushes by F_cr·C/d², the goal pulls by F_ct, and the robot turns to the sum.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviors.move_to_goal import Goal
from bench.peers.drive_peer import DrivePeer
from config.settings import Settings
from drivers.messages import Firing, Pose, Twist, wrap_angle

CELL_M: Final = 0.1
ACTIVE: Final = 33
"""Cells across the active window."""
MAP_CELLS: Final = 1024
RAISED: Final = 3
HIGHEST: Final = 15
LOWERED: Final = 1
STEERING_PER_S: Final = 1.5
"""K_s."""
PULL: Final = 1.0
"""F_ct."""
PUSH: Final = 0.001
"""F_cr over F_ct: the best of .0003, .001, .003 and .01 on ten drives of other seeds."""
SMOOTHING: Final = 0.3
"""Share of the newest steering in the low-pass filter."""
V_MIN_M_S: Final = 0.04


class Vff(DrivePeer):
    """The virtual force field."""

    def __init__(self, settings: Settings, goal: Goal, push: float = PUSH) -> None:
        super().__init__(settings, goal)
        self._grid = np.zeros((MAP_CELLS, MAP_CELLS))
        self._push = push
        self._w = 0.0
        half = ACTIVE // 2
        rows, columns = np.mgrid[-half : half + 1, -half : half + 1]
        self._dx, self._dy = columns * CELL_M, rows * CELL_M
        self._d = np.maximum(np.hypot(self._dx, self._dy), 0.5 * CELL_M)

    def on_firing(self, firing: Firing) -> None:
        """Raise the cell at each echo and lower those before it."""
        ring, reach = self.settings.ring, 0.5 * ACTIVE * CELL_M * math.sqrt(2.0)
        c, s = math.cos(firing.ring_yaw), math.sin(firing.ring_yaw)
        for k in np.flatnonzero(~np.isnan(firing.ranges_m)).tolist():
            mx, my, axis = self.mounts[k].tolist()
            x, y, angle = firing.pose.x + c * mx - s * my, firing.pose.y + s * mx + c * my, firing.ring_yaw + axis
            r = float(firing.ranges_m[k])
            end = min(r, reach, ring.range_max_m)
            for step in np.arange(0.5 * CELL_M, end - CELL_M, CELL_M).tolist():
                cell = self._cell(x + step * math.cos(angle), y + step * math.sin(angle))
                self._grid[cell] = max(0.0, self._grid[cell] - LOWERED)
            if r <= reach:
                cell = self._cell(x + r * math.cos(angle), y + r * math.sin(angle))
                self._grid[cell] = min(HIGHEST, self._grid[cell] + RAISED)

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        return (math.floor(y / CELL_M) + MAP_CELLS // 2) % MAP_CELLS, (
            math.floor(x / CELL_M) + MAP_CELLS // 2
        ) % MAP_CELLS

    def velocity(self, pose: Pose, ring_yaw: float, run_s: float) -> Twist:
        """Return the velocity towards the sum of forces, slower the more they oppose the motion."""
        del ring_yaw, run_s
        row, column = self._cell(pose.x, pose.y)
        half = ACTIVE // 2
        part = self._grid[row - half : row + half + 1, column - half : column + half + 1]
        strength = self._push * part / self._d**3
        fx, fy = -float((strength * self._dx).sum()), -float((strength * self._dy).sum())
        bearing = self.goal_bearing(pose) + pose.theta
        x, y = PULL * math.cos(bearing) + fx, PULL * math.sin(bearing) + fy
        w = STEERING_PER_S * wrap_angle(math.atan2(y, x) - pose.theta)
        self._w += SMOOTHING * (w - self._w)
        push = math.hypot(fx, fy)
        against = 0.0
        if push > 0.0:
            opposed = -(fx * math.cos(pose.theta) + fy * math.sin(pose.theta)) / push
            against = max(0.0, opposed) * min(1.0, push / PULL)
        return Twist(max(V_MIN_M_S, self.v_max * (1.0 - against)), self._w)
