"""VFH+ as the `vfh` driver of playerproject has it, written anew from its described behaviour and default values.

The ring becomes a fan of 361 beams, as that driver does with sonars: each sensor paints its range over ±15°. There is
no memory: every cell behind the range of its bearing counts. Only the front half is looked at.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviors.move_to_goal import Goal
from bench.peers.drive_peer import DrivePeer
from config.settings import Settings
from drivers.messages import Floats, Pose, Twist, wrap_angle

CELL_M: Final = 0.1
CELLS: Final = 61
SECTOR_DEG: Final = 5
CUTOFF: Final = 2e6
SAFETY_M: Final = 0.1
TARGET_WEIGHT: Final = 5.0
CURRENT_WEIGHT: Final = 3.0
ACCELERATION_M_S2: Final = 0.2
TURN_DEG_S: Final = (40.0, 10.0)
"""Turning rate at standstill and at full speed."""
PAINTED_RAD: Final = math.radians(15.0)
NARROW_DEG: Final = 10.0
WIDE_DEG: Final = 80.0
STEP_S: Final = 0.05


class PlayerprojectVfh(DrivePeer):
    """VFH+ of playerproject."""

    def __init__(self, settings: Settings, goal: Goal) -> None:
        super().__init__(settings, goal)
        half = CELLS // 2
        rows, columns = np.mgrid[-half : half + 1, -half : half + 1]
        x, y = columns.ravel() * CELL_M, rows.ravel() * CELL_M
        d = np.hypot(x, y)
        ahead = (x >= 0.0) & (d > 0.0)
        self._d, self._bearing = d[ahead], np.degrees(np.arctan2(y[ahead], x[ahead]))
        self._magnitude = np.maximum(0.0, 3000.0 - 1000.0 * self._d) ** 4 / 1e8
        room_m = settings.body.radius_m + SAFETY_M
        widened = np.degrees(np.arcsin(np.minimum(1.0, room_m / self._d)))
        sectors = np.arange(-90 + SECTOR_DEG / 2.0, 90.0, SECTOR_DEG)
        self._sectors = sectors
        gap = np.abs(sectors[:, None] - self._bearing[None, :])
        self._covers = (gap <= widened[None, :] + SECTOR_DEG / 2.0).astype(np.float64)
        self._blocked = np.zeros(len(sectors), dtype=np.bool_)
        self._picked_deg = 0.0
        self._speed = 0.0

    def _fan(self, pose: Pose, ring_yaw: float) -> Floats:
        """Return the range of the centre to what a sonar hears, for each half degree of the front half, m."""
        beams = np.radians(np.arange(-90.0, 90.25, 0.5))
        fan = np.full(len(beams), np.nan)
        for (mx, my, axis), r in zip(self.mounts.tolist(), self.ranges_m.tolist(), strict=True):
            turned = wrap_angle(axis + ring_yaw - pose.theta)
            covers = np.abs((beams - turned + math.pi) % math.tau - math.pi) <= PAINTED_RAD
            distance = min(r, self.settings.ring.range_max_m) + math.hypot(mx, my)
            fan[covers] = np.fmin(fan[covers], distance)
        known = np.flatnonzero(~np.isnan(fan))
        if len(known) == 0:
            return np.full(len(beams), self.settings.ring.range_max_m)
        return np.asarray(fan[known[np.abs(np.arange(len(fan))[:, None] - known[None, :]).argmin(axis=1)]])

    def velocity(self, pose: Pose, ring_yaw: float, run_s: float) -> Twist:
        """Return the velocity that the driver would set."""
        del run_s
        fan = self._fan(pose, ring_yaw)
        at = np.clip(np.rint((self._bearing + 90.0) * 2.0).astype(int), 0, len(fan) - 1)
        hit = fan[at] < self._d + 0.5 * CELL_M
        turn_deg_s = TURN_DEG_S[0] + (TURN_DEG_S[1] - TURN_DEG_S[0]) * self._speed / self.v_max
        if float(fan.min()) < self.settings.body.radius_m + SAFETY_M:
            return self._turn_on_the_spot(pose)
        histogram = self._covers @ (hit * self._magnitude)
        self._blocked = histogram > CUTOFF
        goal_deg = math.degrees(self.goal_bearing(pose))
        if (picked := self._pick(goal_deg)) is None:
            return self._turn_on_the_spot(pose)
        self._picked_deg = picked
        self._speed = min(self.v_max, self._speed + ACCELERATION_M_S2 * STEP_S)
        radius_m = self._speed / math.radians(turn_deg_s)
        distance = math.dist((pose.x, pose.y), (self.goal.x, self.goal.y))
        if distance < 2.0 * radius_m * abs(math.sin(math.radians(goal_deg))):  # inside a turning circle
            self._speed = max(0.0, self._speed - 2.0 * ACCELERATION_M_S2 * STEP_S)
        w_deg = max(-turn_deg_s, min(turn_deg_s, picked / 75.0 * turn_deg_s))
        return Twist(self._speed, math.radians(w_deg))

    def _turn_on_the_spot(self, pose: Pose) -> Twist:
        """Return the turn at full rate, to the side of the goal."""
        self._speed = 0.0
        side = math.copysign(1.0, self.goal_bearing(pose))
        return Twist(0.0, side * math.radians(TURN_DEG_S[0]))

    def _pick(self, goal_deg: float) -> float | None:
        """Return the cheapest candidate direction, degrees; None without one."""
        found: list[float] = []
        begin: float | None = None
        for blocked, middle in [*zip(self._blocked.tolist(), self._sectors.tolist(), strict=True), (True, 92.5)]:
            low = middle - SECTOR_DEG / 2.0
            if not blocked and begin is None:
                begin = low
            if blocked and begin is not None:
                width = low - begin
                if width >= NARROW_DEG:
                    found.append(0.5 * (begin + low))
                if width >= WIDE_DEG:
                    found += [begin + 40.0, low - 40.0]
                    if begin <= goal_deg <= low:
                        found.append(goal_deg)
                begin = None
        if not found:
            return None

        def cost(candidate: float) -> float:
            away = abs((goal_deg - candidate + 180.0) % 360.0 - 180.0)
            return TARGET_WEIGHT * away + CURRENT_WEIGHT * abs(self._picked_deg - candidate)

        return min(found, key=cost)
