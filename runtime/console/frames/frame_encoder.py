"""Frames: the state of a run after a cycle, encoded once in JSON for all clients, live or replayed.

Only little differs from client to client: what it has missed, and whether it has control. So a frame is a head shared
by all, the segments as changes or whole, and a short tail.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import orjson

from behaviors.missions.mission import Mission
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.settings import Settings
from drivers.messages import Firing, LinkCounts, Odometry, Pose
from perception.detected_object import DetectedObject
from perception.paper.cluster_view import ClusterView
from perception.percept import Canyon
from perception.pipeline import Perception
from perception.polyline import Polyline
from runtime.console.frames.changing_rows import ChangingRows
from runtime.console.frames.cross_path_rows import CrossPathRows
from runtime.console.frames.known_way_row import KnownWayRow
from runtime.console.frames.mission_rows import MissionRows
from runtime.console.frames.segment_delta import SegmentDelta
from runtime.console.frames.state_message import (
    CanyonRow,
    GoalRow,
    LegsRow,
    LinkRow,
    LocalizedRow,
    MissionRow,
    ObjectRow,
    PlaybackRow,
    PolylineRow,
    RobotStatus,
    StateHead,
    TeleoperateRow,
    Triple,
    ValleyRow,
)
from runtime.cycle.drive_requests import DriveRequest, GoalPlace
from runtime.cycle.goal_drive import GoalDrive
from runtime.cycle.step import CycleRecord, State

NO_LINK_COUNTS: Final = LinkCounts()
NO_ECHO: Final = -1.0
"""The wire's form of an infinite range, for which JSON has no number."""
TURNS: Final = 2
"""While the robot runs, frames list in turns what costs the most: new segments and clusters, then objects."""


class RecordingStatus(NamedTuple):
    """The recording in progress."""

    file: str | None
    bytes: int
    dropped: int
    """Messages that were not recorded."""


@dataclass(frozen=True, slots=True)
class FrameContext:
    """What a frame shows besides the cycle's state."""

    host_s: float
    """When it was encoded; for a replayed frame, s after the recording's first cycle."""
    clients: int = 0
    phases_s: Mapping[str, float] | None = None
    """Duration of each phase of the last cycle."""
    late_s: float | None = 0.0
    """How long after its deadline that cycle began; like its phases None where a recording does not hold it."""
    missed: int | None = 0
    late: int | None = 0
    link: LinkCounts | None = NO_LINK_COUNTS
    """Counts that a recording does not hold are None in a replayed frame, not 0."""
    recording: RecordingStatus | None = None
    is_paused: bool = False
    speed: float = 1.0
    playback: PlaybackRow | None = None
    """Position in the recording that is replayed; None for the run itself."""


class EncodedFrame(NamedTuple):
    """A frame in JSON, as far as all clients share it."""

    source: object
    """Identifies the sequence of frames; changes are relative to the previous frame of the same source."""
    number: int
    """Of the frame in its source."""
    head: bytes
    """Everything but the map and what differs between clients, without the closing brace."""
    changes: bytes
    """The map's fields: segments that came or went since the last one; of the others those that have changed."""
    whole: Callable[[], bytes]
    """Returns the map's fields whole; valid while this is the newest frame of its source."""

    def encode(self, *, follows: bool, dropped: int, controls: bool) -> bytes:
        """Return the message for one client.

        `follows`: the previous frame of this source is the last one that it was sent. `dropped` frames were not.
        `controls`: it has control.
        """
        fields = self.changes if follows else self.whole()
        controller = b"true" if controls else b"false"
        return b'%b,%b,"dropped":%d,"controller":%b}' % (self.head, fields, dropped, controller)


