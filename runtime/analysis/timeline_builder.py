"""Construction of a timeline from a replay: echoes, the path, and snapshots at even intervals.

Segments and clusters are those that the console shows: the run's own segments, grouped as the paper's method does.
Memory is bounded: the snapshots of a long run are farther apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from config.world import WorldConfig
from drivers.messages import Firing, Floats, Odometry, Pose
from perception.detected_object import DetectedObject, turned_object
from perception.localization.localized_pose import Moment
from perception.localization.odometry_frame import OdometryFrame
from perception.mapping.grid.known_cells import known_cells
from perception.paper.cluster_view import ClusterView
from perception.pipeline import Perception
from perception.sensor_mounts import mounts_array, mounts_at
from runtime.analysis.timeline import (
    CROSS_PATH,
    ECHO,
    Cluster,
    CrossPathRows,
    Echoes,
    MapPlace,
    MapView,
    RunSnapshot,
    Timeline,
)

CORNERS: Final = frozenset({"inside corner", "edge"})
"""The labels of the points at which walls end."""
SNAPSHOTS_MAX: Final = 240
"""Snapshots kept. At this number every second one is dropped and the interval doubles."""
FIRST_INTERVAL_S: Final = 0.25
ODOMETRY_INTERVAL_S: Final = 0.1
DIGITS: Final = 4
"""Decimals of a coordinate (m) by which a segment is recognised as the same."""


class TimelineBuilder:
    """Fills a timeline while a run is replayed.

    It is complete once `finish` was called. Snapshots are `interval_s` apart at first.
    """

    def __init__(self, timeline: Timeline, interval_s: float = FIRST_INTERVAL_S) -> None:
        settings = timeline.settings
        self._timeline = timeline
        self._mounts, self._turning = mounts_array(settings.ring.mounts), settings.ring.turning
        self._interval_s = interval_s
        self._next_s = 0.0
        """When the next snapshot is due."""
        self._rows: list[Echoes] = []
        """Readings of each firing."""
        self._row_count = 0
        """How many readings they are."""
        self._crosses: list[CrossPathRows] = []
        """Cross paths of each firing."""
        self._segments: dict[bytes, tuple[float, float, Floats]] = {}
        """When each was seen first and last, and its row, by its rounded bytes."""
        self._pose: Pose | None = None
        """Of the last firing or odometry; None before both."""
        self._yaw = 0.0
        self._clusters = ClusterView(settings.perception)
        self._placed: list[tuple[Pose, Echoes]] = []
        """Pose in the map and readings in its frame, of each firing while the place was known."""
        self._near_map: dict[int | None, DetectedObject] = {}
        """Objects in the frame of the map, by number."""
        self._room: WorldConfig | None = None
        """The map to which both belong."""
        self._unplaced = 0
        """Firings that `_place_in_map` has passed."""
        self._moments: list[tuple[int, Moment]] = []
        """Moments of the map frame, and how many firings there were by then."""

    @property
    def pose(self) -> Pose | None:
        """Where the robot is, by the last firing or odometry; None before both."""
        return self._pose

    def restart(self, t_s: float) -> None:
        """Discard everything so far, as a run does when the robot and its odometry restart."""
        self._timeline.notes.append(f"the robot restarted after {t_s:.1f} s; nothing before that is shown")
        self._rows, self._row_count, self._segments, self._pose = [], 0, {}, None
        self._crosses = []
        self._placed, self._near_map, self._unplaced, self._moments = [], {}, 0, []
        self._timeline.snapshots, self._timeline.odometry = [], []

    def add_firing(self, t_s: float, firing: Firing) -> None:
        """Add the echoes and cross paths of a firing received at `t_s`."""
        c, s = math.cos(firing.ring_yaw), math.sin(firing.ring_yaw)
        mounts = mounts_at(firing, self._mounts, self._turning)
        x = firing.pose.x + c * mounts[:, 0] - s * mounts[:, 1]
        y = firing.pose.y + s * mounts[:, 0] + c * mounts[:, 1]
        bearing = firing.ring_yaw + mounts[:, 2]
        fired = np.flatnonzero(~np.isnan(firing.ranges_m))
        rows = np.empty(len(fired), ECHO)
        rows["t_s"], rows["sensor"], rows["robot_s"] = t_s, fired, firing.robot_s
        rows["x"], rows["y"], rows["bearing"], rows["range_m"] = (
            x[fired],
            y[fired],
            bearing[fired],
            firing.ranges_m[fired],
        )
        self._rows.append(rows)
        if (heard := firing.cross_paths) is not None:
            crosses = np.empty(len(heard.listeners), CROSS_PATH)
            crosses["t_s"], crosses["robot_s"], crosses["half_path_m"] = t_s, firing.robot_s, heard.half_paths_m
            for prefix, name, of in (
                ("", "transmitter", heard.transmitters),
                ("listener_", "listener", heard.listeners),
            ):
                crosses[name] = of
                crosses[prefix + "x"], crosses[prefix + "y"], crosses[prefix + "bearing"] = x[of], y[of], bearing[of]
            self._crosses.append(crosses)
        self._row_count += len(rows)
        self._pose, self._yaw = firing.pose, firing.ring_yaw

    def add_odometry(self, t_s: float, odometry: Odometry) -> None:
        """Add the robot's odometry at `t_s`, unless the last one is too recent."""
        self._pose, self._yaw = odometry.pose, odometry.ring_yaw
        path = self._timeline.odometry
        if not path or t_s - path[-1][0] >= ODOMETRY_INTERVAL_S:
            path.append((t_s, odometry))

    def end_cycle(self, t_s: float, perception: Perception) -> None:
        """Take a snapshot of what is known after the cycle at `t_s` if one is due."""
        self._timeline.seconds = t_s
        if perception.known_room is not None:
            self._place_in_map(perception)
        moment = perception.map_frame.moment()
        if moment is not None and len(self._rows) > (self._moments[-1][0] if self._moments else 0):
            self._moments.append((len(self._rows), moment))
        if t_s >= self._next_s:
            self._next_s = t_s + self._interval_s
            self._add_snapshot(t_s, perception)

    def finish(self, perception: Perception | None) -> None:
        """Complete the timeline with a snapshot of the end; `perception` is None if there was no cycle."""
        timeline = self._timeline
        if perception is not None and (not timeline.snapshots or timeline.snapshots[-1].t_s < timeline.seconds):
            self._add_snapshot(timeline.seconds, perception)
        if perception is not None and perception.room is not None:
            timeline.map_view = self._map_view(perception, perception.room)
        if self._rows:
            timeline.echoes = np.concatenate(self._rows)
            if perception is not None and perception.map_frame.corrects_path:
                timeline.known_echoes = self._known_echoes(perception.map_frame)
                timeline.known_way = perception.map_frame.known_way()
                timeline.odometry_from_map = perception.odometry_from_map()
        if self._crosses:
            timeline.cross_paths = np.concatenate(self._crosses)
        if self._segments:
            timeline.segments = np.array([[first, last, *row] for first, last, row in self._segments.values()])

    def _known_echoes(self, frame: OdometryFrame) -> Echoes:
        """Return all readings, each from where the robot is known now to have been at its time."""
        known, begin = list[Echoes](), 0
        for end, moment in self._moments:
            to = frame.moved_since(moment)
            known += [_turned_echoes(to, rows) for rows in self._rows[begin:end]]
            begin = end
        return np.concatenate([*known, *self._rows[begin:]])

    def _place_in_map(self, perception: Perception) -> None:
        """Keep the readings since the last cycle, and the objects nearby, in the map frame as it is known now."""
        rows, self._unplaced = self._rows[self._unplaced :], len(self._rows)
        if perception.room is not self._room:  # another map: places in it mean others
            self._placed, self._near_map, self._room = [], {}, perception.room
        here = perception.localized()
        if here is None or here.status != "tracking":
            return
        to = perception.odometry_from_map().inverse()
        self._placed += [(here.pose, _turned_echoes(to, row)) for row in rows]
        for seen in perception.near_objects():
            self._near_map[seen.number] = turned_object(to, seen)

    def _map_view(self, perception: Perception, known: WorldConfig) -> MapView:
        """Return the known room with the readings and objects in its frame; only objects that still exist."""
        numbers = {seen.number for seen in perception.objects()}
        to = perception.odometry_from_map().inverse()
        walls = tuple(turned_object(to, seen) for seen in walls_of(perception))
        return MapView(
            known,
            np.concatenate([np.empty(0, ECHO), *(rows for _, rows in self._placed)]),
            np.array([(pose.x, pose.y) for pose, _ in self._placed]).reshape(-1, 2),
            tuple(seen for number, seen in self._near_map.items() if number in numbers),
            wall_ends(walls),
            tuple(one.in_frame(to) for one in perception.polylines()),
        )

    def _add_snapshot(self, t_s: float, perception: Perception) -> None:
        """Take a snapshot; at `SNAPSHOTS_MAX` every second one goes, and the interval doubles. None before a pose."""
        rows = perception.segment_geometry()
        for key, row in zip((r.tobytes() for r in np.round(rows, DIGITS)), rows, strict=True):
            first = self._segments[key][0] if key in self._segments else t_s
            self._segments[key] = (first, t_s, row)
        if self._pose is None:
            return
        snapshots = self._timeline.snapshots
        if len(snapshots) >= SNAPSHOTS_MAX:
            del snapshots[1::2]
            self._interval_s *= 2.0
        window = perception.occupancy()
        snapshots.append(
            RunSnapshot(
                t_s,
                self._pose,
                self._yaw,
                self._row_count,
                rows[:, :4],
                self._clusters_of(rows),
                perception.objects(),
                walls_of(perception),
                None if window is None else known_cells(window),
                _place_of(perception),
                corners_of(perception),
                perception.polylines(),
            )
        )

    def _clusters_of(self, segments: Floats) -> tuple[Cluster, ...]:
        """Return the clusters of segments, (n, 6) as of `segment_geometry`."""
        return tuple(
            Cluster(
                box.centre_x,
                box.centre_y,
                box.x - 0.5 * box.length,
                box.y - 0.5 * box.width,
                box.x + 0.5 * box.length,
                box.y + 0.5 * box.width,
                box.segments,
            )
            for box in self._clusters.boxes(segments)
        )


