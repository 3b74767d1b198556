"""The state of a run as clients get it, as types: see `runtime.console.sent_messages`.

Lengths are metres, angles radians, times seconds, unless the name says otherwise.
"""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired, TypeAlias, TypedDict

import orjson

from behaviors.missions.mission import Status as MissionStatus
from config.mission_step import Frame
from perception.localization.localized_pose import Status as PlaceStatus
from perception.paper.cluster_view import ClusterBox
from perception.sensor_faults.report import SensorFault
from runtime.cycle.step import StopCause

Pair: TypeAlias = tuple[float, float]
Triple: TypeAlias = tuple[float, float, float]
Quad: TypeAlias = tuple[float, float, float, float]
ModeName: TypeAlias = Literal["CONNECTING", "READY", "DRIVE", "SAFE_STOP", "FAULT"]


class RecordingRow(TypedDict):
    """The recording in progress."""

    file: str | None
    bytes: int
    dropped: int


class RobotStatus(TypedDict):
    """What a page always shows of the robot itself, also while it shows a recording."""

    mode: ModeName
    reason: str | None
    hold_reason: str | None
    arming: bool
    clients: int
    recording: RecordingRow | None
    paused: bool
    speed: float


class ObjectRow(TypedDict):
    """An object in odometry's frame."""

    number: int | None
    model: str
    x: float
    y: float
    theta: float
    sigma: float
    sigma_theta: float | None
    covariance: Triple | None
    probability: float | None
    support: int
    score: float
    confirmed: bool
    placed: bool
    ends: Quad | None


class CanyonRow(TypedDict):
    """A dead end."""

    number: int
    mouth: Quad
    axis: float
    depth: float
    probability: float


class PolylineRow(TypedDict):
    """An outline of what is not straight, in odometry's frame."""

    number: int
    points: list[Pair]
    probability: float


class CrossPathRow(TypedDict):
    """What the listeners of one firing heard."""

    robot_s: float
    pose: Quad
    """x, y, heading, ring's yaw."""
    paths: list[tuple[int, int, float]]
    """Transmitter, listener, half of the path."""


class GoalRow(TypedDict):
    """A goal that is driven to."""

    kind: Literal["goal"]
    x: float
    y: float
    heading: float | None
    frame: Frame
    at: Pair | None
    """Its place in odometry's frame."""
    reached: bool


class TeleoperateRow(TypedDict):
    """A velocity of an operator."""

    kind: Literal["teleoperate"]
    v: float
    w: float


class LegsRow(TypedDict):
    """The configured legs."""

    kind: Literal["legs"]


class StepRow(TypedDict):
    """A step of a mission."""

    name: str
    schemas: list[str]
    until: list[tuple[str, str]]
    """Each condition in words, and the step that follows."""
    places: list[tuple[float, float, float | None]]
    """x, y, heading in degrees."""
    place: str | None
    """The name of a place of the map."""
    frame: Frame


class MissionRow(TypedDict):
    """The mission under way."""

    kind: Literal["mission"]
    name: str
    about: str
    status: MissionStatus
    reason: str | None
    step: int
    step_s: float
    way_m: float
    steps: Annotated[orjson.Fragment, list[StepRow]]


class ValleyRow(TypedDict):
    """The way to a goal."""

    blocked: str
    """A digit for each sector: 1 if it is blocked."""
    direction: float | None
    way: list[Pair]


class LinkRow(TypedDict):
    """Counts of the line."""

    frames: int
    bad: int
    lost: int


class LocalizedRow(TypedDict):
    """The robot in the map frame."""

    pose: Triple
    covariance: Quad | None
    """xx, xy, yy, and of the heading."""
    status: PlaceStatus
    probability: float
    frame: Triple
    """The map's origin in odometry's frame."""


class WayRow(TypedDict):
    """The way as it is known now by maps of a few metres of it, in the map frame; empty where none corrects it."""

    path: list[Pair]
    """Places of the ring along it."""
    maps: list[tuple[float, float, float, float, float]]
    """x, y of the middle of each map, and their covariance xx, xy, yy."""
    loops: list[Quad]
    """Loop closures: x, y of one map and of the other."""


class PlaybackRow(TypedDict):
    """The position in the recording that is shown."""

    s: float
    is_playing: bool
    speed: float


class SegmentRows(TypedDict):
    """Changes of the outline segments, or all of them."""

    added: list[tuple[int, float, float, float, float, float, float | None]]
    """Number, ends x1, y1, x2, y2, direction of the normal, time of completion."""
    removed: list[int]
    pinned: list[int]
    whole: bool


class StateHead(RobotStatus):
    """The part of a state that all clients share."""

    type: Literal["state"]
    cycle: int
    robot_s: float
    host_s: float
    pose: Triple
    ring_yaw: float
    twist: Pair
    flags: list[str]
    firing: list[int]
    ranges: list[float | None]
    age: list[float | None]
    cross_paths: list[CrossPathRow]
    clusters: Annotated[list[list[float]], list[ClusterBox]]
    objects: list[ObjectRow]
    areas: list[tuple[int, float, float, float]]
    """Number, x, y, radius of each vacant area."""
    canyons: list[CanyonRow]
    vectors: list[tuple[str, float, float]]
    drive_request: GoalRow | TeleoperateRow | LegsRow | MissionRow
    valley: ValleyRow | None
    phases: dict[str, float]
    """Duration of each phase, µs."""
    cycle_us: float | None
    late_us: float | None
    missed: int | None
    late: int | None
    quanta: int
    refinement: StopCause
    link: LinkRow | None
    waiting: int
    localized: LocalizedRow | None
    sensors: list[tuple[int, SensorFault, str]]
    playback: PlaybackRow | None


class StateMessage(StateHead):
    """The state after a cycle, as a client gets it."""

    segments: SegmentRows
    archived: NotRequired[list[ObjectRow]]
    polylines: NotRequired[list[PolylineRow]]
    known_way: NotRequired[WayRow]
    dropped: int
    controller: bool
