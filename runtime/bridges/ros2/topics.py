"""A state of a run as ROS messages, in plain data: dictionaries of the messages' own fields.

`runtime.bridges.ros2.node` makes messages of them. This module needs no ROS, and neither do its tests. Names are
those of `echolocate export --to rosbag2`; lengths are metres, angles radians. REP 105 and REP 117 apply.
"""

from __future__ import annotations

import math
from array import array
from base64 import b64decode
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from drivers.messages import Pose
from drivers.ros_tf import Frame, planar
from runtime.bridges.console_client import Message
from runtime.bridges.ros2.stamps import StampClock

Fields = dict[str, Any]

NO_ECHO: Final = -1.0
NEW_S: Final = 0.002
"""A reading is new if it is this much later than the last one: ages are rounded to a millisecond."""
MARKERS_S: Final = 0.2
DIAGNOSTICS_S: Final = 1.0
HEIGHT_M: Final = 0.9
LINE_M: Final = 0.03
ODOMETRY_VARIANCE: Final = (1e-2, 1e-2, 3e-2)
"""Nominal variance of x, y (m²) and theta (rad²): a run does not say how good its wheels are."""
UNKNOWN_VARIANCE: Final = 1e6
"""Of what a robot in the plane does not measure: z, roll and pitch."""
ADD, DELETE = 0, 2
STRIP, CYLINDER, TEXT = 4, 3, 9
"""Actions and types of `visualization_msgs/Marker`."""
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"
"""Levels of `diagnostic_msgs/DiagnosticStatus`."""
LEVELS: Final = (("FAULT", ERROR), ("SAFE_STOP", WARN), ("CONNECTING", WARN))


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

    def sonar(self, sensor: int) -> str:
        """Return the frame of a sensor."""
        return f"{self.prefix}sonar_{sensor:02d}"