class FrameEncoder:
    """Encodes the frames of one run, live or replayed."""

    def __init__(self, settings: Settings) -> None:
        count = len(settings.ring.mounts)
        self._ranges_m = [math.nan] * count
        self._fired_s = [math.nan] * count
        """Last range of each sensor, and when it was fired, by the robot's clock; NaN before the first."""
        self._fired: set[int] = set()
        """Sensors that fired since the last frame."""
        self._cross_paths = CrossPathRows()
        self._segments = SegmentDelta()
        self._mission = MissionRows()
        self._clusters = ClusterView(settings.perception)
        self._cluster_boxes: list[list[float]] = []
        self._objects: list[ObjectRow] = []
        self._segment_counts: tuple[int, int] | None = None
        """Of the segments encoded last: equal counts mean equal segments …"""
        self._is_stale = True
        """… unless this is set."""
        self._number = 0
        """Of the last frame."""
        self._archived = ChangingRows(_object)
        self._polylines = ChangingRows(_polyline)
        self._way = KnownWayRow()

    def adopt(self, settings: Settings) -> None:
        """Use other settings from the next frame on."""
        self._clusters = ClusterView(settings.perception)
        self._is_stale = True

    def take(self, record: CycleRecord) -> None:
        """Take in a cycle, whether or not a frame of it will be encoded."""
        heard = record.inputs.received
        if heard.rebooted:
            self._ranges_m = [math.nan] * len(self._ranges_m)
            self._fired_s = [math.nan] * len(self._fired_s)
            self._cross_paths.clear()
        if heard.rebooted or record.inputs.edits:
            # The segments may differ although their counts do not.
            self._is_stale = True
        for firing in heard.firings:
            self._take_firing(firing)

    def frame(self, state: State, record: CycleRecord | None, context: FrameContext) -> EncodedFrame:
        """Return the frame of the state after a cycle.

        The record is None before the first cycle.
        """
        self._number += 1
        is_moving = not context.is_paused and context.playback is None
        turn, must_list = self._number % TURNS, self._is_stale or not is_moving
        segments = self._encode_segments(state, may_wait=is_moving and turn > 0)
        if must_list or turn > 0:
            self._objects = [_object(detected) for detected in state.perception.labelled_objects()]
        odometry = state.odometry
        robot_s = 0.0 if odometry is None else odometry.robot_s
        phases_s, late_s = context.phases_s, context.late_s
        head: StateHead = {
            "type": "state",
            **robot_status(state, context),
            "cycle": state.cycle,
            "robot_s": robot_s,
            "host_s": round(context.host_s, 4),
            "pose": (0.0, 0.0, 0.0),
            "ring_yaw": 0.0,
            "twist": (0.0, 0.0),
            "flags": [],
            "firing": sorted(self._fired),
            "ranges": self.ranges(),
            "age": _json_numbers([robot_s - fired_s for fired_s in self._fired_s], 3),
            "cross_paths": self._cross_paths.rows(),
            "clusters": self._cluster_boxes,
            "objects": self._objects,
            "areas": [(a.number, round(a.x, 3), round(a.y, 3), a.radius) for a in state.perception.vacant_areas()],
            "canyons": [_canyon(canyon) for canyon in state.perception.canyons()],
            "vectors": [(r.schema, round(r.x, 4), round(r.y, 4)) for r in state.vectors],
            "drive_request": self._drive_request(state.drive_request, state.goal_place),
            "valley": _valley(state.goal_drive),
            "phases": _phases_us(phases_s),
            "cycle_us": None if phases_s is None else _us(sum(phases_s.values())),
            "late_us": None if late_s is None else _us(late_s),
            "missed": context.missed,
            "late": context.late,
            "quanta": 0 if record is None else record.quanta,
            "refinement": "nothing" if record is None else record.refinement,
            "link": _link(context.link),
            "waiting": state.perception.counts.waiting,
            "localized": _localized(state.perception),
            "sensors": [(r.sensor, r.fault, r.reason) for r in state.perception.sensor_reports()],
            "playback": context.playback,
        }
        if odometry is not None:
            _set_odometry(head, odometry)
        self._fired.clear()
        changes = b'"segments":%b' % segments + self._changed(state.perception)
        return EncodedFrame(self, self._number, orjson.dumps(head)[:-1], changes, self._whole)

    def ranges(self) -> list[float | None]:
        """Return the last range of each sensor, m: -1 where it heard nothing, None where it has not fired."""
        return _json_numbers([NO_ECHO if r == math.inf else r for r in self._ranges_m], 4)

    def _take_firing(self, firing: Firing) -> None:
        # A list of 24 numbers: numpy's calls would take ten times as long, within the cycle.
        for sensor, range_m in enumerate(firing.ranges_m.tolist()):
            if not math.isnan(range_m):
                self._ranges_m[sensor], self._fired_s[sensor] = range_m, firing.robot_s
                self._fired.add(sensor)
        self._cross_paths.take(firing)

    def _drive_request(
        self, drive_request: DriveRequest, place: GoalPlace | None
    ) -> GoalRow | TeleoperateRow | LegsRow | MissionRow:
        """Return what is driven, as the page shows it."""
        match drive_request:
            case Goal(x=x, y=y, frame=frame, heading=heading):
                return {
                    "kind": "goal",
                    "x": x,
                    "y": y,
                    "heading": heading,
                    "frame": frame,
                    "at": None if place is None else (round(place.x, 4), round(place.y, 4)),
                    "reached": drive_request.reached and (heading is None or drive_request.aligned),
                }
            case Teleoperate(v=v, w=w):
                return {"kind": "teleoperate", "v": v, "w": w}
            case Mission():
                return self._mission.row(drive_request)
        return {"kind": "legs"}

    def _changed(self, perception: Perception) -> bytes:
        """Return those of the map's other fields that have changed, each after a comma."""
        changed = b""
        if self._archived.update(perception.archived_objects()):
            changed += b',"archived":%b' % self._archived.json
        if self._polylines.update(perception.polylines()):
            changed += b',"polylines":%b' % self._polylines.json
        if self._way.update(perception.map_frame.known_way()):
            changed += b',"known_way":%b' % self._way.json
        return changed

    def _whole(self) -> bytes:
        return b'"segments":%b,"archived":%b,"polylines":%b,"known_way":%b' % (
            self._segments.whole(),
            self._archived.json,
            self._polylines.json,
            self._way.json,
        )

    def _encode_segments(self, state: State, *, may_wait: bool) -> bytes:
        """Return the changes of the map's segments, and list clusters, if they may have changed and may not wait."""
        perception = state.perception
        counts = (perception.counts.segments_total, perception.counts.segments)
        if not self._is_stale and (may_wait or counts == self._segment_counts):
            return self._segments.unchanged()
        self._segment_counts, self._is_stale = counts, False
        now = perception.segments()
        self._cluster_boxes = [list(box) for box in self._clusters.boxes(now.geometry)]
        rows = np.column_stack([now.geometry, now.times])
        return self._segments.update(now.numbers, rows, now.numbers[now.pinned == 1])


