"""A finished run over time, read from a recording or from a ring log."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from config.settings import Settings
from config.world import WorldConfig
from drivers.messages import IDENTITY, Floats, LinkCounts, Odometry, Pose
from perception.detected_object import DetectedObject
from perception.localization.localized_pose import KnownWay
from perception.mapping.grid.known_cells import KnownCells
from perception.polyline import Polyline
from perception.records import Structured

ECHO: Final = np.dtype(
    [
        ("t_s", np.float64),
        ("sensor", np.int64),
        ("x", np.float64),
        ("y", np.float64),
        ("bearing", np.float64),
        ("range_m", np.float64),
        ("robot_s", np.float64),
    ]
)
"""A reading: time (s), sensor, its position (m) and bearing (rad), range (m, inf without an echo), and the time of
the firing by the robot's clock (s)."""
Echoes: TypeAlias = Structured
"""Structured array (n,) of `ECHO`."""

CROSS_PATH: Final = np.dtype(
    [
        ("t_s", np.float64),
        ("transmitter", np.int64),
        ("listener", np.int64),
        ("x", np.float64),
        ("y", np.float64),
        ("bearing", np.float64),
        ("listener_x", np.float64),
        ("listener_y", np.float64),
        ("listener_bearing", np.float64),
        ("half_path_m", np.float64),
        ("robot_s", np.float64),
    ]
)
"""A cross path: time (s), the sensor that fired and the one that listened, position (m) and bearing (rad) of each,
half the path (m, inf if nothing was heard), and the time of the firing by the robot's clock (s)."""
CrossPathRows: TypeAlias = Structured
"""Structured array (n,) of `CROSS_PATH`."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """A cluster of outline segments: its centre and its bounding rectangle, m."""

    x: float
    y: float
    left: float
    bottom: float
    right: float
    top: float
    segments: int
    """Number of segments in it."""


@dataclass(frozen=True, slots=True, eq=False)
class MapPlace:
    """Where a run knew its robot to be in a map."""

    pose: Pose
    """Of the robot in the map."""
    covariance: Floats
    """Of x, y (m) and heading (rad), shape (3, 3)."""
    map_in_odom: Pose
    """The map's frame in that of odometry."""


@dataclass(frozen=True, slots=True, eq=False)
class RunSnapshot:
    """What perception and odometry had found at one moment."""

    t_s: float
    pose: Pose
    ring_yaw: float
    echoes: int
    """Number of rows of `Timeline.echoes` up to this moment."""
    segments: Floats
    """(n, 4): ends x, y, x, y (m) of the outline segments in the run's own map."""
    clusters: tuple[Cluster, ...]
    """Of these segments, as the paper's method groups them."""
    objects: tuple[DetectedObject, ...]
    """The models recognised."""
    walls: tuple[DetectedObject, ...] = ()
    """The walls recognised; each has its `ends`."""
    grid: KnownCells | None = None
    """What the evidence grid holds; None where the settings keep none."""
    place: MapPlace | None = None
    """Where the robot is in a map; None where that is not known."""
    corners: tuple[DetectedObject, ...] = ()
    """The inside corners and the edges of walls recognised."""
    polylines: tuple[Polyline, ...] = ()
    """What is not straight."""


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
    """A bookmark and the pose of the robot at that moment."""

    t_s: float
    text: str
    pose: Pose | None


@dataclass(slots=True, eq=False)
class MapView:
    """What a run perceived in the frame of its (last) map, while it knew its place there."""

    known: WorldConfig
    """That map, as it was given."""
    echoes: Echoes
    """The readings of that time."""
    way: Floats
    """(n, 2): the robot's places x, y, m."""
    objects: tuple[DetectedObject, ...]
    """Those reported at the end, each as it was last seen nearby."""
    walls: Floats
    """(n, 4): ends x, y, x, y (m) of the walls recognised at the end."""
    polylines: tuple[Polyline, ...]
    """Those of the end."""


