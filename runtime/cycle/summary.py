"""The summary of a run in the JSON forms of the public surface."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NotRequired, TypedDict

import orjson

from config.errors import FAILED, UserError
from drivers.driver import RobotDriver
from drivers.messages import Pose
from perception.pipeline import DetectedObject
from runtime.cycle.step import State
from runtime.timing.cycle_stats import CycleStats, Quantiles
from runtime.timing.footprint import FootprintRow
from runtime.timing.timing_monitor import TimingMonitor, TimingSummary


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


class LinkRow(TypedDict):
    """Frames received, malformed frames, and frames lost on the line."""

    frames: int
    bad: int
    lost: int


class SensorRow(TypedDict):
    """A sensor whose ranges are not used, and why; `fault` as in `perception.sensor_report`."""

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


class RunSummary(TypedDict):
    """Summary of ``echolocate run``."""

    objects: list[ObjectRow]
    cycles: int
    cycle_us: Quantiles
    late: int
    missed: int
    lag_us: Quantiles
    link: LinkRow
    sensors: list[SensorRow]
    process: FootprintRow
    mode: str
    stop_reasons: list[str]
    timing: TimingSummary
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
    return row


def in_frame(frame: Pose, seen: DetectedObject) -> DetectedObject:
    """Return an object in another frame, in which the present origin lies at `frame`."""
    if frame == Pose(0.0, 0.0, 0.0):
        return seen
    place = frame.compose(Pose(seen.x, seen.y, seen.theta))
    covariance = seen.covariance
    if covariance is not None:
        xx, xy, yy = covariance
        c, s = math.cos(frame.theta), math.sin(frame.theta)
        covariance = (
            c * c * xx - 2.0 * c * s * xy + s * s * yy,
            c * s * (xx - yy) + (c * c - s * s) * xy,
            s * s * xx + 2.0 * c * s * xy + c * c * yy,
        )
    return replace(seen, x=place.x, y=place.y, theta=place.theta, covariance=covariance)


def run_summary(
    state: State,
    stats: CycleStats,
    timing_monitor: TimingMonitor,
    driver: RobotDriver,
    footprint: FootprintRow,
    stop_reasons: list[str],
) -> RunSummary:
    """Return the summary of a run.

    Parameters
    ----------
    state : State
        What the last cycle left. Objects are given in the robot's own odometry, with its jumps.
    stats : CycleStats
        Durations and lateness of the cycles.
    timing_monitor : TimingMonitor
        What delayed them.
    driver : RobotDriver
        Counts of the line, and the origin of the odometry.
    footprint : FootprintRow
        What the process used of its machine.
    stop_reasons : list of str
        Of every stop, in order.
    """
    counts = driver.counts
    return {
        "objects": [object_row(in_frame(driver.odometry_origin, seen)) for seen in state.perception.objects()],
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
        "stop_reasons": stop_reasons,
        "timing": timing_monitor.summary(),
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
