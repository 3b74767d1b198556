"""Export of a run for Foxglove: an MCAP file with Foxglove's own schemas, written by its SDK.

Frames: `map` (while the robot knows its place in one) → `odom` → `base`, which turns with the wheels. Echoes are in
`odom`, from the pose that the ring had at their firing; so is the true world, where the odometry began.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final, TypeVar

import foxglove
from foxglove import channels as ch
from foxglove import messages as fx

from drivers.messages import Pose
from perception.mapping.grid.known_cells import KnownCells
from runtime.analysis.export.shapes import (
    CLUSTER,
    CROSS,
    HEIGHT_M,
    MODEL,
    SEGMENT,
    TRUTH,
    Colour,
    FiringScan,
    even_radius,
    firing_scans,
    truth_outlines,
    whole_ring,
    yaw_quaternion,
)
from runtime.analysis.plots.cross_arcs import cross_arcs, heard_cross_paths, newest_cross_paths
from runtime.analysis.plots.geometry import outline
from runtime.analysis.timeline import CrossPathRows, LogEntry, RunSnapshot, Timeline

ARC_POINTS: Final = 9
LINE_PX: Final = 2.0
CROSS_M: Final = 0.08

T = TypeVar("T")
Places = Iterable[Iterable[float]]


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
        self._frames = ch.FrameTransformsChannel("/tf", context=context)
        self._pose = ch.PoseInFrameChannel("/pose", context=context)
        self._ring = ch.LaserScanChannel("/ring", context=context)
        self._crosses = ch.SceneUpdateChannel("/cross_paths", context=context)
        self._segments = ch.SceneUpdateChannel("/segments", context=context)
        self._clusters = ch.SceneUpdateChannel("/clusters", context=context)
        self._objects = ch.SceneUpdateChannel("/models", context=context)
        self._truth = ch.SceneUpdateChannel("/truth", context=context)
        self._grid = ch.GridChannel("/grid", context=context)
        self._log = ch.LogChannel("/log", context=context)

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
        drawn = [line(points, TRUTH, closed=True) for points in closed]
        drawn += [line(points, TRUTH, closed=False) for points in lines]
        if drawn:
            scene(self._truth, "truth", drawn, [], at)

    def _frame(self, parent: str, child: str, pose: Pose, at: int) -> None:
        frame = fx.FrameTransform(
            timestamp=stamp(at), parent_frame_id=parent, child_frame_id=child,
            translation=fx.Vector3(x=pose.x, y=pose.y, z=0.0), rotation=quaternion(pose.theta),
        )  # fmt: skip
        self._frames.log(fx.FrameTransforms(transforms=[frame]), log_time=at)

    def _write_pose(self, pose: Pose, at: int) -> None:
        self._frame("odom", "base", pose, at)
        message = fx.PoseInFrame(timestamp=stamp(at), frame_id="odom", pose=placed(pose.x, pose.y, pose.theta))
        self._pose.log(message, log_time=at)

    def _write_scan(self, scan: FiringScan, at: int) -> None:
        """Write a firing: one scan for an even ring, otherwise an arc for each sensor."""
        ring = self._timeline.settings.ring
        radius, sensors = even_radius(ring.mounts), len(ring.mounts)
        if radius is not None:
            message = fx.LaserScan(
                timestamp=stamp(at), frame_id="odom", pose=placed(scan.x, scan.y, scan.yaw), start_angle=0.0,
                end_angle=2.0 * math.pi * (sensors - 1) / sensors, ranges=whole_ring(sensors, radius, scan),
            )  # fmt: skip
            self._ring.log(message, log_time=at)
            return
        half = math.radians(ring.beam_half_angle_deg)
        for row in scan.rows:
            message = fx.LaserScan(
                timestamp=stamp(at), frame_id="odom", pose=placed(row["x"], row["y"], row["bearing"]),
                start_angle=-half, end_angle=half, ranges=[row["range_m"]] * ARC_POINTS,
            )  # fmt: skip
            self._ring.log(message, log_time=at)

    def _write_snapshot(self, snapshot: RunSnapshot, at: int) -> None:
        settings = self._timeline.settings
        if snapshot.place is not None:
            self._frame("map", "odom", snapshot.place.map_in_odom.inverse(), at)
        if len(self._timeline.cross_paths):
            newest = newest_cross_paths(self._timeline.cross_paths, snapshot.t_s)
            write_cross_paths(self._crosses, newest, math.radians(settings.ring.beam_half_angle_deg), at)
        write_segments(self._segments, snapshot.segments.reshape(-1, 2).tolist(), at)
        boxes = []
        for c in snapshot.clusters:
            corners = [(c.left, c.bottom), (c.right, c.bottom), (c.right, c.top), (c.left, c.top)]
            boxes.append(line(corners, CLUSTER, closed=True))
            for up in (CROSS_M, -CROSS_M):
                stroke = [(c.x - CROSS_M, c.y - up), (c.x + CROSS_M, c.y + up)]
                boxes.append(line(stroke, CLUSTER, closed=False))
        scene(self._clusters, "clusters", boxes, [], at)
        shapes, texts = [], []
        for number, seen in enumerate(snapshot.objects, 1):
            points, closed = outline(seen, self._models.get(seen.model), whole=self._whole)
            shapes.append(line(points.tolist(), MODEL, closed=closed))
            text = fx.TextPrimitive(
                pose=placed(seen.x, seen.y, 0.0, HEIGHT_M), billboard=True, font_size=0.15, color=colour(MODEL),
                text=f"{number} {seen.model} {seen.score:.2f}",
            )  # fmt: skip
            texts.append(text)
        scene(self._objects, "models", shapes, texts, at)
        if snapshot.grid is not None and snapshot.grid.percent.size:
            self._grid.log(_grid(snapshot.grid, at), log_time=at)

    def _write_log_entry(self, entry: LogEntry, at: int) -> None:
        write_log(self._log, entry.level, entry.text, at)


def _grid(known: KnownCells, at: int) -> fx.Grid:
    """Return the evidence grid: per cent occupied in each cell, −1 where nothing is known."""
    return fx.Grid(
        timestamp=stamp(at), frame_id="odom", pose=placed(known.x_m, known.y_m, 0.0),
        column_count=known.percent.shape[1], cell_size=fx.Vector2(x=known.cell_m, y=known.cell_m),
        row_stride=known.percent.shape[1], cell_stride=1,
        fields=[fx.PackedElementField(name="occupied", offset=0, type=fx.PackedElementFieldNumericType.Int8)],
        data=known.percent.tobytes(),
    )  # fmt: skip


def write_cross_paths(channel: ch.SceneUpdateChannel, rows: CrossPathRows, half_angle: float, at: int) -> None:
    """Replace the arcs of cross paths at a time (ns); `half_angle` is that of a beam, rad."""
    arcs = cross_arcs(heard_cross_paths(rows), half_angle).tolist()
    scene(channel, "cross_paths", [line(points, CROSS, closed=False) for points in arcs], [], at)


def scene(
    channel: ch.SceneUpdateChannel,
    name: str,
    lines: list[fx.LinePrimitive],
    texts: list[fx.TextPrimitive],
    at: int,
) -> None:
    """Replace an entity as a whole at a time (ns), so that elements that are gone disappear.

    Parameters
    ----------
    channel, name
        Where, and the entity's id.
    lines, texts
        What it consists of, in the frame `odom`.
    at
        Nanoseconds since 1970.
    """
    entity = fx.SceneEntity(timestamp=stamp(at), frame_id="odom", id=name, lines=lines, texts=texts)
    channel.log(fx.SceneUpdate(entities=[entity]), log_time=at)


def write_segments(channel: ch.SceneUpdateChannel, ends: Sequence[Sequence[float]], at: int) -> None:
    """Replace the outline segments at a time (ns): points x, y (m), two a segment."""
    many = fx.LinePrimitive(
        type=fx.LinePrimitiveLineType.LineList, thickness=LINE_PX, scale_invariant=True,
        points=[fx.Point3(x=x, y=y) for x, y in ends], color=colour(SEGMENT),
    )  # fmt: skip
    scene(channel, "segments", [many] if ends else [], [], at)


def write_log(channel: ch.LogChannel, level: str, text: str, at: int) -> None:
    """Write a line of the log at a time (ns)."""
    levels = {"debug": fx.LogLevel.Debug, "warning": fx.LogLevel.Warning, "error": fx.LogLevel.Error}
    level_of = levels.get(level, fx.LogLevel.Info)
    channel.log(fx.Log(timestamp=stamp(at), level=level_of, message=text, name="echolocate"), log_time=at)


def line(points: Places, rgb: Colour, *, closed: bool) -> fx.LinePrimitive:
    """Return a line through points (m), or the loop that they close."""
    kind = fx.LinePrimitiveLineType.LineLoop if closed else fx.LinePrimitiveLineType.LineStrip
    places = [fx.Point3(x=x, y=y) for x, y in points]
    return fx.LinePrimitive(type=kind, thickness=LINE_PX, scale_invariant=True, points=places, color=colour(rgb))


def stamp(at: int) -> fx.Timestamp:
    """Return a time, ns since 1970."""
    return fx.Timestamp(sec=at // 1_000_000_000, nsec=at % 1_000_000_000)


def quaternion(yaw: float) -> fx.Quaternion:
    """Return a rotation about the vertical, rad."""
    x, y, z, w = yaw_quaternion(yaw)
    return fx.Quaternion(x=x, y=y, z=z, w=w)


def placed(x: float, y: float, yaw: float, z: float = 0.0) -> fx.Pose:
    """Return a pose from place (m) and direction (rad)."""
    return fx.Pose(position=fx.Vector3(x=x, y=y, z=z), orientation=quaternion(yaw))


def colour(rgb: Colour) -> fx.Color:
    """Return an opaque colour."""
    return fx.Color(r=rgb[0], g=rgb[1], b=rgb[2], a=1.0)