@dataclass(slots=True, eq=False)
class Timeline:
    """A run in the frame of the odometry. Times `t_s` are s of the run's clock after the first cycle or firing."""

    path: Path
    settings: Settings
    world: WorldConfig | None
    """The true world, if it is known."""
    seconds: float = 0.0
    """Duration, s."""
    cycles: int = 0
    """Number of cycles, or of firings in a ring log."""
    cycle_unix: list[tuple[float, int]] = field(default_factory=list)
    """Time (s) and Unix time (ns) of each cycle; empty for a ring log. They differ by more after a pause."""
    echoes: Echoes = field(default_factory=lambda: np.empty(0, ECHO))
    """Every reading of the run, at its pose by odometry."""
    known_echoes: Echoes | None = None
    """The same at poses as known at the end, in odometry's frame of the end; None where none was corrected."""
    known_way: KnownWay | None = None
    """The way as known at the end, in the map frame, which odometry's was at the start; None where no map of it
    corrected odometry."""
    odometry_from_map: Pose = IDENTITY
    """The map frame in odometry's frame of the end."""
    cross_paths: CrossPathRows = field(default_factory=lambda: np.empty(0, CROSS_PATH))
    """Every cross path of the run, in order of time; empty where no sensor listens to others."""
    odometry: list[tuple[float, Odometry]] = field(default_factory=list)
    """At most ten a second. A ring log has the poses of its firings, and a velocity of NaN."""
    snapshots: list[RunSnapshot] = field(default_factory=list)
    """Evenly over the run; the last one is its end."""
    segments: Floats = field(default_factory=_no_rows)
    """(n, 7): the run's own map: first and last seen (s), ends x, y, x, y (m), normal (rad)."""
    map_view: MapView | None = None
    """Only of a run in a known room."""
    modes: list[ModeEntry] = field(default_factory=list)
    log: list[LogEntry] = field(default_factory=list)
    bookmarks: list[BookmarkEntry] = field(default_factory=list)
    cycle_gaps_s: list[float] = field(default_factory=list)
    """Time from each cycle to the next."""
    refinement_stops: dict[str, int] = field(default_factory=dict)
    """How often refinement ended for which cause."""
    counts: LinkCounts | None = None
    """Frames in the recorded bytes of the serial line."""
    summary: dict[str, Any] | None = None
    """The run's own summary; None if it was cut off."""
    versions: dict[str, str] = field(default_factory=dict)
    """Versions of the software that recorded the run."""
    started: str | None = None
    """Date and time, UTC."""
    notes: list[str] = field(default_factory=list)
    """What is missing or damaged, a line each."""

    @property
    def start(self) -> Pose:
        """Where the odometry began, in world coordinates; the origin if the world is not known."""
        if self.world is None:
            return Pose(0.0, 0.0, 0.0)
        start = self.world.start
        return Pose(start.x_m, start.y_m, math.radians(start.heading_deg))

    @property
    def last(self) -> RunSnapshot | None:
        """The snapshot at the end of the run; None without any."""
        return self.snapshots[-1] if self.snapshots else None

    @property
    def objects(self) -> tuple[DetectedObject, ...]:
        """The objects recognised at the end."""
        return self.snapshots[-1].objects if self.snapshots else ()

    @property
    def walls(self) -> tuple[DetectedObject, ...]:
        """The walls recognised at the end."""
        return self.snapshots[-1].walls if self.snapshots else ()

    @property
    def polylines(self) -> tuple[Polyline, ...]:
        """The polylines of the end."""
        return self.snapshots[-1].polylines if self.snapshots else ()

    @property
    def start_unix_ns(self) -> int:
        """Unix time of the first cycle, ns; 0 for a ring log."""
        return self.cycle_unix[0][1] if self.cycle_unix else 0

    def unix_ns(self, t_s: float) -> int:
        """Return the Unix time (ns) of a time of the run; for a ring log, which has none, ns from 0 on."""
        last = max(0, bisect_right(self.cycle_unix, t_s, key=lambda cycle: cycle[0]) - 1)
        from_s, from_ns = self.cycle_unix[last] if self.cycle_unix else (0.0, 0)
        return from_ns + round(1e9 * (t_s - from_s))
