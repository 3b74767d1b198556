"""The last minutes of a run for a page that is opened or reloaded: where the robot was, and numbers for its plots."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Final

from drivers.messages import Odometry
from runtime.console.sent_messages import HistoryRow, SampleRow

SAMPLE_S: Final = 1.0
"""Time between the samples, s of the robot's clock."""
SAMPLES_MAX: Final = 300
"""Five minutes; with 24 ranges a message of 150 kB."""
TRAIL_STEP_M: Final = 0.05
TRAIL_MAX: Final = 2000
"""Places of the trail: a hundred metres."""


class RunHistory:
    """Samples and trail of the run so far."""

    def __init__(self) -> None:
        self._samples: deque[SampleRow] = deque(maxlen=SAMPLES_MAX)
        self._trail: deque[tuple[float, float, float]] = deque(maxlen=TRAIL_MAX)

    def clear(self) -> None:
        """Forget all, as after a reset of the odometry."""
        self._samples.clear()
        self._trail.clear()

    def take(
        self,
        odometry: Odometry,
        ranges: Callable[[], list[float | None]],
        phases_s: Callable[[], Mapping[str, float]],
    ) -> None:
        """Take in a cycle: keep its place if the robot has moved, and its numbers once in a while.

        `ranges` returns the last range of each sensor in the form of a frame, m, and `phases_s` the duration of each
        phase of the last cycle; both are called once a sample.
        """
        x, y, t = odometry.pose.x, odometry.pose.y, odometry.robot_s
        if not self._trail or math.hypot(x - self._trail[-1][0], y - self._trail[-1][1]) >= TRAIL_STEP_M:
            self._trail.append((round(x, 3), round(y, 3), round(t, 3)))
        if self._samples and t - self._samples[-1]["robot_s"] < SAMPLE_S:
            return
        phases = phases_s()
        self._samples.append(
            {
                "robot_s": t,
                "pose": (round(x, 4), round(y, 4), round(odometry.pose.theta, 5)),
                "ring_yaw": round(odometry.ring_yaw, 5),
                "twist": (round(odometry.twist.v, 4), round(odometry.twist.w, 4)),
                "ranges": ranges(),
                "phases": {name: round(1e6 * s, 1) for name, s in phases.items()},
                "cycle_us": round(1e6 * sum(phases.values()), 1),
            }
        )

    def listed(self) -> HistoryRow:
        """Return samples and trail, oldest first, as a page is sent them."""
        return {"samples": list(self._samples), "trail": list(self._trail)}
