"""Export of a run as a ROS 2 bag, without ROS: what the live bridge publishes, written by rosbags.

Topics, frames, covariances and the quality of service that each connection offers are those of `echolocate ros2`, see
`runtime.analysis.export.ros_messages`. Two topics more show what the bridge does not have: `/markers`, with outline
segments, clusters and the arcs of cross paths, and `/truth`, the true world where the odometry began.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rosbags.interfaces import (
    Nodetype,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.interfaces import Qos as BagQos
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from drivers.messages import Odometry
from drivers.ros_tf import Frame
from runtime.analysis.export.ros_messages import (
    DEPTHS,
    FRAMES_DEPTH,
    QOS,
    Fields,
    Frames,
    Messages,
    Output,
    Qos,
    header,
    line_marker,
    mode,
)
from runtime.analysis.export.shapes import (
    CLUSTER,
    CROSS,
    SEGMENT,
    TRUTH,
    FiringScan,
    Points,
    firing_scans,
    truth_outlines,
)
from runtime.analysis.plots.cross_arcs import cross_arcs, heard_cross_paths, newest_cross_paths
from runtime.analysis.timeline import ModeEntry, RunSnapshot, Timeline

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbags.typesys.store import Msg

    from perception.detected_object import DetectedObject

VERSION: Final = 9
LINES: Final = 5
"""A type of `visualization_msgs/Marker`."""
DELETE_ALL: Final = 3
ENDLESS: Final = QosTime(9_223_372_036, 854_775_807)
"""As rosbag2 writes it."""
TF: Final = "tf2_msgs/TFMessage"


def write_bag(timeline: Timeline, folder: Path) -> list[Path]:
    """Write a run as a ROS 2 bag and return its folder, which must not exist yet; its storage is MCAP.

    Raises
    ------
    OSError
        It cannot be written.
    """
    with Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        _BagExporter(timeline, writer).write()
    return [folder]


class _BagExporter:
    """Writes a run into a bag."""

    def __init__(self, timeline: Timeline, writer: Writer) -> None:
        self._timeline = timeline
        self._writer = writer
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._connections: dict[str, Any] = {}
        """By topic."""
        self._say = Messages(Frames())
        self._models = [
            {"name": m.name, "vertices": m.vertices_m, "closed": m.closed, "arc_radius_m": m.arc_radius_m}
            for m in timeline.settings.models
        ]

    def write(self) -> None:
        """Write everything, in order of time."""
        timeline = self._timeline
        items: list[tuple[float, Callable[[int], None]]] = [(0.0, self._write_static)]
        items += [(t, partial(self._write_odometry, odometry)) for t, odometry in timeline.odometry]
        items += [(scan.t_s, partial(self._write_scan, scan)) for scan in firing_scans(timeline)]
        items += [(entered.t_s, partial(self._write_mode, entered)) for entered in timeline.modes]
        items += [(snapshot.t_s, partial(self._write_snapshot, snapshot)) for snapshot in timeline.snapshots]
        for t_s, write in sorted(items, key=lambda item: item[0]):
            write(timeline.unix_ns(t_s))

    def _write(self, output: Output, at: int, qos: BagQos | None = None) -> None:
        """Write a message at a time, ns; the first on a topic creates it. `qos`: by default that of its type."""
        topic, kind = f"/{output.topic.lstrip('/')}", output.kind.replace("/", "/msg/")
        if topic not in self._connections:
            offered = qos or bag_qos(QOS[output.kind])
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=[offered]
            )
        data = self._store.serialize_cdr(self._message(kind, output.fields), kind)
        self._writer.write(self._connections[topic], at, data)

    def _message(self, kind: str, fields: Fields) -> Msg:
        """Return a message of a type; fields that are not given are zero, empty or false."""
        _, definitions = self._store.fielddefs[kind]
        values = {name: self._value(form, fields.get(name)) for name, form in definitions}
        return self._store.types[kind](**values)

    def _value(self, form: Any, value: Any) -> Any:  # noqa: ANN401 - a field of any message
        """Return what rosbags takes for a field: arrays of numpy, its own messages; None becomes zero or empty.

        `form`: the field's type as `fielddefs` of rosbags has it: a kind of node and what belongs to that.
        """
        node, about = form
        if node is Nodetype.NAME:
            return self._message(about, value or {})
        if node is Nodetype.BASE:
            empty: object = {"string": "", "bool": False}.get(about[0], 0)
            return empty if value is None else value
        element, length = about
        rows = [] if value is None else value
        if element[0] is Nodetype.BASE and element[1][0] != "string":
            return np.zeros(length, element[1][0]) if value is None else np.asarray(rows, element[1][0])
        return [self._value(element, row) for row in rows]

    def _write_frames(self, frames: Sequence[Frame], at: int, *, static: bool = False) -> None:
        """Write frames to /tf, or to /tf_static."""
        transforms = [
            {
                "header": header(frame.parent, frame.stamp_ns),
                "child_frame_id": frame.child,
                "transform": {
                    "translation": dict(zip("xyz", frame.translation, strict=True)),
                    "rotation": dict(zip("xyzw", frame.rotation, strict=True)),
                },
            }
            for frame in frames
        ]
        offered = bag_qos(Qos.LATCHED) if static else bag_qos(Qos.RELIABLE, FRAMES_DEPTH)
        self._write(Output("tf_static" if static else "tf", TF, {"transforms": transforms}), at, offered)

    def _write_static(self, at: int) -> None:
        """Write what never moves: the sensors on the ring, and the true world."""
        ring = self._timeline.settings.ring
        self._write_frames(self._say.static(ring.mounts, ring.turning, at), at, static=True)
        closed, lines = truth_outlines(self._timeline)
        if closed or lines:
            self._write_markers("truth", self._lines("truth", [*map(_looped, closed), *lines], TRUTH, at), at)

    def _write_odometry(self, odometry: Odometry, at: int) -> None:
        self._write_frames(self._say.base_frames(odometry.pose, odometry.ring_yaw, at), at)
        self._write(self._say.odometry(odometry.pose, odometry.twist, at), at)

    def _write_mode(self, entered: ModeEntry, at: int) -> None:
        self._write(mode(entered.mode), at)

    def _write_scan(self, scan: FiringScan, at: int) -> None:
        """Write the range of each sensor that fired."""
        ring = self._timeline.settings.ring
        half, limits = math.radians(ring.beam_half_angle_deg), (ring.range_min_m, ring.range_max_m)
        for row in scan.rows:
            self._write(self._say.range(int(row["sensor"]), float(row["range_m"]), limits, half, at), at)

    def _write_snapshot(self, snapshot: RunSnapshot, at: int) -> None:
        """Write what perception had found: place, objects with their poses, what they are made of, and the grid."""
        if (place := snapshot.place) is not None:
            self._write_frames([self._say.map_frame(place.map_in_odom, at)], at)
            known = [float(place.covariance[row, column]) for row, column in ((0, 0), (0, 1), (1, 1), (2, 2))]
            here = (place.pose.x, place.pose.y, place.pose.theta)
            self._write(self._say.place(here, known if all(map(math.isfinite, known)) else None, at), at)
        seen = [as_seen(one) for one in (*snapshot.objects, *snapshot.walls)]
        polylines = [{"number": one.number, "points": one.points.tolist()} for one in snapshot.polylines]
        markers, poses = self._say.objects(seen, self._models, polylines, at)
        self._write_markers("objects", [self._delete_all(at), *markers], at)
        for pose in poses:
            self._write(pose, at)
        self._write_markers("markers", [self._delete_all(at), *self._drawn(snapshot, at)], at)
        if snapshot.grid is not None and snapshot.grid.percent.size:
            known_cells = snapshot.grid
            corner, shape = (known_cells.x_m, known_cells.y_m), known_cells.percent.shape
            self._write(
                self._say.grid(corner, known_cells.cell_m, (shape[0], shape[1]), known_cells.percent.ravel(), at), at
            )

    def _drawn(self, snapshot: RunSnapshot, at: int) -> list[Fields]:
        """Return the markers of what objects are made of."""
        segments: Points = [(x, y) for x, y in snapshot.segments.reshape(-1, 2).tolist()]
        newest = heard_cross_paths(newest_cross_paths(self._timeline.cross_paths, snapshot.t_s))
        arcs = cross_arcs(newest, math.radians(self._timeline.settings.ring.beam_half_angle_deg))
        boxes = [
            _looped([(c.left, c.bottom), (c.right, c.bottom), (c.right, c.top), (c.left, c.top)])
            for c in snapshot.clusters
        ]
        drawn = [{**marker, "type": LINES} for marker in self._lines("segments", [segments], SEGMENT, at) if segments]
        drawn += self._lines("cross_paths", [arc.tolist() for arc in arcs], CROSS, at)
        return drawn + self._lines("clusters", boxes, CLUSTER, at)

    def _lines(self, group: str, rows: Iterable[Points], colour: tuple[float, float, float], at: int) -> list[Fields]:
        head = header(self._say.odom, at)
        return [line_marker(points, colour, header=head, ns=group, id=number) for number, points in enumerate(rows)]

    def _delete_all(self, at: int) -> Fields:
        return {"header": header(self._say.odom, at), "action": DELETE_ALL}

    def _write_markers(self, topic: str, markers: list[Fields], at: int) -> None:
        self._write(Output(topic, "visualization_msgs/MarkerArray", {"markers": markers}), at)


def bag_qos(qos: Qos, depth: int | None = None) -> BagQos:
    """Return a quality of service as a bag's metadata have it; `ros2 bag play` offers it again."""
    reliability = QosReliability.BEST_EFFORT if qos is Qos.SENSOR_DATA else QosReliability.RELIABLE
    durability = QosDurability.TRANSIENT_LOCAL if qos is Qos.LATCHED else QosDurability.VOLATILE
    return BagQos(
        QosHistory.KEEP_LAST,
        depth or DEPTHS[qos],
        reliability,
        durability,
        ENDLESS,
        ENDLESS,
        QosLiveliness.AUTOMATIC,
        ENDLESS,
        avoid_ros_namespace_conventions=False,
    )


def as_seen(seen: DetectedObject) -> dict[str, object]:
    """Return an object as a state of the console has it."""
    return {
        "number": seen.number,
        "model": seen.model,
        "x": seen.x,
        "y": seen.y,
        "theta": seen.theta,
        "score": seen.score,
        "probability": seen.probability,
        "covariance": seen.covariance,
        "ends": seen.ends,
    }


def _looped(points: Points) -> Points:
    return [*points, points[0]]
