"""A run as ROS messages, in plain data: dictionaries of the messages' own fields.

The live bridge and the bags say the same with these: topics, frames, covariances and quality of service. Lengths are
metres, angles radians, times ns. REP 105 and REP 117 apply. This module needs no ROS.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from drivers.messages import Pose, Twist
from drivers.ros_tf import Frame, planar
from runtime.analysis.export.shapes import HEIGHT_M, MODEL

Fields = dict[str, Any]
Seen = Mapping[str, Any]
"""An object or a model, as a state and a session of the console have it."""

LINE_M: Final = 0.03
POLYLINE_M: Final = 0.015
ODOMETRY_VARIANCE: Final = (1e-2, 1e-2, 3e-2)
"""Nominal variance of x, y (m²) and theta (rad²): a run does not say how good its wheels are."""
UNKNOWN_VARIANCE: Final = 1e6
"""Of what a robot in the plane does not measure: z, roll and pitch."""
ADD: Final = 0
STRIP, CYLINDER, TEXT = 4, 3, 9
"""Actions and types of `visualization_msgs/Marker`."""


class Qos(Enum):
    """Quality of service that a topic offers: what receivers of such topics ask for."""

    SENSOR_DATA = "best effort"
    RELIABLE = "reliable, volatile"
    LATCHED = "transient local"


DEPTHS: Final = MappingProxyType({Qos.SENSOR_DATA: 5, Qos.RELIABLE: 10, Qos.LATCHED: 1})
FRAMES_DEPTH: Final = 100
QOS: Final = MappingProxyType(
    {
        "sensor_msgs/Range": Qos.SENSOR_DATA,
        "sensor_msgs/LaserScan": Qos.SENSOR_DATA,
        "nav_msgs/Odometry": Qos.RELIABLE,
        "nav_msgs/OccupancyGrid": Qos.LATCHED,
        "geometry_msgs/PoseWithCovarianceStamped": Qos.RELIABLE,
        "visualization_msgs/MarkerArray": Qos.RELIABLE,
        "diagnostic_msgs/DiagnosticArray": Qos.RELIABLE,
        "std_msgs/String": Qos.LATCHED,
    }
)
"""Of each type of message; `/tf_static` is latched, too."""


class Output(NamedTuple):
    """One message to publish."""

    topic: str
    kind: str
    """Its type, as `sensor_msgs/Range`."""
    fields: Fields


@dataclass(frozen=True, slots=True)
class Frames:
    """Names of the frames."""

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"
    ring: str = "ring"
    prefix: str = ""
    """Before the name of every frame but the map's, for several robots in one tree."""

    def named(self, name: str) -> str:
        """Return the name of a frame other than the map's, with the prefix."""
        return self.prefix + name

    def sonar(self, sensor: int) -> str:
        """Return the frame of a sensor."""
        return f"{self.prefix}sonar_{sensor:02d}"