class Topics:
    """Turns the messages of one run into those of ROS, and remembers what has been published.

    Parameters
    ----------
    frames : Frames
        Names of the frames.
    """

    def __init__(self, frames: Frames) -> None:
        self._map = frames.map
        self._odom, self._base, self._ring = (
            frames.prefix + name for name in (frames.odom, frames.base, frames.ring)
        )
        self._frames = frames
        self._clock = StampClock()
        self._session: Message = {}
        self._published_s: list[float] = []
        self._markers: set[tuple[str, int]] = set()
        self._mode: str | None = None
        self._done_s = {"markers": -math.inf, "diagnostics": -math.inf}
        self.note: str | None = None
        """A message about the last state, as of a clock that jumped; None if there is none."""

    def begin(self, session: Message) -> None:
        """Take in a session: another robot, or other models."""
        self._session = session
        self._published_s = [-math.inf] * len(session["ring"]["mounts"])
        self._mode = None

    def static(self, stamp_ns: int) -> list[Frame]:
        """Return the frames of the sensors, fixed to the ring, or to the base if they turn with the wheels."""
        ring, turning = self._session["ring"], self._session["ring"]["turning"]
        return [
            planar(stamp_ns, self._base if k in turning else self._ring, self._frames.sonar(k), *mount)
            for k, mount in enumerate(ring["mounts"])
        ]

    def take(self, state: Message, ros_s: float) -> tuple[list[Frame], list[Output]]:
        """Return the frames and messages of a state that arrived at a ROS time (s); none before the first session."""
        if not self._session or (state["playback"] is not None):
            return [], []
        robot_s = state["robot_s"]
        is_steady = not state["paused"] and state["speed"] == 1.0 and state["mode"] != "CONNECTING"
        self.note = self._clock.update(robot_s, ros_s, is_steady=is_steady)
        if self.note is not None:
            self._published_s = [-math.inf] * len(self._published_s)
        at = self._clock.nanoseconds(robot_s)
        outputs = [*self._ranges(state), self._odometry(state, at)]
        if state["localized"] is not None:
            outputs.append(self._localized(state["localized"], at))
        if state["mode"] != self._mode:
            self._mode = state["mode"]
            outputs.append(Output("mode", "std_msgs/String", {"data": state["mode"]}))
        if self._is_due("markers", ros_s, MARKERS_S):
            outputs += self._objects(state["objects"], at)
        if self._is_due("diagnostics", ros_s, DIAGNOSTICS_S):
            outputs.append(self._diagnostics(state, round(1e9 * ros_s)))
        return self._transforms(state, at), outputs

    def grid(self, message: Message, at: int) -> list[Output]:
        """Return the evidence grid as a map in odometry's frame at a time (ns); nothing of a run that keeps none."""
        if not message["on"] or not message["columns"]:
            return []
        info = {
            "resolution": message["cell"],
            "width": message["columns"],
            "height": message["rows"],
            "origin": _pose(message["x"], message["y"], 0.0),
        }
        cells = array("b", b64decode(message["cells"]))
        fields = {"header": _header(self._odom, at), "info": info, "data": cells}
        return [Output("grid", "nav_msgs/OccupancyGrid", fields)]

    def _is_due(self, what: str, ros_s: float, period_s: float) -> bool:
        """Return whether something that is published this often is due; after a clock that went back it is."""
        if 0.0 <= ros_s - self._done_s[what] < period_s - 0.01:
            return False
        self._done_s[what] = ros_s
        return True

    def _ranges(self, state: Message) -> Iterator[Output]:
        ring, robot_s = self._session["ring"], state["robot_s"]
        for sensor, (range_m, age_s) in enumerate(zip(state["ranges"], state["age"], strict=True)):
            if age_s is None or range_m is None:
                continue
            fired_s = robot_s - age_s
            if fired_s <= self._published_s[sensor] + NEW_S:
                continue
            self._published_s[sensor] = fired_s
            yield Output(
                f"sonar/s{sensor:02d}", "sensor_msgs/Range",
                {
                    "header": _header(self._frames.sonar(sensor), self._clock.nanoseconds(fired_s)),
                    "radiation_type": 0,
                    "field_of_view": 2.0 * ring["half_angle"],
                    "min_range": ring["range_min"],
                    "max_range": ring["range_max"],
                    "range": math.inf if range_m == NO_ECHO else range_m,
                },
            )  # fmt: skip

    def _odometry(self, state: Message, at: int) -> Output:
        v, w = state["twist"]
        xx, yy, tt = ODOMETRY_VARIANCE
        return Output(
            "odom", "nav_msgs/Odometry",
            {
                "header": _header(self._odom, at),
                "child_frame_id": self._base,
                "pose": {"pose": _pose(*state["pose"]), "covariance": covariance(xx, 0.0, yy, tt)},
                "twist": {
                    "twist": {"linear": {"x": v}, "angular": {"z": w}}, "covariance": covariance(xx, 0.0, yy, tt)
                },
            },
        )  # fmt: skip

    def _localized(self, localized: Message, at: int) -> Output:
        known = localized["covariance"] or [UNKNOWN_VARIANCE, 0.0, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE]
        pose = {"pose": _pose(*localized["pose"]), "covariance": covariance(*known)}
        return Output(
            "pose", "geometry_msgs/PoseWithCovarianceStamped", {"header": _header(self._map, at), "pose": pose}
        )

    def _transforms(self, state: Message, at: int) -> list[Frame]:
        x, y, theta = state["pose"]
        localized = state["localized"]
        odom = Pose(0.0, 0.0, 0.0) if localized is None else Pose(*localized["frame"]).inverse()
        return [
            planar(at, self._map, self._odom, odom.x, odom.y, odom.theta),
            planar(at, self._odom, self._base, x, y, theta),
            planar(at, self._base, self._ring, 0.0, 0.0, state["ring_yaw"] - theta),
        ]

    def _objects(self, objects: list[Message], at: int) -> list[Output]:
        """Return the markers, those to delete among them, and a pose with covariance for each object but walls."""
        header, models = _header(self._odom, at), {model["name"]: model for model in self._session["models"]}
        markers, outputs, walls = [], [], 0
        for seen in objects:
            number = seen["number"]
            if number is None:
                number, walls = walls, walls + 1
            markers += _markers(seen, models.get(seen["model"]), number, header)
            if seen["covariance"] is None or seen["ends"] is not None:
                continue
            xx, xy, yy = seen["covariance"]
            pose = {
                "pose": _pose(seen["x"], seen["y"], seen["theta"]),
                "covariance": covariance(xx, xy, yy, UNKNOWN_VARIANCE),
            }
            outputs.append(
                Output("object_poses", "geometry_msgs/PoseWithCovarianceStamped", {"header": header, "pose": pose})
            )
        now = {(marker["ns"], marker["id"]) for marker in markers}
        gone = [
            {"header": header, "ns": ns, "id": number, "action": DELETE}
            for ns, number in sorted(self._markers - now)
        ]  # fmt: skip
        self._markers = now
        return [Output("objects", "visualization_msgs/MarkerArray", {"markers": [*gone, *markers]}), *outputs]

    def _diagnostics(self, state: Message, at: int) -> Output:
        mode, reason = state["mode"], state["reason"] or state["hold_reason"] or ""
        name = self._session["name"] or "robot"
        timing = {key: state[key] for key in ("cycle", "cycle_us", "late_us", "missed", "late", "quanta")}
        faulty = [f"sensor {sensor}: {fault}, {why}" for sensor, fault, why in state["sensors"]]
        statuses = [
            _status("mode", name, dict(LEVELS).get(mode, OK), f"{mode}: {reason}" if reason else mode,
                    {"clients": state["clients"], "flags": " ".join(state["flags"]), **timing}),
            _status("ring", name, WARN if faulty else OK, "; ".join(faulty) or "all sensors are plausible", {}),
        ]  # fmt: skip
        if state["link"] is not None:
            statuses.append(_status("line", name, OK, "frames received", state["link"]))
        return Output(
            "/diagnostics", "diagnostic_msgs/DiagnosticArray", {"header": _header("", at), "status": statuses}
        )


