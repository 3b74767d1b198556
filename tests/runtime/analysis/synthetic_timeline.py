"""A short timeline with known contents: three of the hallway's six drums recognised, each 1 cm off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from config.load import load_settings
from drivers.messages import Flags, LinkCounts, Odometry, Pose, Twist
from perception.detected_object import DetectedObject
from perception.localization.localized_pose import KnownWay
from perception.mapping.grid.known_cells import KnownCells
from runtime.analysis.timeline import (
    CROSS_PATH,
    ECHO,
    BookmarkEntry,
    Cluster,
    Echoes,
    LogEntry,
    ModeEntry,
    RunSnapshot,
    Timeline,
)
from tests.polylines import BEND

SETTINGS = load_settings("hallway")
ERROR_M = 0.01
START_NS = 1_700_000_000_000_000_000
SECONDS = 3.0
WALL = DetectedObject("wall", 1.5, 1.5, 0.0, 0.9, 40, 0.97, 0.97, (0.75, 0.0, 0.0), 7, sigma_theta=0.01)
"""Number 7, 3 m long."""


def synthetic_timeline(*, with_world: bool = True) -> Timeline:
    """Return a run of four snapshots, the first without objects; the robot drives 0.3 m ahead each second."""
    world = SETTINGS.world
    assert world is not None
    timeline = Timeline(Path("synthetic.mcap"), SETTINGS, world if with_world else None, SECONDS, cycles=60)
    start = Pose(world.start.x_m, world.start.y_m, 0.0).inverse()
    drums = [start.compose(Pose(d.x_m, d.y_m, 0.0)) for d in world.drum[:3]]
    objects = tuple(
        DetectedObject("drum", p.x + ERROR_M, p.y, -1.5, 0.01, 9 + k, 0.9, covariance=(1e-4, 0.0, 1e-4))
        for k, p in enumerate(drums)
    )
    edges = np.array([(p.x - 0.1, p.y - 0.3, p.x + 0.1, p.y - 0.3) for p in drums])
    least = SETTINGS.perception.clusters.segments_min
    clusters = tuple(
        Cluster(p.x, p.y - 0.3, p.x - 0.1, p.y - 0.4, p.x + 0.1, p.y - 0.2, least - (k == 2))
        for k, p in enumerate(drums)
    )
    timeline.echoes = _echoes(drums)
    for k in range(4):
        pose = Pose(0.3 * k, 0.0, 0.0)
        walls = (WALL,) if k == 3 else ()
        timeline.snapshots.append(
            RunSnapshot(float(k), pose, 0.0, 4 * k, edges[:k], clusters[:k], objects[:k], walls)
        )
        timeline.odometry.append((float(k), Odometry(5.0 + k, pose, 0.0, Twist(0.3, 0.0), Flags.NONE, 0)))
    timeline.segments = np.column_stack([np.zeros(3), np.full(3, SECONDS), edges, np.full(3, -1.57)])
    timeline.cycle_unix = [(0.05 * k, START_NS + 50_000_000 * k) for k in range(60)]
    timeline.cycle_gaps_s = [0.05] * 59
    timeline.modes = [ModeEntry(0.0, "READY", None), ModeEntry(0.5, "DRIVE", None)]
    timeline.log = [LogEntry(1.0, "warning", "sensor 7 never answers")]
    timeline.bookmarks = [BookmarkEntry(1.5, "here", Pose(0.45, 0.0, 0.0))]
    timeline.refinement_stops = {"budget": 20, "nothing": 40}
    timeline.counts = LinkCounts(300, 1, 2)
    return timeline


def with_cross_paths(timeline: Timeline) -> Timeline:
    """Return the timeline with three cross paths from sensor 6 to sensor 7 at its end; the last is silent."""
    rows = np.empty(3, CROSS_PATH)
    for k, half_m in enumerate((1.0, 1.5, np.inf)):
        place = (0.0, 0.381, np.pi / 2, -0.0986, 0.368, np.radians(105.0))
        rows[k] = (SECONDS, 6, 7, *place, half_m, 5.0 + SECONDS)
    timeline.cross_paths = rows
    return timeline


def with_grid(timeline: Timeline) -> Timeline:
    """Return the timeline with an evidence grid of two rows and three columns at its end."""
    cells = np.array([[-1, 10, 90], [50, -1, 100]], np.int8)
    timeline.snapshots[-1] = replace(timeline.snapshots[-1], grid=KnownCells(cells, 1.0, -0.5, 0.1))
    return timeline


def with_known_way(timeline: Timeline) -> Timeline:
    """Return the timeline with a way as known at the end, by three maps of it and one loop closure."""
    path = np.array([[0.0, 0.0], [0.5, 0.1], [1.0, 0.3]])
    spreads = np.array([[0.0, 0.0, 0.0], [0.003, 0.001, 0.002], [0.01, 0.0, 0.01]])
    timeline.known_way = KnownWay(path, np.column_stack([path, spreads]), np.array([[0.0, 0.0, 1.0, 0.3]]))
    return timeline


def with_polyline(timeline: Timeline) -> Timeline:
    """Return the timeline with a polyline at its end."""
    timeline.snapshots[-1] = replace(timeline.snapshots[-1], polylines=(BEND,))
    return timeline


def _echoes(drums: list[Pose]) -> Echoes:
    """Return four readings of sensor 6 of each drum, from below it; the fourth hears nothing."""
    rows = np.empty(4 * len(drums), ECHO)
    for k, drum in enumerate(drums):
        for j in range(4):
            time_s = k + 0.2 * j
            reach = np.inf if j == 3 else drum.y - 0.3048 - 0.381
            rows[4 * k + j] = (time_s, 6, drum.x + 0.01 * j, 0.381, np.pi / 2, reach, 5.0 + time_s)
    return rows