def robot_status(state: State, context: FrameContext) -> RobotStatus:
    """Return what a page always shows of the robot itself, also while it shows a recording."""
    recording = context.recording
    return {
        "mode": state.mode.mode.value,
        "reason": state.mode.reason,
        "hold_reason": state.hold_reason or state.preparing,
        "arming": state.mode.arming_run_s is not None,
        "clients": context.clients,
        "recording": recording and {"file": recording.file, "bytes": recording.bytes, "dropped": recording.dropped},
        "paused": context.is_paused,
        "speed": context.speed,
    }


def _json_numbers(values: Iterable[float], places: int) -> list[float | None]:
    """Return rounded numbers, None in place of NaN."""
    return [None if math.isnan(value) else round(value, places) for value in values]


def _object(detected: DetectedObject) -> ObjectRow:
    """Return an object in the wire's form, m and rad, in the frame of `detected`."""
    return {
        "number": detected.number,
        "model": detected.model,
        "x": round(detected.x, 4),
        "y": round(detected.y, 4),
        "theta": round(detected.theta, 4),
        "sigma": round(detected.sigma, 5),
        "sigma_theta": None if detected.sigma_theta is None else round(detected.sigma_theta, 5),
        "covariance": detected.covariance,
        "probability": detected.probability,
        "support": detected.support,
        "score": round(detected.score, 4),
        "confirmed": detected.confirmed,
        "placed": detected.placed,
        "ends": None if detected.ends is None else _line(*detected.ends),
    }


def _polyline(polyline: Polyline) -> PolylineRow:
    """Return a polyline in odometry's frame, m."""
    points = np.round(polyline.points, 3).tolist()
    return {"number": polyline.number, "points": points, "probability": round(polyline.probability, 3)}


def _localized(perception: Perception) -> LocalizedRow | None:
    """Return the robot in the map frame and that frame in odometry's; None where they are the same."""
    here = perception.localized()
    if here is None:
        return None
    xx, xy, yy, turn = (float(here.covariance[row, column]) for row, column in ((0, 0), (0, 1), (1, 1), (2, 2)))
    return {
        "pose": _rounded(here.pose),
        "covariance": (xx, xy, yy, turn) if math.isfinite(xx + xy + yy + turn) else None,
        "status": here.status,
        "probability": round(here.probability, 3),
        "frame": _rounded(perception.odometry_from_map()),
    }


def _rounded(pose: Pose) -> Triple:
    return round(pose.x, 4), round(pose.y, 4), round(pose.theta, 5)


def _line(x1: float, y1: float, x2: float, y2: float) -> tuple[float, float, float, float]:
    return round(x1, 3), round(y1, 3), round(x2, 3), round(y2, 3)


def _canyon(canyon: Canyon) -> CanyonRow:
    """Return a box canyon in odometry's frame, m and rad."""
    return {
        "number": canyon.number,
        "mouth": _line(*canyon.mouth),
        "axis": round(canyon.axis_rad, 4),
        "depth": round(canyon.depth_m, 3),
        "probability": round(canyon.probability, 3),
    }


def _us(s: float) -> float:
    return round(1e6 * s, 1)


def _phases_us(phases_s: Mapping[str, float] | None) -> dict[str, float]:
    return {name: _us(s) for name, s in (phases_s or {}).items()}


def _link(counts: LinkCounts | None) -> LinkRow | None:
    return None if counts is None else {"frames": counts.frames, "bad": counts.bad, "lost": counts.lost}


def _set_odometry(head: StateHead, odometry: Odometry) -> None:
    """Write what the odometry reports."""
    twist = odometry.twist
    head["pose"] = _rounded(odometry.pose)
    head["ring_yaw"] = round(odometry.ring_yaw, 5)
    head["twist"] = (round(twist.v, 4), round(twist.w, 4))
    head["flags"] = [str(flag.name) for flag in odometry.flags]


def _valley(drive: GoalDrive | None) -> ValleyRow | None:
    """Return the blocked sectors, the direction chosen (rad) and the look-ahead's way (m); None without a goal."""
    if drive is None:
        return None
    direction = drive.valley.direction_rad
    return {
        "blocked": drive.valley.blocked,
        "direction": None if direction is None else round(direction, 3),
        "way": [(round(x, 2), round(y, 2)) for x, y in drive.search.way],
    }
