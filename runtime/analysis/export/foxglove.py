"""Export of a run for Foxglove: an MCAP file with Foxglove's own schemas, written by its SDK.

Topics and frames are those of the live bridge (`runtime.analysis.export.foxglove_messages`). Two topics more show
what the bridge does not have: `/clusters` and the evidence grid.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final, TypeVar

import foxglove
from foxglove import channels as ch
from foxglove import messages as fx

from drivers.messages import Pose
from perception.mapping.grid.known_cells import KnownCells
from runtime.analysis.export.foxglove_messages import (
    Outline,
    RunChannels,
    foxglove_pose,
    line,
    object_label,
    scene,
    stamp,
)
from runtime.analysis.export.shapes import CLUSTER, FiringScan, even_radius, firing_scans, truth_outlines, whole_ring
from runtime.analysis.plots.cross_arcs import newest_cross_paths
from runtime.analysis.plots.geometry import outline
from runtime.analysis.timeline import Cluster, LogEntry, RunSnapshot, Timeline

CROSS_M: Final = 0.08
"""Half the size of the cross at a cluster's centre, m."""

T = TypeVar("T")


def write_foxglove(timeline: Timeline, path: Path) -> list[Path]:
    """Write a run as an MCAP file for Foxglove and return the file.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    context = foxglove.Context()
    with path.open("wb") as file:
        file_guard = _ErrorKeepingFile(file)
        try:
            with foxglove.open_mcap(file_guard, context=context):
                _RunExporter(timeline, context).write()
        except RuntimeError:
            if file_guard.error is None:
                raise
            raise file_guard.error from None
    return [path]


class _ErrorKeepingFile:
    """A file that keeps its OSError: the SDK reports only that something went wrong."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: OSError | None = None

    def write(self, data: bytes | bytearray) -> int:
        """Write, as a file does."""
        return self._keep_error(lambda: self._file.write(data))

    def seek(self, offset: int, whence: int = 0) -> int:
        """Seek, as a file does."""
        return self._keep_error(lambda: self._file.seek(offset, whence))

    def flush(self) -> None:
        """Flush, as a file does."""
        self._keep_error(self._file.flush)

    def _keep_error(self, act: Callable[[], T]) -> T:
        try:
            return act()
        except OSError as error:
            self.error = self.error or error
            raise


class _RunExporter:
    """Writes a run into Foxglove channels."""

    def __init__(self, timeline: Timeline, context: foxglove.Context) -> None:
        self._timeline = timeline
        self._models = {model.name: model for model in timeline.settings.models}
        self._whole = timeline.settings.perception.method == "bayes"
        self._run = RunChannels(context)
        self._clusters = ch.SceneUpdateChannel("/clusters", context=context)
        self._grid = ch.GridChannel("/grid", context=context)

    def write(self) -> None:
        """Write everything, in order of time."""
        timeline = self._timeline
        items: list[tuple[float, Callable[[int], None]]] = [(0.0, self._write_truth)]
        items += [(t, partial(self._write_pose, odometry.pose)) for t, odometry in timeline.odometry]
        items += [(scan.t_s, partial(self._write_scan, scan)) for scan in firing_scans(timeline)]
        items += [(snapshot.t_s, partial(self._write_snapshot, snapshot)) for snapshot in timeline.snapshots]
        items += [(max(0.0, entry.t_s), partial(self._write_log_entry, entry)) for entry in timeline.log]
        for t_s, write in sorted(items, key=lambda item: item[0]):
            write(timeline.unix_ns(t_s))

    def _write_truth(self, at: int) -> None:
        closed, lines = truth_outlines(self._timeline)
        if closed or lines:
            self._run.write_truth(closed, lines, at)

    def _write_pose(self, pose: Pose, at: int) -> None:
        self._run.write_frames([("odom", "base", pose)], at)
        self._run.write_pose(pose, at)

    def _write_scan(self, scan: FiringScan, at: int) -> None:
        """Write a firing: one scan for an even ring, otherwise an arc for each sensor."""
        ring = self._timeline.settings.ring
        radius = even_radius(ring.mounts)
        if radius is not None:
            self._run.write_ring(Pose(scan.x, scan.y, scan.yaw), whole_ring(len(ring.mounts), radius, scan), at)
            return
        half = math.radians(ring.beam_half_angle_deg)
        for row in scan.rows:
            self._run.write_arc(Pose(row["x"], row["y"], row["bearing"]), half, row["range_m"], at)

    def _write_snapshot(self, snapshot: RunSnapshot, at: int) -> None:
        """Write what perception had found, in `odom`, and where that is in the map; corners are not drawn."""
        settings = self._timeline.settings
        if snapshot.place is not None:
            self._run.write_frames([("map", "odom", snapshot.place.map_in_odom.inverse())], at)
        if len(self._timeline.cross_paths):
            newest = newest_cross_paths(self._timeline.cross_paths, snapshot.t_s)
            self._run.write_cross_paths(newest, math.radians(settings.ring.beam_half_angle_deg), at)
        self._run.write_segments(snapshot.segments.reshape(-1, 2).tolist(), at)
        scene(self._clusters, "clusters", _cluster_lines(snapshot.clusters), [], at)
        outlines = [outline(seen, self._models.get(seen.model), whole=self._whole) for seen in snapshot.objects]
        drawn: list[Outline] = [(points.tolist(), closed) for points, closed in outlines]
        drawn += [((wall.ends[:2], wall.ends[2:]), False) for wall in snapshot.walls if wall.ends is not None]
        polylines = [one.points.tolist() for one in snapshot.polylines]
        labels = [(seen.x, seen.y, object_label(seen.number, seen.model, seen.score)) for seen in snapshot.objects]
        self._run.write_objects(drawn, polylines, labels, at)
        if snapshot.grid is not None and snapshot.grid.percent.size:
            self._grid.log(_grid(snapshot.grid, at), log_time=at)

    def _write_log_entry(self, entry: LogEntry, at: int) -> None:
        self._run.write_log(entry.level, entry.text, at)


def _cluster_lines(clusters: Iterable[Cluster]) -> list[fx.LinePrimitive]:
    """Return the rectangle around each cluster, and a cross at its centre."""
    lines = []
    for c in clusters:
        corners = [(c.left, c.bottom), (c.right, c.bottom), (c.right, c.top), (c.left, c.top)]
        lines.append(line(corners, CLUSTER, closed=True))
        for up in (CROSS_M, -CROSS_M):
            stroke = [(c.x - CROSS_M, c.y - up), (c.x + CROSS_M, c.y + up)]
            lines.append(line(stroke, CLUSTER, closed=False))
    return lines


def _grid(known: KnownCells, at: int) -> fx.Grid:
    """Return the evidence grid: per cent occupied in each cell, −1 where nothing is known."""
    return fx.Grid(
        timestamp=stamp(at),
        frame_id="odom",
        pose=foxglove_pose(known.x_m, known.y_m, 0.0),
        column_count=known.percent.shape[1],
        cell_size=fx.Vector2(x=known.cell_m, y=known.cell_m),
        row_stride=known.percent.shape[1],
        cell_stride=1,
        fields=[fx.PackedElementField(name="occupied", offset=0, type=fx.PackedElementFieldNumericType.Int8)],
        data=known.percent.tobytes(),
    )
