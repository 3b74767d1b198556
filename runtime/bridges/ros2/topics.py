"""A state of a run as ROS messages: what is new in it, with the time of its measurement.

`runtime.bridges.ros2.node` publishes them. This module needs no ROS, and neither do its tests. What a message says is
in `runtime.analysis.export.ros_messages`, which `echolocate export --to rosbag2` also uses.
"""

from __future__ import annotations

import math
from array import array
from base64 import b64decode
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from drivers.messages import Pose, Twist
from drivers.ros_tf import Frame
from runtime.analysis.export.ros_messages import Fields, Frames, Messages, Output, header, mode
from runtime.bridges.console_client import Message
from runtime.bridges.ros2.ring_scan import RingScan
from runtime.bridges.ros2.stamps import StampClock

NO_ECHO: Final = -1.0
NEW_S: Final = 0.002
"""A reading is new if it is this much later than the last one: ages are rounded to a millisecond."""
MARKERS_S: Final = 0.2
DIAGNOSTICS_S: Final = 1.0
DELETE: Final = 2
"""An action of `visualization_msgs/Marker`."""
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"
"""Levels of `diagnostic_msgs/DiagnosticStatus`."""
LEVELS: Final = (("FAULT", ERROR), ("SAFE_STOP", WARN), ("CONNECTING", WARN))
DISCONNECTED: Final = "DISCONNECTED"
"""The mode while the bridge has no connection to a run."""


