"""The bumpers of an emulated Pioneer: which segments a surface presses, and when they stall the base."""

from __future__ import annotations

import math

from drivers.arcos.firmware import Firmware
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import Scene
from drivers.messages import Pose, wrap_angle

_PRESSED_M = 1e-3
"""A segment is pressed by a surface this near, m."""
_PROBE_M = 1e-4
"""Step of the search for a surface's direction, m."""
_FRONT, _REAR = 1, 2
"""Bits of BUMPSTALL."""


class Touch:
    """Two bumpers round a base, each of segments from left to right, counted from 1.

    `radius_m` is the base's.
    """

    def __init__(self, firmware: Firmware, scene: Scene, radius_m: float) -> None:
        self._front, self._rear = firmware.front_bumpers, firmware.rear_bumpers
        """Numbers of segments."""
        self._scene = scene
        self._radius_m = radius_m
        self._last: tuple[Pose, tuple[int, int]] | None = None
        """The last pose asked for, and its answer."""
        self.stalls_at = 0
        """Argument of BUMPSTALL: whose contact stalls the base; 1 front, 2 rear, 3 both."""

    @property
    def middle(self) -> int:
        """The bit of the segment in the middle of the front bumper; 0 without one."""
        return 1 << (self._front + 1) // 2 if self._front else 0

    def pressed(self, pose: Pose) -> tuple[int, int]:
        """Return the pressed segments of the front and the rear bumper: bit k is segment k."""
        if self._last is not None and self._last[0] is pose:
            return self._last[1]
        found = self._find(pose)
        self._last = (pose, found)
        return found

    def blocks(self, v: float, front: int, rear: int) -> bool:
        """Return whether a base that drives at `v` m/s stalls by its bumpers."""
        ahead = v > 0.0 and front and self.stalls_at & _FRONT
        return bool(ahead or (v < 0.0 and rear and self.stalls_at & _REAR))

    def _find(self, pose: Pose) -> tuple[int, int]:
        """Return what `pressed` does: the segment that looks down the gradient of the distance to surfaces."""
        if self._room(pose.x, pose.y) > _PRESSED_M:
            return 0, 0
        step = _PROBE_M
        dx = self._room(pose.x - step, pose.y) - self._room(pose.x + step, pose.y)
        dy = self._room(pose.x, pose.y - step) - self._room(pose.x, pose.y + step)
        bearing = wrap_angle(math.atan2(dy, dx) - pose.theta)
        if abs(bearing) <= 0.5 * math.pi:
            return _segment(0.5 - bearing / math.pi, self._front), 0
        back = wrap_angle(bearing + math.pi)
        return 0, _segment(0.5 + back / math.pi, self._rear)

    def _room(self, x: float, y: float) -> float:
        """Return the distance from the edge of a base at (x, y) to the nearest surface, m; below zero inside it."""
        return clearance(x, y, self._scene.circles, self._scene.segments) - self._radius_m


def _segment(share: float, count: int) -> int:
    """Return the bit of the segment at `share`, 0 to 1 from left to right, of a bumper."""
    return 1 << 1 + min(count - 1, int(share * count)) if count else 0
