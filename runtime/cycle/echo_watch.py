"""The watch on a ring that hears no echo: wires that carry none look like open space.

A pin that a 5 V echo destroyed, a ring without its supply, a ring under a cover: each firing reports silence. So
does open ground. A robot that has never heard an echo is stopped once, after a short way, with what to try; armed
again it drives on. If its ring reaches far, so that it would hear any room, it drives slowly until then
(`runtime.cycle.unheard_limit`). Later a long way without an echo is a line of the log, and no stop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from config.bounded import Coordinate
from drivers.messages import Firing, Odometry, Pose

WAY_MIN_M: Final = 1.0
"""Way without an echo since the start after which a robot stops whose ring reaches far, m."""
OPEN_M: Final = 4.0
"""Way and reach together at which a ring that hears nothing stops the robot, m: from the middle of a room 8 m wide it
has come within reach of a wall by then. In the shipped room a reach of 1.7 m hears its first echo after 1.3 m. After
the first echo, the way alone is worth a line."""


@dataclass(frozen=True, slots=True)
class EchoWatch:
    """How far the robot has driven without an echo; immutable, as keyframes hold it."""

    is_over: bool = False
    """An echo was heard, or the robot was stopped for want of one."""
    way_m: Coordinate = 0.0
    """Driven since the start or the last echo, at most `OPEN_M`, m."""
    at: Pose | None = None
    """Where the robot was by its newest odometry in this silence."""

    def observe(self, odometry: Odometry | None, firings: Sequence[Firing]) -> EchoWatch:
        """Return the watch after a cycle, given what arrived in it."""
        if any(math.isfinite(r) for firing in firings for r in firing.ranges_m.tolist()):
            return self if self.is_over and self.at is None else EchoWatch(is_over=True)
        if odometry is None or not firings:
            return self
        pose = odometry.pose
        way = 0.0 if self.at is None else math.dist((pose.x, pose.y), (self.at.x, self.at.y))
        return replace(self, way_m=min(self.way_m + way, OPEN_M), at=pose)

    def may_be_deaf(self, reach_m: float) -> bool:
        """Return whether a ring that reaches so far, m, would have heard any room; a short one hears it late."""
        return not self.is_over and reach_m >= OPEN_M - WAY_MIN_M

    @property
    def silence(self) -> str | None:
        """What to check where the ring has long heard nothing, after its first echo or that stop; None elsewhere."""
        if not self.is_over or self.way_m < OPEN_M:
            return None
        return (
            f"no sensor has heard an echo over the last {OPEN_M:g} m: in the open that is right; if anything stands "
            f"within range, halt the robot and check the ring's power and cables (`echolocate ring-test --hand`)"
        )

    def stopped(self, reach_m: float, problem: str | None = None) -> tuple[EchoWatch, str | None]:
        """Return the watch, and why a robot whose ring reaches so far must stop; then it is over.

        Another problem comes first.
        """
        if problem is not None or self.is_over or self.way_m < max(WAY_MIN_M, OPEN_M - reach_m):
            return self, problem
        return EchoWatch(is_over=True), (
            f"no sensor has heard an echo since the start, over {self.way_m:.1f} m: if anything stands within range, "
            f"check the sensors' supply, the wires of trigger and echo, and what covers the ring (`echolocate "
            f"ring-test --hand` shows which), then re-arm; in the open re-arm and it drives on"
        )
