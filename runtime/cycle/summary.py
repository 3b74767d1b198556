"""The summary of a run in the JSON forms of the public surface."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, NotRequired, TypedDict

import orjson

from config.errors import FAILED, UserError
from drivers.driver import RobotDriver
from drivers.messages import Pose
from perception.detected_object import DetectedObject, turned_object
from perception.localization.localized_pose import LocalizedPose, Status
from perception.pipeline import Perception
from runtime.cycle.logs.mission_log import MissionRow
from runtime.cycle.logs.mode_log import ModeLog
from runtime.cycle.modes import Mode
from runtime.cycle.step import State
from runtime.timing.cycle_stats import CycleStats, Quantiles
from runtime.timing.footprint import FootprintRow
from runtime.timing.timing_monitor import TimingMonitor, TimingSummary

CORNER_KINDS: Final[Mapping[str, Literal["inside", "edge"]]] = MappingProxyType(
    {"inside corner": "inside", "edge": "edge"}
)
"""Kinds of corners by the labels that perception gives them."""


class ObjectRow(TypedDict):
    """One object: metres and radians, in the odometry's frame."""

    model: str
    x: float
    y: float
    theta: float
    sigma: float
    support: int
    score: float
    probability: NotRequired[float]
    """Probability that it is this model."""
    covariance: NotRequired[tuple[float, float, float]]
    """xx, xy, yy of the position, m²."""
    number: NotRequired[int]
    """As on the page; of the same sequence as those of walls."""
    sigma_theta: NotRequired[float]
    """Standard error of `theta`, rad; of models with corners."""


class WallRow(TypedDict):
    """One wall: its ends, m, in the frame of the objects."""

    x1: float
    y1: float
    x2: float
    y2: float
    probability: float
    sigma_offset: float
    """Standard error across the wall, the mean over its length, m."""
    sigma_angle: float
    """rad"""
    number: int | None


class CornerRow(TypedDict):
    """One corner, m, in the frame of the objects."""

    x: float
    y: float
    kind: Literal["inside", "edge"]
    sigma: float
    probability: float


class CanyonRow(TypedDict):
    """One box canyon, m and rad, in the frame of the objects: its mouth, the direction inwards, and its depth."""

    number: int
    x1: float
    y1: float
    x2: float
    y2: float
    axis: float
    depth: float
    probability: float


class PolylineRow(TypedDict):
    """One polyline: what is not straight, m, in the frame of the objects."""

    number: int
    points: list[list[float]]
    """x, y of each, in order."""
    probability: float


class PerceivedRows(TypedDict):
    """What perception reports, in one frame."""

    objects: list[ObjectRow]
    walls: list[WallRow]
    corners: list[CornerRow]
    canyons: list[CanyonRow]
    polylines: list[PolylineRow]


class PoseRow(TypedDict):
    """The robot in the map frame; m and rad."""

    x: float
    y: float
    theta: float
    covariance: list[list[float]]
    """Of x, y and theta."""
    status: Status
    probability: float


class LinkRow(TypedDict):
    """Frames received, malformed frames, and frames lost on the line."""

    frames: int
    bad: int
    lost: int


class SensorRow(TypedDict):
    """A sensor whose ranges are not used, and why; `fault` as in `perception.sensor_faults.report`."""

    sensor: int
    fault: str
    reason: str


class RecordingRow(TypedDict):
    """The recording of a run: the newest of its files, bytes in all of them, messages that are missing."""

    file: str | None
    files: int
    bytes: int
    dropped: int
    last_error: str | None
    sync_max_s: float


class LogRow(TypedDict):
    """Lines of the log that are missing in its file, and why."""

    lost: int
    last_error: str | None


class StartSummary(PerceivedRows):
    """Summary of a run that ended before its first cycle: the fields that need none."""

    cycles: int
    cycle_us: Quantiles
    late: int
    missed: int
    link: LinkRow
    mode: str
    stop_reasons: list[str]


class RunSummary(StartSummary):
    """Summary of ``echolocate run``."""

    lag_us: Quantiles
    sensors: list[SensorRow]
    process: FootprintRow
    hold_reasons: list[str]
    """Why the robot held or made no progress in DRIVE, in order."""
    mission: MissionRow | None
    """None if there was none."""
    preparing: str | None
    """How far the preparation of recognition was at the end; None if it had started."""
    timing: TimingSummary
    pose: NotRequired[PoseRow]
    """Of a run that corrects drift or has a map: the robot at the end. The objects are in odometry's frame."""
    recording: NotRequired[RecordingRow]
    log: NotRequired[LogRow]


def object_row(seen: DetectedObject) -> ObjectRow:
    """Return an object in its JSON form."""
    row: ObjectRow = {
        "model": seen.model,
        "x": seen.x,
        "y": seen.y,
        "theta": seen.theta,
        "sigma": seen.sigma,
        "support": seen.support,
        "score": seen.score,
    }
    if seen.probability is not None:
        row["probability"] = seen.probability
    if seen.covariance is not None:
        row["covariance"] = seen.covariance
    if seen.number is not None:
        row["number"] = seen.number
    if seen.sigma_theta is not None:
        row["sigma_theta"] = seen.sigma_theta
    return row