class Messages:
    """Makes the messages of one robot.

    `no_echo` is the range of a sensor that heard nothing, m; None for its greatest range.
    """

    def __init__(self, frames: Frames, no_echo: float | None = math.inf) -> None:
        self.names = frames
        self.map = frames.map
        self.odom, self.base, self.ring = map(frames.named, (frames.odom, frames.base, frames.ring))
        self._no_echo = no_echo

    def static(self, mounts: Sequence[Sequence[float]], turning: Iterable[int], at: int) -> list[Frame]:
        """Return the frames of the sensors, fixed to the ring, or to the base if they turn with the wheels."""
        turned = frozenset(turning)
        return [
            planar(at, self.base if k in turned else self.ring, self.names.sonar(k), x, y, angle)
            for k, (x, y, angle) in enumerate(mounts)
        ]

    def base_frames(self, pose: Pose, ring_yaw: float, at: int) -> list[Frame]:
        """Return the frame of the base, and that of the ring in it."""
        return [
            planar(at, self.odom, self.base, pose.x, pose.y, pose.theta),
            planar(at, self.base, self.ring, 0.0, 0.0, ring_yaw - pose.theta),
        ]

    def map_frame(self, map_in_odom: Pose, at: int) -> Frame:
        """Return the frame of odometry in the map, from the map's place in odometry's frame."""
        odom = map_in_odom.inverse()
        return planar(at, self.map, self.odom, odom.x, odom.y, odom.theta)

    def range(self, sensor: int, range_m: float, limits_m: tuple[float, float], half_angle: float, at: int) -> Output:
        """Return the reading of a sensor; its range is inf if it heard nothing."""
        silent = limits_m[1] if self._no_echo is None else self._no_echo
        fields = {
            "header": header(self.names.sonar(sensor), at),
            "radiation_type": 0,
            "field_of_view": 2.0 * half_angle,
            "min_range": limits_m[0],
            "max_range": limits_m[1],
            "range": range_m if math.isfinite(range_m) else silent,
        }
        return Output(f"sonar/s{sensor:02d}", "sensor_msgs/Range", fields)

    def odometry(self, at_pose: Pose, twist: Twist, at: int) -> Output:
        """Return a sample of the odometry; a velocity of NaN is not known."""
        xx, yy, tt = ODOMETRY_VARIANCE
        known = covariance(xx, 0.0, yy, tt)
        is_known = math.isfinite(twist.v) and math.isfinite(twist.w)
        speed = {"linear": {"x": twist.v}, "angular": {"z": twist.w}} if is_known else {}
        unknown = covariance(UNKNOWN_VARIANCE, 0.0, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE)
        return Output(
            "odom",
            "nav_msgs/Odometry",
            {
                "header": header(self.odom, at),
                "child_frame_id": self.base,
                "pose": {"pose": pose(at_pose.x, at_pose.y, at_pose.theta), "covariance": known},
                "twist": {"twist": speed, "covariance": known if is_known else unknown},
            },
        )

    def place(self, here: Sequence[float], known: Sequence[float] | None, at: int) -> Output:
        """Return the robot in the map: x, y, theta and covariance xx, xy, yy, tt, None if that is not known."""
        matrix = covariance(*(known or (UNKNOWN_VARIANCE, 0.0, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE)))
        placed = {"pose": pose(here[0], here[1], here[2]), "covariance": matrix}
        return Output(
            "pose", "geometry_msgs/PoseWithCovarianceStamped", {"header": header(self.map, at), "pose": placed}
        )

    def objects(
        self, objects: Iterable[Seen], models: Iterable[Seen], polylines: Iterable[Seen], at: int
    ) -> tuple[list[Fields], list[Output]]:
        """Return the markers of objects and polylines, and a pose with covariance for each object but walls."""
        head, known = header(self.odom, at), {model["name"]: model for model in models}
        markers: list[Fields] = []
        poses: list[Output] = []
        walls = 0
        for seen in objects:
            number = seen["number"]
            if number is None:
                number, walls = walls, walls + 1
            markers += _markers(seen, known.get(seen["model"]), number, head)
            if seen["covariance"] is None or seen["ends"] is not None:
                continue
            xx, xy, yy = seen["covariance"]
            placed = {
                "pose": pose(seen["x"], seen["y"], seen["theta"]),
                "covariance": covariance(xx, xy, yy, UNKNOWN_VARIANCE),
            }
            poses.append(
                Output("object_poses", "geometry_msgs/PoseWithCovarianceStamped", {"header": head, "pose": placed})
            )
        markers += [
            line_marker(one["points"], MODEL, header=head, ns="polyline", id=one["number"], scale={"x": POLYLINE_M})
            for one in polylines
        ]
        return markers, poses

    def grid(
        self, corner: tuple[float, float], cell_m: float, shape: tuple[int, int], cells: object, at: int
    ) -> Output:
        """Return an evidence grid: its corner x, y and cells (m), rows and columns, and per cent occupied of each."""
        info = {
            "resolution": cell_m,
            "width": shape[1],
            "height": shape[0],
            "origin": pose(corner[0], corner[1], 0.0),
        }
        fields = {"header": header(self.odom, at), "info": info, "data": cells}
        return Output("grid", "nav_msgs/OccupancyGrid", fields)


