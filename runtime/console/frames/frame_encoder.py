"""A run's state as the page sees it: built once a frame, in JSON, for all clients together.

The parts that differ from client to client are few (what it has missed, whether it has the control), so a frame is a
head that all share, the segments as changes or whole, and a short tail.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import orjson

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.settings import Settings
from drivers.messages import Firing, Floats, LinkCounts
from perception.detected_object import DetectedObject
from perception.paper.cluster_view import ClusterView
from runtime.console.frames.segment_delta import SegmentTable
from runtime.cycle.drive_requests import DriveRequest
from runtime.cycle.step import CycleRecord, State

NO_FRAMES: Final = LinkCounts()
NOTHING_HEARD: Final = -1.0
"""Stands for an infinite range, which JSON has no number for."""


class RecordingStatus(NamedTuple):
    """The recording under way."""

    file: str | None
    bytes: int
    dropped: int


@dataclass(frozen=True, slots=True)
class FrameContext:
    """What a frame tells besides the state that a cycle left."""

    host_s: float
    clients: int = 0
    phases_s: Mapping[str, float] | None = None
    """What each phase of the last cycle took."""
    late_s: float = 0.0
    """How long after its time that cycle began."""
    missed: int = 0
    late: int = 0
    link: LinkCounts = NO_FRAMES
    recording: RecordingStatus | None = None
    is_paused: bool = False
    speed: float = 1.0
    playback: Mapping[str, Any] | None = None
    """Which recording this is of, and where in it; None for the run itself."""


class EncodedFrame(NamedTuple):
    """A frame of the run, as far as clients share it."""

    source: object
    """Whose frames these are; changes count from the one before of the same source."""
    number: int
    head: bytes
    changes: bytes
    whole: Callable[[], bytes]
    """Returns all segments; valid while this is the newest frame of its source."""

    def encode(self, *, follows: bool, dropped: int, controls: bool) -> bytes:
        """Return the frame for one client."""
        segments = self.changes if follows else self.whole()
        return b'%b,"segments":%b,"dropped":%d,"controller":%b}' % (
            self.head, segments, dropped, b"true" if controls else b"false"
        )  # fmt: skip


class FrameEncoder:
    """Follows a run and puts its frames together, be it a live one or one that is played again.

    Parameters
    ----------
    settings : Settings
        Of the run.
    """

    def __init__(self, settings: Settings) -> None:
        count = len(settings.ring.mounts)
        self._ranges = np.full(count, np.nan)
        self._heard_s = np.full(count, np.nan)
        self._fired: set[int] = set()
        self._table = SegmentTable()
        self._clusters = ClusterView(settings.perception)
        self._cluster_rows: list[list[float]] = []
        self._counts: tuple[int, int] | None = None
        self._is_stale = True
        self._number = 0

    def adopt(self, settings: Settings) -> None:
        """Go on with other settings."""
        self._clusters = ClusterView(settings.perception)
        self._is_stale = True

    def take(self, record: CycleRecord) -> None:
        """Take note of a cycle, whether or not anybody looks on."""
        heard = record.inputs.received
        if heard.rebooted:
            self._ranges[:] = self._heard_s[:] = np.nan
        if heard.rebooted or record.inputs.edits:
            # The map may be another one though its numbers of segments are as before.
            self._is_stale = True
        for firing in heard.firings:
            self._hear(firing)

    def frame(self, state: State, record: CycleRecord | None, context: FrameContext) -> EncodedFrame:
        """Return the frame of what a cycle left."""
        self._number += 1
        segments = self._segments(state)
        odometry = state.odometry
        t_s = 0.0 if odometry is None else odometry.robot_s
        link, phases_s = context.link, context.phases_s or {}
        head: dict[str, Any] = {
            "type": "state",
            "cycle": state.cycle,
            "robot_s": t_s,
            "host_s": round(context.host_s, 4),
            "mode": state.mode.mode.value,
            "reason": state.mode.reason,
            "hold_reason": state.hold_reason,
            "arming": state.mode.arming_run_s is not None,
            "pose": [0.0, 0.0, 0.0],
            "ring_yaw": 0.0,
            "twist": [0.0, 0.0],
            "flags": [],
            "firing": sorted(self._fired),
            "ranges": _told(np.where(np.isinf(self._ranges), NOTHING_HEARD, self._ranges), 4),
            "age": _told(t_s - self._heard_s, 3),
            "clusters": self._cluster_rows,
            "objects": [_object(seen) for seen in state.perception.labelled_objects()],
            "vectors": [[r.schema, round(r.x, 4), round(r.y, 4)] for r in state.vectors],
            "drive_request": _drive_request(state.drive_request),
            "phases": {name: round(1e6 * s, 1) for name, s in phases_s.items()},
            "cycle_us": round(1e6 * sum(phases_s.values()), 1),
            "late_us": round(1e6 * context.late_s, 1),
            "missed": context.missed,
            "late": context.late,
            "quanta": 0 if record is None else record.quanta,
            "refinement": "nothing" if record is None else record.refinement,
            "link": {"frames": link.frames, "bad": link.bad, "lost": link.lost},
            "sensors": [[r.sensor, r.fault, r.reason] for r in state.perception.sensor_reports()],
            "clients": context.clients,
            "recording": None if context.recording is None else context.recording._asdict(),
            "paused": context.is_paused,
            "speed": context.speed,
            "playback": context.playback,
        }
        if odometry is not None:
            pose, twist = odometry.pose, odometry.twist
            head["pose"] = [round(pose.x, 4), round(pose.y, 4), round(pose.theta, 5)]
            head["ring_yaw"] = round(odometry.ring_yaw, 5)
            head["twist"] = [round(twist.v, 4), round(twist.w, 4)]
            head["flags"] = [flag.name for flag in odometry.flags]
        self._fired.clear()
        return EncodedFrame(self, self._number, orjson.dumps(head)[:-1], segments, self._table.whole)

    def _hear(self, firing: Firing) -> None:
        fired = np.flatnonzero(~np.isnan(firing.ranges_m))
        self._ranges[fired] = firing.ranges_m[fired]
        self._heard_s[fired] = firing.robot_s
        self._fired.update(fired.tolist())

    def _segments(self, state: State) -> bytes:
        perception = state.perception
        counts = (perception.counts.segments_total, perception.counts.segments)
        if counts == self._counts and not self._is_stale:
            return self._table.unchanged()
        self._counts, self._is_stale = counts, False
        now = perception.segments()
        self._cluster_rows = self._clusters.rows(now.geometry)
        rows = np.column_stack([now.geometry, now.times])
        return self._table.update(now.numbers, rows, now.numbers[now.pinned == 1])


def _told(values: Floats, places: int) -> list[float | None]:
    """Return numbers for JSON, null where there is none."""
    return [None if math.isnan(value) else value for value in np.round(values, places).tolist()]


def _object(seen: DetectedObject) -> dict[str, Any]:
    return {
        "number": seen.number,
        "model": seen.model,
        "x": round(seen.x, 4),
        "y": round(seen.y, 4),
        "theta": round(seen.theta, 4),
        "sigma": round(seen.sigma, 5),
        "covariance": seen.covariance,
        "probability": seen.probability,
        "support": seen.support,
        "score": round(seen.score, 4),
        "confirmed": seen.confirmed,
        "placed": seen.placed,
    }


def _drive_request(drive_request: DriveRequest) -> dict[str, Any]:
    match drive_request:
        case Goal(x=x, y=y):
            return {"kind": "goal", "x": x, "y": y, "reached": drive_request.reached}
        case Teleoperate(v=v, w=w):
            return {"kind": "teleoperate", "v": v, "w": w}
    return {"kind": "legs"}
