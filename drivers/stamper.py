"""What all protocols do alike when they give samples of the odometry and firings their poses.

Jumps of the odometry are removed here, where every sample passes (`drivers.odometry_jumps`). Firings beyond those of
the pattern are dropped, so that the cycle gets them at a bounded rate.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from config.robot import BodyConfig
from drivers.dropped_count import LATE_FIRINGS, DroppedCount
from drivers.messages import Odometry, Pose
from drivers.odometry_jumps import OdometryJumps
from drivers.token_bucket import TokenBucket

FIRINGS_SHARE: Final = 4.0
"""Firings passed on are at most so many times as frequent as those of the pattern."""
FIRINGS_BURST: Final = 64.0
"""Most firings passed on at once, as after a delay on the way."""
STEP_MIN_S: Final = 1e-3
EXCESS_NOTE_S: Final = 10.0
"""Time between notes about too many firings, s."""
EXCESS_FIRINGS: Final = (
    "the ring sends many more firings than its pattern has, and the excess is dropped; its firmware is faulty, or "
    "another device sends on the line: restart the robot, and check what else is connected"
)
NOTES_MAX: Final = 16
"""Notes kept if they are not taken."""


class Stamper:
    """The part of a protocol's stamper that does not depend on the protocol.

    The limits of the body distinguish a motion from a jump.
    """

    def __init__(self, body: BodyConfig) -> None:
        self.late_echoes = DroppedCount(LATE_FIRINGS, self.note)
        """Firings dropped: without odometry around them, duplicated, or older than one before."""
        self.excess_echoes = 0
        """Firings dropped because the robot sends many more than its pattern has."""
        self._excess_noted_s = -math.inf
        """When that was noted last."""
        self._jumps = OdometryJumps(body)
        self._firing_limit = TokenBucket(math.inf, math.inf)
        """Has no limit before `_limit_firings`."""
        self._notes: deque[str] = deque(maxlen=NOTES_MAX)

    @property
    def origin(self) -> Pose:
        """The origin of the poses passed on, in the robot's own odometry; the identity until that jumps."""
        return self._jumps.origin

    def note(self, text: str) -> None:
        """Add a message for the operator."""
        self._notes.append(text)

    def notes(self) -> tuple[str, ...]:
        """Return the messages for the operator, and remove them."""
        notes = tuple(self._notes)
        self._notes.clear()
        return notes

    def _limit_firings(self, step_s: float) -> None:
        """Expect one firing in `step_s`, s."""
        self._firing_limit = TokenBucket(FIRINGS_SHARE / max(step_s, STEP_MIN_S), FIRINGS_BURST)

    def _is_excess(self, run_s: float) -> bool:
        """Return whether a firing that arrived at `run_s` must be dropped; count it, and note it now and then."""
        if self._firing_limit.take(run_s):
            return False
        self.excess_echoes += 1
        if run_s - self._excess_noted_s >= EXCESS_NOTE_S:
            self._excess_noted_s = run_s
            self.note(EXCESS_FIRINGS)
        return True

    def _without_jump(self, reported: Odometry) -> Odometry:
        """Return a sample whose pose continues the one before; a jump that is removed is noted."""
        sample, note = self._jumps.remove(reported)
        if note is not None:
            self.note(note)
        return sample
