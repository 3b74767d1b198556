"""Export of a run as a ROS 2 bag, without ROS: ranges, odometry, markers and frames, written by rosbags.

Topics: `/sonar/s00` … (sensor_msgs/Range), each in its own frame below `ring`; `/odom`; `/markers`, with the arcs of
cross paths; `/grid` (nav_msgs/OccupancyGrid), where the run kept an evidence grid; `/tf` and `/tf_static`. The frame
`ring` is the pose of the ring at the last firing: on a synchro drive it does not turn with `base_link`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from drivers.messages import Odometry, Pose
from perception.mapping.grid.known_cells import KnownCells
from runtime.analysis.export.shapes import (
    CLUSTER,
    CROSS,
    MODEL,
    SEGMENT,
    TRUTH,
    Colour,
    FiringScan,
    firing_scans,
    yaw_quaternion,
)
from runtime.analysis.plots.cross_arcs import cross_arcs, heard_cross_paths, newest_cross_paths
from runtime.analysis.plots.geometry import outline, world_outlines
from runtime.analysis.timeline import RunSnapshot, Timeline

if TYPE_CHECKING:
    from rosbags.typesys.store import Msg, Msgarg

VERSION: Final = 9
LINE_M: Final = 0.02
STRIP, LINES = 4, 5
"""Types of `visualization_msgs/Marker`."""
DELETE_ALL: Final = 3

Points = list[tuple[float, float]]


def write_bag(timeline: Timeline, folder: Path) -> list[Path]:
    """Write a run as a ROS 2 bag and return its folder, which must not exist yet; its storage is MCAP.

    Raises
    ------
    OSError
        It cannot be written.
    """
    with Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        _RunExporter(timeline, writer).write()
    return [folder]


class _RunExporter:
    """Writes a run into a bag."""

    def __init__(self, timeline: Timeline, writer: Writer) -> None:
        self._timeline = timeline
        self._writer = writer
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._connections: dict[str, Any] = {}
        self._models = {model.name: model for model in timeline.settings.models}
        self._whole = timeline.settings.perception.method == "bayes"

    def write(self) -> None:
        """Write everything, in order of time."""
        timeline = self._timeline
        items: list[tuple[float, Callable[[int], None]]] = [(0.0, self._write_static)]
        items += [(t, partial(self._write_odometry, odometry)) for t, odometry in timeline.odometry]
        items += [(scan.t_s, partial(self._write_scan, scan)) for scan in firing_scans(timeline)]
        items += [(snapshot.t_s, partial(self._write_snapshot, snapshot)) for snapshot in timeline.snapshots]
        if not timeline.odometry:
            items += [(m.t_s, partial(self._write_base, m.pose)) for m in timeline.snapshots]
        for t_s, write in sorted(items, key=lambda item: item[0]):
            write(timeline.unix_ns(t_s))

    def _make(self, kind: str, **values: Msgarg) -> Msg:
        return self._store.types[kind](**values)

    def _write(self, topic: str, kind: str, message: object, at: int) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(self._connections[topic], at, self._store.serialize_cdr(message, kind))

    def _time(self, at: int) -> Msg:
        return self._make("builtin_interfaces/msg/Time", sec=at // 1_000_000_000, nanosec=at % 1_000_000_000)

    def _header(self, frame: str, at: int) -> Msg:
        return self._make("std_msgs/msg/Header", stamp=self._time(at), frame_id=frame)

    def _vector(self, x: float, y: float, z: float = 0.0) -> Msg:
        return self._make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def _point(self, x: float, y: float) -> Msg:
        return self._make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=0.0)

    def _turn(self, yaw: float) -> Msg:
        x, y, z, w = yaw_quaternion(yaw)
        return self._make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def _placed(self, pose: Pose) -> Msg:
        return self._make(
            "geometry_msgs/msg/Pose", position=self._point(pose.x, pose.y), orientation=self._turn(pose.theta)
        )

    def _frames(self, topic: str, frames: list[tuple[str, str, Pose]], at: int) -> None:
        message = [
            self._make(
                "geometry_msgs/msg/TransformStamped", header=self._header(parent, at), child_frame_id=child,
                transform=self._make(
                    "geometry_msgs/msg/Transform", translation=self._vector(pose.x, pose.y),
                    rotation=self._turn(pose.theta),
                ),
            )
            for parent, child, pose in frames
        ]  # fmt: skip
        self._write(topic, "tf2_msgs/msg/TFMessage", self._make("tf2_msgs/msg/TFMessage", transforms=message), at)

    def _write_static(self, at: int) -> None:
        """Write what never moves: the sensors on the ring, the start of the odometry, the true world."""
        ring = self._timeline.settings.ring
        mounts = ((i, mount) for i, mount in enumerate(ring.mounts) if i not in ring.turning)
        sensors = [("ring", f"sonar_{i:02d}", Pose(*mount)) for i, mount in mounts]
        self._frames("/tf_static", [("world", "odom", self._timeline.start), *sensors], at)
        if self._timeline.world is not None:
            closed, lines = world_outlines(self._timeline.world)
            rows = [*((_looped(points.tolist())) for points in closed), *(points.tolist() for points in lines)]
            markers = [self._marker("truth", i, STRIP, row, TRUTH, at, "world") for i, row in enumerate(rows)]
            self._markers("/truth", markers, at)

    def _write_base(self, pose: Pose, at: int) -> None:
        self._frames("/tf", [("odom", "base_link", pose)], at)

    def _write_odometry(self, odometry: Odometry, at: int) -> None:
        self._write_base(odometry.pose, at)
        unknown = np.zeros(36)
        twist = self._make(
            "geometry_msgs/msg/Twist", linear=self._vector(odometry.twist.v, 0.0),
            angular=self._vector(0.0, 0.0, odometry.twist.w),
        )  # fmt: skip
        message = self._make(
            "nav_msgs/msg/Odometry", header=self._header("odom", at), child_frame_id="base_link",
            pose=self._make(
                "geometry_msgs/msg/PoseWithCovariance", pose=self._placed(odometry.pose), covariance=unknown
            ),
            twist=self._make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
        )  # fmt: skip
        self._write("/odom", "nav_msgs/msg/Odometry", message, at)

    def _write_scan(self, scan: FiringScan, at: int) -> None:
        ring = self._timeline.settings.ring
        turned = [
            ("odom", f"sonar_{int(row['sensor']):02d}", Pose(float(row["x"]), float(row["y"]), float(row["bearing"])))
            for row in scan.rows
            if int(row["sensor"]) in ring.turning
        ]
        self._frames("/tf", [("odom", "ring", Pose(scan.x, scan.y, scan.yaw)), *turned], at)
        for row in scan.rows:
            name = f"s{int(row['sensor']):02d}"
            # Without an echo the range is inf, as REP 117 defines.
            message = self._make(
                "sensor_msgs/msg/Range", header=self._header(f"sonar_{name[1:]}", at), radiation_type=0,
                field_of_view=2.0 * math.radians(ring.beam_half_angle_deg), min_range=ring.range_min_m,
                max_range=ring.range_max_m, range=float(row["range_m"]), variance=0.0,
            )  # fmt: skip
            self._write(f"/sonar/{name}", "sensor_msgs/msg/Range", message, at)

    def _write_snapshot(self, snapshot: RunSnapshot, at: int) -> None:
        segments: Points = [(x, y) for x, y in snapshot.segments.reshape(-1, 2).tolist()]
        markers = [self._marker("all", 0, STRIP, [], TRUTH, at, action=DELETE_ALL)]
        if segments:
            markers.append(self._marker("segments", 0, LINES, segments, SEGMENT, at))
        newest = heard_cross_paths(newest_cross_paths(self._timeline.cross_paths, snapshot.t_s))
        for number, arc in enumerate(
            cross_arcs(newest, math.radians(self._timeline.settings.ring.beam_half_angle_deg))
        ):
            markers.append(self._marker("cross_paths", number, STRIP, arc.tolist(), CROSS, at))
        for number, c in enumerate(snapshot.clusters):
            corners = [(c.left, c.bottom), (c.right, c.bottom), (c.right, c.top), (c.left, c.top)]
            markers.append(self._marker("clusters", number, STRIP, _looped(corners), CLUSTER, at))
        for number, seen in enumerate(snapshot.objects):
            points, closed = outline(seen, self._models.get(seen.model), whole=self._whole)
            row = _looped(points.tolist()) if closed else points.tolist()
            markers.append(self._marker(f"models/{seen.model}", number, STRIP, row, MODEL, at))
        self._markers("/markers", markers, at)
        if snapshot.grid is not None and snapshot.grid.percent.size:
            self._write_grid(snapshot.grid, at)

    def _write_grid(self, known: KnownCells, at: int) -> None:
        rows, columns = known.percent.shape
        about = self._make(
            "nav_msgs/msg/MapMetaData", map_load_time=self._time(at), resolution=known.cell_m, width=columns,
            height=rows, origin=self._placed(Pose(known.x_m, known.y_m, 0.0)),
        )  # fmt: skip
        kind = "nav_msgs/msg/OccupancyGrid"
        self._write(
            "/grid",
            kind,
            self._make(kind, header=self._header("odom", at), info=about, data=known.percent.ravel()),
            at,
        )

    def _markers(self, topic: str, markers: list[Msg], at: int) -> None:
        kind = "visualization_msgs/msg/MarkerArray"
        self._write(topic, kind, self._make(kind, markers=markers), at)

    def _marker(
        self,
        group: str,
        number: int,
        kind: int,
        points: Points,
        colour: Colour,
        at: int,
        frame: str = "odom",
        action: int = 0,
    ) -> Msg:
        r, g, b = colour
        stamp = self._make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
        nothing = self._make(
            "sensor_msgs/msg/CompressedImage", header=self._make("std_msgs/msg/Header", stamp=stamp, frame_id=""),
            format="", data=np.zeros(0, np.uint8),
        )  # fmt: skip
        return self._make(
            "visualization_msgs/msg/Marker", header=self._header(frame, at), ns=group, id=number, type=kind,
            action=action, pose=self._placed(Pose(0.0, 0.0, 0.0)), scale=self._vector(LINE_M, 0.0),
            color=self._make("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=1.0),
            lifetime=self._make("builtin_interfaces/msg/Duration", sec=0, nanosec=0), frame_locked=False,
            points=[self._point(x, y) for x, y in points], colors=[], texture_resource="", texture=nothing,
            uv_coordinates=[], text="", mesh_resource="",
            mesh_file=self._make("visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, np.uint8)),
            mesh_use_embedded_materials=False,
        )  # fmt: skip


def _looped(points: Points) -> Points:
    return [*points, points[0]]
