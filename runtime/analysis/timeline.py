"""What is known of a run that is over, whether a recording told it or a ring log."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from config.settings import Settings
from config.world import WorldConfig
from drivers.messages import Floats, LinkCounts, Odometry, Pose
from perception.detected_object import DetectedObject

T, SENSOR, X, Y, BEARING, RANGE, ROBOT_T = range(7)
"""Columns of `Timeline.echoes`."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """A cluster of outline segments: its centre and the rectangle around it, m."""

    x: float
    y: float
    left: float
    bottom: float
    right: float
    top: float
    segments: int


@dataclass(frozen=True, slots=True, eq=False)
class RunSnapshot:
    """What was known at one time."""

    t_s: float
    pose: Pose
    ring_yaw: float
    echoes: int
    """Rows of `Timeline.echoes` that had come by then."""
    segments: Floats
    """(n, 4): outline segments of the paper's front end: ends x, y, x, y, m."""
    clusters: tuple[Cluster, ...]
    objects: tuple[DetectedObject, ...]


@dataclass(frozen=True, slots=True)
class ModeEntry:
    """A mode that was entered, and why."""

    t_s: float
    mode: str
    reason: str | None


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A line of the log."""

    t_s: float
    level: str
    text: str


def _no_rows() -> Floats:
    return np.zeros((0, 7))


@dataclass(frozen=True, slots=True)
class BookmarkEntry:
    """A bookmark: when, what it says, and where the robot was."""

    t_s: float
    text: str
    pose: Pose | None


@dataclass(slots=True, eq=False)
class Timeline:
    """A run, in the odometry's frame; times are seconds after its first cycle or firing."""

    path: Path
    settings: Settings
    world: WorldConfig | None
    """What stood there, where that is known."""
    start_unix_ns: int = 0
    """Unix time of its first cycle; 0 where nobody knows."""
    seconds: float = 0.0
    cycles: int = 0
    echoes: Floats = field(default_factory=_no_rows)
    """(n, 7): t (s), sensor, where the sensor was x, y (m), where it looked (rad), range (m, inf heard nothing), and
    the firing's own time by the robot's clock (s)."""
    odometry: list[tuple[float, Odometry]] = field(default_factory=list)
    """Thinned to ten a second."""
    snapshots: list[RunSnapshot] = field(default_factory=list)
    """Evenly over the run; the last is its end."""
    segments: Floats = field(default_factory=_no_rows)
    """(n, 7): the run's own map: first and last seen (s), ends x, y, x, y (m), normal (rad)."""
    modes: list[ModeEntry] = field(default_factory=list)
    log: list[LogEntry] = field(default_factory=list)
    bookmarks: list[BookmarkEntry] = field(default_factory=list)
    gaps_s: list[float] = field(default_factory=list)
    """From cycle to cycle."""
    stops: dict[str, int] = field(default_factory=dict)
    """How often refinement ended for which cause."""
    counts: LinkCounts | None = None
    summary: dict[str, Any] | None = None
    """What the run said of itself at its end; none where it was cut off."""
    versions: dict[str, str] = field(default_factory=dict)
    started: str | None = None
    notes: list[str] = field(default_factory=list)
    """What is missing or damaged, a line each."""

    @property
    def start(self) -> Pose:
        """Where the odometry began: in the world's coordinates where the world is known, else in its own."""
        if self.world is None:
            return Pose(0.0, 0.0, 0.0)
        start = self.world.start
        return Pose(start.x_m, start.y_m, math.radians(start.heading_deg))

    @property
    def last(self) -> RunSnapshot | None:
        """The end of the run."""
        return self.snapshots[-1] if self.snapshots else None

    @property
    def objects(self) -> tuple[DetectedObject, ...]:
        """What was recognised at the end."""
        return self.snapshots[-1].objects if self.snapshots else ()

    def unix_ns(self, t_s: float) -> int:
        """Return a time of the run as Unix time, from 0 on where that is not known."""
        return self.start_unix_ns + round(1e9 * t_s)