def covariance(xx: float, xy: float, yy: float, tt: float) -> list[float]:
    """Return the covariance of x, y and theta as the 6 × 6 matrix of ROS, row by row."""
    matrix = [0.0] * 36
    matrix[0], matrix[1], matrix[6], matrix[7], matrix[35] = xx, xy, xy, yy, tt
    matrix[14] = matrix[21] = matrix[28] = UNKNOWN_VARIANCE
    return matrix


def _markers(seen: Message, model: Message | None, number: int, header: Fields) -> list[Fields]:
    """Return the marker of an object's outline, and its label unless it is a wall."""
    x, y, theta, name = seen["x"], seen["y"], seen["theta"], seen["model"]
    colour = {"r": 0.0, "g": 0.45, "b": 0.70, "a": 0.4 + 0.6 * (seen["probability"] or seen["score"])}
    common = {"header": header, "ns": name, "id": number, "action": ADD, "color": colour, "frame_locked": False}
    line = {**common, "type": STRIP, "pose": _pose(0.0, 0.0, 0.0), "scale": {"x": LINE_M}}
    if seen["ends"] is not None:
        x1, y1, x2, y2 = seen["ends"]
        return [{**line, "points": _points([(x1, y1), (x2, y2)])}]
    label = {
        **common, "ns": f"{name} label", "type": TEXT, "pose": _pose(x, y, 0.0, HEIGHT_M + 0.2),
        "scale": {"z": 0.2}, "text": f"{number} {name} {seen['score']:.2f}",
    }  # fmt: skip
    if model is None or model["arc_radius_m"] is not None:
        width = 0.2 if model is None else 2.0 * model["arc_radius_m"]
        size = {"x": width, "y": width, "z": HEIGHT_M}
        return [{**common, "type": CYLINDER, "pose": _pose(x, y, 0.0, 0.5 * HEIGHT_M), "scale": size}, label]
    place = Pose(x, y, theta)
    corners = [place.compose(Pose(vx, vy, 0.0)) for vx, vy in model["vertices"]]
    corners += corners[:1] if model["closed"] else []
    return [{**line, "points": _points((corner.x, corner.y) for corner in corners)}, label]


def _points(places: Iterable[tuple[float, float]]) -> list[Fields]:
    return [{"x": x, "y": y} for x, y in places]


def _pose(x: float, y: float, yaw: float, z: float = 0.0) -> Fields:
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(0.5 * yaw), "w": math.cos(0.5 * yaw)}
    return {"position": {"x": x, "y": y, "z": z}, "orientation": turn}


def _header(frame: str, at: int) -> Fields:
    return {"stamp": {"sec": at // 1_000_000_000, "nanosec": at % 1_000_000_000}, "frame_id": frame}


def _status(what: str, name: str, level: bytes, text: str, values: Fields) -> Fields:
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    return {"level": level, "name": f"echolocate: {what}", "message": text, "hardware_id": name, "values": pairs}