def mode(name: str) -> Output:
    """Return the mode of a run."""
    return Output("mode", "std_msgs/String", {"data": name})


def covariance(xx: float, xy: float, yy: float, tt: float) -> list[float]:
    """Return the covariance of x, y and theta as the 6 × 6 matrix of ROS, row by row."""
    matrix = [0.0] * 36
    matrix[0], matrix[1], matrix[6], matrix[7], matrix[35] = xx, xy, xy, yy, tt
    matrix[14] = matrix[21] = matrix[28] = UNKNOWN_VARIANCE
    return matrix


def line_marker(points: Iterable[tuple[float, float]], colour: Sequence[float], **fields: object) -> Fields:
    """Return the marker of a line through points (m); `fields` are its header, namespace and number."""
    r, g, b = colour
    return {
        "type": STRIP,
        "action": ADD,
        "pose": pose(0.0, 0.0, 0.0),
        "scale": {"x": LINE_M},
        "points": _points(points),
        "color": {"r": r, "g": g, "b": b, "a": 1.0},
        **fields,
    }


def _markers(seen: Seen, model: Seen | None, number: int, head: Fields) -> list[Fields]:
    """Return the marker of an object's outline, and its label unless it is a wall."""
    x, y, theta, name = seen["x"], seen["y"], seen["theta"], seen["model"]
    r, g, b = MODEL
    colour = {"r": r, "g": g, "b": b, "a": 0.4 + 0.6 * (seen["probability"] or seen["score"])}
    common = {"header": head, "ns": name, "id": number, "action": ADD, "color": colour, "frame_locked": False}
    line = {**common, "type": STRIP, "pose": pose(0.0, 0.0, 0.0), "scale": {"x": LINE_M}}
    if seen["ends"] is not None:
        x1, y1, x2, y2 = seen["ends"]
        return [{**line, "points": _points([(x1, y1), (x2, y2)])}]
    label = {
        **common,
        "ns": f"{name} label",
        "type": TEXT,
        "pose": pose(x, y, 0.0, HEIGHT_M + 0.2),
        "scale": {"z": 0.2},
        "text": f"{number} {name} {seen['score']:.2f}",
    }
    if model is None or model["arc_radius_m"] is not None:
        width = 0.2 if model is None else 2.0 * model["arc_radius_m"]
        size = {"x": width, "y": width, "z": HEIGHT_M}
        return [{**common, "type": CYLINDER, "pose": pose(x, y, 0.0, 0.5 * HEIGHT_M), "scale": size}, label]
    place = Pose(x, y, theta)
    corners = [place.compose(Pose(vx, vy, 0.0)) for vx, vy in model["vertices"]]
    corners += corners[:1] if model["closed"] else []
    return [{**line, "points": _points((corner.x, corner.y) for corner in corners)}, label]


def _points(places: Iterable[tuple[float, float]]) -> list[Fields]:
    return [{"x": float(x), "y": float(y)} for x, y in places]


def pose(x: float, y: float, yaw: float, z: float = 0.0) -> Fields:
    """Return a pose from place (m) and direction (rad)."""
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(0.5 * yaw), "w": math.cos(0.5 * yaw)}
    return {"position": {"x": float(x), "y": float(y), "z": z}, "orientation": turn}


def header(frame: str, at: int) -> Fields:
    """Return the header of a message in a frame at a time, ns."""
    return {"stamp": {"sec": at // 1_000_000_000, "nanosec": at % 1_000_000_000}, "frame_id": frame}