class Topics:
    """Turns the messages of one run into those of ROS, and remembers what has been published.

    `max_range_for_silence`: a sensor that heard nothing reports its greatest range, not inf. `with_scan`: the ring is
    also published as a laser scan.
    """

    def __init__(self, frames: Frames, *, max_range_for_silence: bool = False, with_scan: bool = False) -> None:
        self._say = Messages(frames, None if max_range_for_silence else math.inf)
        self._scan = RingScan(self._say.base) if with_scan else None
        self._clock = StampClock()
        self._session: Mapping[str, Any] = {}
        """The newest session; empty before the first."""
        self._published_s: list[float] = []
        """When each sensor fired whose range was published last, by the robot's clock."""
        self._odometry_s = math.nan
        """The robot's time of the odometry that was published last; NaN before."""
        self._markers: set[tuple[str, int]] = set()
        """Name space and number of the markers that receivers show."""
        self._mode: str | None = None
        """The mode that was published last."""
        self._done_s = {"markers": -math.inf, "diagnostics": -math.inf}
        """ROS time when each was published last."""
        self.note: str | None = None
        """A message about the last state, as of a clock that jumped; None if there is none."""
        self.place: str | None = None
        """What is known of the robot's place in a map: `tracking`, `localizing` or `lost`; None without a map."""

    def begin(self, session: Mapping[str, Any]) -> None:
        """Take in a session: another robot, or other models."""
        self._session = session
        self._forget()
        self._mode = None

    def _forget(self) -> None:
        """Forget what was published of the robot: its clock has jumped, or it is another one."""
        self._published_s = [-math.inf] * len(self._session["ring"]["mounts"])
        self._odometry_s = math.nan
        if self._scan is not None:
            self._scan.begin(self._session["ring"])

    def static(self, stamp_ns: int) -> list[Frame]:
        """Return the frames of the sensors, fixed to the ring, or to the base if they turn with the wheels."""
        ring = self._session["ring"]
        return self._say.static(ring["mounts"], ring["turning"], stamp_ns)

    def take(
        self, state: Message, ros_s: float, host_s: float, polylines: Sequence[Message] = ()
    ) -> tuple[list[Frame], list[Output]]:
        """Return the new frames and messages of a state; none before the first session.

        It arrived at `ros_s` in ROS time, at `host_s` by this machine's monotonic clock. Polylines are all that the
        run has now: a state has them only when they changed.
        """
        if not self._session or (state["playback"] is not None):
            return [], []
        robot_s = state["robot_s"]
        is_steady = not state["paused"] and state["speed"] == 1.0 and state["mode"] != "CONNECTING"
        self.note = self._clock.update(robot_s, ros_s, host_s, is_steady=is_steady)
        if self.note is not None:
            self._forget()
        at = self._clock.nanoseconds(robot_s)
        localized = state["localized"]
        self.place = None if localized is None else localized["status"]
        outputs, frames = [*self._ranges(state)], list[Frame]()
        if robot_s != self._odometry_s:  # states are more frequent than the odometry of many robots
            self._odometry_s = robot_s
            here = Pose(*state["pose"])
            frames = self._say.base_frames(here, state["ring_yaw"], at)
            outputs.append(self._say.odometry(here, Twist(*state["twist"]), at))
            if self.place == "tracking":
                frames.insert(0, self._say.map_frame(Pose(*localized["frame"]), at))
                outputs.append(self._say.place(localized["pose"], localized["covariance"], at))
        if self._scan is not None and (scan := self._scan.take(state, at)) is not None:
            outputs.append(scan)
        if state["mode"] != self._mode:
            self._mode = state["mode"]
            outputs.append(mode(state["mode"]))
        if self._is_due("markers", ros_s, MARKERS_S):
            outputs += self._objects(state["objects"], polylines, at)
        if self._is_due("diagnostics", ros_s, DIAGNOSTICS_S):
            outputs.append(self._diagnostics(state, round(1e9 * ros_s)))
        return frames, outputs

    def grid(self, message: Message, at: int) -> list[Output]:
        """Return the evidence grid as a map in odometry's frame at a time (ns); nothing of a run that keeps none."""
        if not message["on"] or not message["columns"]:
            return []
        cells, shape = array("b", b64decode(message["cells"])), (message["rows"], message["columns"])
        return [self._say.grid((message["x"], message["y"]), message["cell"], shape, cells, at)]

    def _is_due(self, what: str, ros_s: float, period_s: float) -> bool:
        """Return whether something that is published this often is due; after a clock that went back it is."""
        if 0.0 <= ros_s - self._done_s[what] < period_s - 0.01:
            return False
        self._done_s[what] = ros_s
        return True

    def _ranges(self, state: Message) -> Iterator[Output]:
        """Yield the range of each sensor that has fired since the last state."""
        ring, robot_s = self._session["ring"], state["robot_s"]
        for sensor, (range_m, age_s) in enumerate(zip(state["ranges"], state["age"], strict=True)):
            if age_s is None or range_m is None:
                continue
            fired_s = robot_s - age_s
            if fired_s <= self._published_s[sensor] + NEW_S:
                continue
            self._published_s[sensor] = fired_s
            heard_m = math.inf if range_m == NO_ECHO else range_m
            limits, at = (ring["range_min"], ring["range_max"]), self._clock.nanoseconds(fired_s)
            yield self._say.range(sensor, heard_m, limits, ring["half_angle"], at)

    def _objects(self, objects: list[Message], polylines: Sequence[Message], at: int) -> list[Output]:
        """Return the markers, those to delete among them, and a pose with covariance for each object but walls."""
        markers, poses = self._say.objects(objects, self._session["models"], polylines, at)
        now = {(marker["ns"], marker["id"]) for marker in markers}
        gone = [
            {"header": header(self._say.odom, at), "ns": ns, "id": number, "action": DELETE}
            for ns, number in sorted(self._markers - now)
        ]
        self._markers = now
        return [Output("objects", "visualization_msgs/MarkerArray", {"markers": [*gone, *markers]}), *poses]

    def _diagnostics(self, state: Message, at: int) -> Output:
        """Return mode, ring, place and line as diagnostics, at a time of ROS, ns."""
        name_of_mode, reason = state["mode"], state["reason"] or state["hold_reason"] or ""
        name = self._session["name"] or "robot"
        timing = {key: state[key] for key in ("cycle", "cycle_us", "late_us", "missed", "late", "quanta")}
        faulty = [f"sensor {sensor}: {fault}, {why}" for sensor, fault, why in state["sensors"]]
        text = f"{name_of_mode}: {reason}" if reason else name_of_mode
        statuses = [
            _status(
                "mode",
                name,
                dict(LEVELS).get(name_of_mode, OK),
                text,
                {"clients": state["clients"], "flags": " ".join(state["flags"]), **timing},
            ),
            _status("ring", name, WARN if faulty else OK, "; ".join(faulty) or "all sensors are plausible", {}),
        ]
        if self.place is not None:
            known = {"probability": state["localized"]["probability"]}
            statuses.append(_status("place", name, OK if self.place == "tracking" else WARN, self.place, known))
        if state["link"] is not None:
            statuses.append(_status("line", name, OK, "frames received", state["link"]))
        return _diagnostic_array(statuses, at)


def disconnected(at: int) -> list[Output]:
    """Return what is published at a time (ns) while there is no run: the last mode of it stays with receivers."""
    status = _status("mode", "robot", ERROR, f"{DISCONNECTED}: there is no connection to the run", {})
    return [mode(DISCONNECTED), _diagnostic_array([status], at)]


def _diagnostic_array(statuses: list[Fields], at: int) -> Output:
    return Output("/diagnostics", "diagnostic_msgs/DiagnosticArray", {"header": header("", at), "status": statuses})


def _status(what: str, name: str, level: bytes, text: str, values: Fields) -> Fields:
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    return {"level": level, "name": f"echolocate: {what}", "message": text, "hardware_id": name, "values": pairs}