def _turned_echoes(to: Pose, echoes: Echoes) -> Echoes:
    """Return readings in another frame, in which the present origin lies at `to`."""
    turned, c, s = echoes.copy(), math.cos(to.theta), math.sin(to.theta)
    turned["x"] = to.x + c * echoes["x"] - s * echoes["y"]
    turned["y"] = to.y + s * echoes["x"] + c * echoes["y"]
    turned["bearing"] += to.theta
    return turned


def _place_of(perception: Perception) -> MapPlace | None:
    here, map_in_odom = perception.localized(), perception.known_map_frame()
    return None if here is None or map_in_odom is None else MapPlace(here.pose, here.covariance, map_in_odom)


def walls_of(perception: Perception) -> tuple[DetectedObject, ...]:
    """Return the walls that perception reports."""
    return tuple(seen for seen in perception.labelled_objects() if seen.ends is not None)


def corners_of(perception: Perception) -> tuple[DetectedObject, ...]:
    """Return the inside corners and edges that perception reports."""
    return tuple(seen for seen in perception.labelled_objects() if seen.model in CORNERS)


def wall_ends(walls: Sequence[DetectedObject]) -> Floats:
    """Return the ends x, y, x, y of walls, m; shape (n, 4)."""
    return np.array([wall.ends for wall in walls]).reshape(-1, 4)
