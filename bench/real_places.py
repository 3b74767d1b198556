"""The place without a map on real drives: errors against the truth, by odometry that drifts and by exact odometry.

The drives are those of `bench.real_rooms`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

import numpy as np

from bench.beacons import errors_when_aligned
from bench.range_statistics import POSE_COLUMNS, read_tables
from bench.real_rooms import Row
from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing, Floats, Pose
from perception.localization.localized_pose import LocalizedPose
from runtime.recording.ring_log_replay import replay_localized

WRONG_M: Final = 0.5
WRONG_SIGMAS: Final = 3.5
"""A place that is off by more than both is wrong."""


def measure(folders: Iterable[Path], tell: Callable[[str], None]) -> dict[str, Row]:
    """Follow each drive by its own odometry and by exact poses; return errors in m and shares."""
    rows: dict[str, Row] = {}
    for folder in folders:
        settings = load_settings(None, robot=str(folder / "robot.toml")).of_log()
        ring, truth = read_tables(folder, "ring.csv", "truth.csv")
        ranges = ring[:, POSE_COLUMNS:]
        for name, poses in ((folder.name, ring[:, 1:POSE_COLUMNS]), (f"{folder.name}, exact", truth)):
            tell(name)
            firings = [
                Firing(float(t), Pose(x, y, theta), theta, row)
                for t, (x, y, theta), row in zip(ring[:, 0], poses.tolist(), ranges, strict=True)
            ]
            rows[name] = _score(settings, firings, poses, truth)
    return rows


def _score(settings: Settings, firings: list[Firing], odometry: Floats, truth: Floats) -> Row:
    now: list[LocalizedPose] = []
    end: list[LocalizedPose] = []
    replay_localized(settings, firings, lambda _, here: now.append(here), lambda _, here: end.append(here))
    said = np.array([(here.pose.x, here.pose.y) for here in now])
    sigma = np.sqrt([here.covariance[0, 0] + here.covariance[1, 1] for here in now])
    is_tracking = np.array([here.status == "tracking" for here in now])
    turn = Pose(*odometry[0].tolist()).compose(Pose(*truth[0].tolist()).inverse())
    from_start = np.array([(at.x, at.y) for at in (turn.compose(Pose(*row)) for row in truth.tolist())])
    off = np.hypot(*(said - from_start).T)
    at_end = errors_when_aligned(np.array([(here.pose.x, here.pose.y) for here in end]), truth[:, :2])
    return {
        "odometry": _rms(errors_when_aligned(odometry[:, :2], truth[:, :2])),
        "now": _rms(errors_when_aligned(said, truth[:, :2])),
        "end": _rms(at_end),
        "worst": float(at_end.max()),
        "wrong": float((is_tracking & (off > np.maximum(WRONG_M, WRONG_SIGMAS * sigma))).mean()),
        "not tracking": float((~is_tracking).mean()),
    }


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).mean()))
