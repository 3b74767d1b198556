"""A run collected as it goes by: echoes, the way, and at even distances what was known.

The paper's figures show outline segments and clusters whatever method named the objects, so the paper's front end
listens here to the same firings. What is kept is bounded: of a long run snapshots lie farther apart.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.settings import Settings
from drivers.messages import Firing, Floats, Odometry, Pose
from perception.paper.paper_method import PaperPerception
from perception.pipeline import Perception
from perception.sensor_mounts import mounts_array
from runtime.analysis.timeline import Cluster, RunSnapshot, Timeline

MOMENTS_MAX: Final = 240
"""Kept at most; then every second one goes and they come half as often."""
FIRST_EVERY_S: Final = 0.25
ODOMETRY_EVERY_S: Final = 0.1
DIGITS: Final = 4
"""Of a coordinate by which a segment is known again, m."""


class TimelineBuilder:
    """Collects a run into a timeline.

    Parameters
    ----------
    timeline : Timeline
        Filled.
    """

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline
        self._mounts = mounts_array(timeline.settings.ring.mounts)
        self._every_s = FIRST_EVERY_S
        self._next_s = 0.0
        self._rows: list[Floats] = []
        self._heard = 0
        self._held: dict[bytes, tuple[float, float, Floats]] = {}
        self._pose: Pose | None = None
        self._yaw = 0.0
        self._front = front_end(timeline.settings)

    def begin_anew(self, t_s: float) -> None:
        """Drop what was, as the program does where the robot restarted and its odometry began again."""
        self._timeline.notes.append(f"the robot restarted after {t_s:.1f} s; what was before is not shown")
        self._rows, self._heard, self._held, self._pose = [], 0, {}, None
        self._timeline.snapshots, self._timeline.odometry = [], []
        self._front.reset()

    def hear(self, t_s: float, firing: Firing) -> None:
        """Take a firing."""
        c, s = math.cos(firing.ring_yaw), math.sin(firing.ring_yaw)
        fired = np.flatnonzero(~np.isnan(firing.ranges_m))
        mounts = self._mounts[fired]
        rows = np.empty((len(fired), 7))
        rows[:, 0], rows[:, 1] = t_s, fired
        rows[:, 2] = firing.pose.x + c * mounts[:, 0] - s * mounts[:, 1]
        rows[:, 3] = firing.pose.y + s * mounts[:, 0] + c * mounts[:, 1]
        rows[:, 4] = firing.ring_yaw + mounts[:, 2]
        rows[:, 5], rows[:, 6] = firing.ranges_m[fired], firing.robot_s
        self._rows.append(rows)
        self._heard += len(rows)
        self._front.observe(firing)
        self._pose, self._yaw = firing.pose, firing.ring_yaw

    def move(self, t_s: float, odometry: Odometry) -> None:
        """Take where the base believes it is."""
        self._pose, self._yaw = odometry.pose, odometry.ring_yaw
        way = self._timeline.odometry
        if not way or t_s - way[-1][0] >= ODOMETRY_EVERY_S:
            way.append((t_s, odometry))

    @property
    def pose(self) -> Pose | None:
        """Where the robot is, as far as it was heard."""
        return self._pose

    def pass_by(self, t_s: float, perception: Perception) -> None:
        """Note a snapshot where one is due."""
        self._timeline.seconds = t_s
        if t_s >= self._next_s:
            self._next_s = t_s + self._every_s
            self._note(t_s, perception)

    def end(self, perception: Perception | None) -> None:
        """Close the timeline with the snapshot of its end."""
        timeline = self._timeline
        if perception is not None and (not timeline.snapshots or timeline.snapshots[-1].t_s < timeline.seconds):
            self._note(timeline.seconds, perception)
        if self._rows:
            timeline.echoes = np.concatenate(self._rows)
        if self._held:
            timeline.segments = np.array([[first, last, *row] for first, last, row in self._held.values()])

    def _note(self, t_s: float, perception: Perception) -> None:
        rows = perception.segment_geometry()
        for key, row in zip((r.tobytes() for r in np.round(rows, DIGITS)), rows, strict=True):
            first = self._held[key][0] if key in self._held else t_s
            self._held[key] = (first, t_s, row)
        if self._pose is None:
            return
        snapshots, front = self._timeline.snapshots, self._front
        if len(snapshots) >= MOMENTS_MAX:
            del snapshots[1::2]
            self._every_s *= 2.0
        snapshots.append(
            RunSnapshot(
                t_s, self._pose, self._yaw, self._heard, front.segment_geometry()[:, :4], clusters_of(front),
                perception.objects(),
            )
        )  # fmt: skip


def front_end(settings: Settings) -> PaperPerception:
    """Return the paper's method with the constants of a run, whatever method the run had."""
    return PaperPerception(settings.ring, settings.models, settings.perception)


def clusters_of(front: PaperPerception) -> tuple[Cluster, ...]:
    """Return the clusters there are now, each with the rectangle around its segments."""
    told = []
    for j in range(front.clusters.count):
        rows = front.outline.segments[front.clusters.members(j)]
        xs, ys = rows[:, (0, 2)], rows[:, (1, 3)]
        x, y = front.clusters.centres[j].tolist()
        told.append(
            Cluster(x, y, float(xs.min()), float(ys.min()), float(xs.max()), float(ys.max()), len(rows))
        )  # fmt: skip
    return tuple(told)