def perceived_rows(
    perception: Perception, to: Pose | None = None, objects: Iterable[DetectedObject] | None = None
) -> PerceivedRows:
    """Return what perception reports in its JSON form.

    Parameters
    ----------
    perception : Perception
        With everything perceived so far.
    to : Pose, optional
        Pose of the odometry's frame in that of the result; by default they are the same.
    objects : iterable of DetectedObject, optional
        The models' objects in the frame of the result, where that is known better; by default those of `perception`.
    """
    to = Pose(0.0, 0.0, 0.0) if to is None else to
    found = (turned_object(to, seen) for seen in perception.objects()) if objects is None else objects
    rows: PerceivedRows = {
        "objects": [object_row(seen) for seen in found],
        "walls": [],
        "corners": [],
        "canyons": [],
        "polylines": [],
    }
    for canyon in perception.canyons():
        begin, end = (to.compose(Pose(*at, 0.0)) for at in (canyon.mouth[:2], canyon.mouth[2:]))
        rows["canyons"].append(
            {
                "number": canyon.number,
                "x1": begin.x,
                "y1": begin.y,
                "x2": end.x,
                "y2": end.y,
                "axis": math.remainder(to.theta + canyon.axis_rad, math.tau),
                "depth": canyon.depth_m,
                "probability": canyon.probability,
            }
        )
    labelled = (*perception.labelled_objects(), *perception.archived_objects())
    for seen in (turned_object(to, one) for one in labelled):
        if seen.ends is not None and seen.covariance is not None:
            x1, y1, x2, y2 = seen.ends
            nx, ny, (xx, xy, yy) = -math.sin(seen.theta), math.cos(seen.theta), seen.covariance
            across = nx * nx * xx + 2.0 * nx * ny * xy + ny * ny * yy
            rows["walls"].append(
                {
                    "x1": x1,
                    "y1": y1,
                    "x2": x2,
                    "y2": y2,
                    "probability": seen.score,
                    "sigma_offset": math.sqrt(max(0.0, across)),
                    "sigma_angle": seen.sigma_theta or 0.0,
                    "number": seen.number,
                }
            )
        elif seen.model in CORNER_KINDS:
            rows["corners"].append(
                {
                    "x": seen.x,
                    "y": seen.y,
                    "kind": CORNER_KINDS[seen.model],
                    "sigma": seen.sigma,
                    "probability": seen.score,
                }
            )
    for line in (one.in_frame(to) for one in perception.polylines()):
        rows["polylines"].append(
            {
                "number": line.number,
                "points": line.points.tolist(),
                "probability": line.probability,
            }
        )
    return rows


def pose_row(here: LocalizedPose) -> PoseRow:
    """Return the robot's pose as JSON has it."""
    return {
        "x": here.pose.x,
        "y": here.pose.y,
        "theta": here.pose.theta,
        "covariance": here.covariance.tolist(),
        "status": here.status,
        "probability": here.probability,
    }


def run_summary(
    state: State,
    stats: CycleStats,
    timing_monitor: TimingMonitor,
    driver: RobotDriver,
    footprint: FootprintRow,
    mode_log: ModeLog,
) -> RunSummary:
    """Return the summary of a run.

    Objects are in the robot's own odometry, with its jumps.
    """
    counts = driver.counts
    perceived = perceived_rows(state.perception, driver.odometry_origin)
    summary: RunSummary = {
        "objects": perceived["objects"],
        "walls": perceived["walls"],
        "corners": perceived["corners"],
        "canyons": perceived["canyons"],
        "polylines": perceived["polylines"],
        "cycles": stats.cycles,
        "cycle_us": stats.cycle_us(),
        "late": stats.late,
        "missed": stats.missed,
        "lag_us": stats.lag_us(),
        "sensors": [
            {"sensor": r.sensor, "fault": r.fault, "reason": r.reason} for r in state.perception.sensor_reports()
        ],
        "link": {"frames": counts.frames, "bad": counts.bad, "lost": counts.lost},
        "process": footprint,
        "mode": state.mode.mode.value,
        "stop_reasons": mode_log.stop_reasons,
        "hold_reasons": mode_log.hold_reasons,
        "mission": mode_log.missions.row,
        "preparing": state.preparing,
        "timing": timing_monitor.summary(),
    }
    here = state.perception.localized()
    if here is not None:
        summary["pose"] = pose_row(here)
    return summary


def failed_start(reason: str) -> StartSummary:
    """Return the summary of a run that ended before its first cycle, given why."""
    return {
        "objects": [],
        "walls": [],
        "corners": [],
        "canyons": [],
        "polylines": [],
        "cycles": 0,
        "cycle_us": {"p50": 0.0, "p99": 0.0, "max": 0.0},
        "late": 0,
        "missed": 0,
        "link": {"frames": 0, "bad": 0, "lost": 0},
        "mode": Mode.CONNECTING.value,
        "stop_reasons": [reason],
    }


def write_json(path: str, summary: object) -> None:
    """Write a summary where ``--json`` says.

    Raises
    ------
    UserError
        The file cannot be written.
    """
    try:
        Path(path).write_bytes(orjson.dumps(summary, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE))
    except OSError as error:
        raise UserError(f"--json {path}: cannot be written: {error.strerror}; choose another file", FAILED) from error
