"""The place without a map on real drives: errors against the truth, by odometry that drifts and by exact odometry.

The drives are those of `bench.real_rooms`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from bench.beacons import errors_when_aligned
from bench.range_statistics import POSE_COLUMNS, read_tables
from bench.real_rooms import Row, echo_places
from bench.trials.imperfect_trials import EXPLAINED_M, away_from
from bench.trials.wall_trials import Corner, Segment
from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing, Floats, Pose
from perception.localization.localized_pose import LocalizedPose
from perception.localization.submaps.echo_lag import lag_of
from runtime.recording.conventions.echo_lag import at_heard_poses
from runtime.recording.replay_summary import ReplaySummary
from runtime.recording.ring_log_replay import FiringReplayer, replay_localized

WAY_M: Final = 3.0
"""Way over which the error of a relative place is measured."""
WRONG_M: Final = 0.5
WRONG_SIGMAS: Final = 3.5
"""A place that is off by more than both is wrong."""


def measure(folders: Iterable[Path], tell: Callable[[str], None]) -> dict[str, Row]:
    """Follow each drive by its own odometry and by exact poses; return errors in m and shares."""
    rows: dict[str, Row] = {}
    for folder in folders:
        settings = load_settings(None, robot=str(folder / "robot.toml")).of_log()
        ring, truth, bearings = read_tables(folder, "ring.csv", "truth.csv", "bearings.csv")
        ranges = ring[:, POSE_COLUMNS:]
        for name, poses in ((folder.name, ring[:, 1:POSE_COLUMNS]), (f"{folder.name}, exact", truth)):
            tell(name)
            firings = [
                Firing(float(t), Pose(x, y, theta), theta, row)
                for t, (x, y, theta), row in zip(ring[:, 0], poses.tolist(), ranges, strict=True)
            ]
            lag = lag_of(firings, settings.ring)
            heard = list(at_heard_poses(firings, lag.lag_s if lag.is_refuted else 0.0))
            found = followed(settings, heard)
            rows[name] = {"lag s": lag.lag_s, "± s": lag.sigma_s, **place_errors(found, poses, truth)}
            rows[name]["explained"] = _explained(found, ranges, bearings)
            rows[name]["explained in a run"] = _explained(run(settings, heard), ranges, bearings)
    return rows


@dataclass(frozen=True, slots=True)
class Followed:
    """A drive followed without a map: what was perceived, and the poses as known at the time and at the end."""

    summary: ReplaySummary
    now: list[LocalizedPose]
    end: list[LocalizedPose]

    def path(self) -> Floats:
        """Return the path as known at the end, shape (n, 3), m and rad."""
        return np.array([(here.pose.x, here.pose.y, here.pose.theta) for here in self.end])


def followed(settings: Settings, firings: Sequence[Firing]) -> Followed:
    """Follow a drive, drift corrected."""
    now: list[LocalizedPose] = []
    end: list[LocalizedPose] = []
    summary = replay_localized(settings, firings, lambda _, here: now.append(here), lambda _, here: end.append(here))
    return Followed(summary, now, end)


def run(settings: Settings, firings: Sequence[Firing]) -> Followed:
    """Follow a drive as a run does, drift corrected: its results are those of the quanta after each firing."""
    localization = settings.perception.localization.model_copy(update={"correct_drift": True})
    perceives = settings.perception.model_copy(update={"localization": localization})
    replayer = FiringReplayer(settings.model_copy(update={"perception": perceives}), firings)
    perception, taken = replayer.perception, []
    for _ in replayer:
        here = perception.localized()
        if here is not None:
            taken.append((here, perception.map_frame.moment()))
    end = [perception.map_frame.as_known_now(then, moment) for then, moment in taken]
    return Followed(replayer.summary(perception.odometry_from_map().inverse()), [then for then, _ in taken], end)


def place_errors(found: Followed, odometry: Floats, truth: Floats) -> Row:
    """Return the errors of the place, m, and the shares of firings that are wrong or do not track.

    Parameters
    ----------
    found : Followed
        The drive.
    odometry, truth : (n, 3) float
        Its poses, m and rad.
    """
    said = np.array([(here.pose.x, here.pose.y) for here in found.now])
    sigma = np.sqrt([here.covariance[0, 0] + here.covariance[1, 1] for here in found.now])
    is_tracking = np.array([here.status == "tracking" for here in found.now])
    turn = Pose(*odometry[0].tolist()).compose(Pose(*truth[0].tolist()).inverse())
    from_start = np.array([(at.x, at.y) for at in (turn.compose(Pose(*row)) for row in truth.tolist())])
    off = np.hypot(*(said - from_start).T)
    path = found.path()
    at_end = errors_when_aligned(path[:, :2], truth[:, :2])
    return {
        "odometry": rms(errors_when_aligned(odometry[:, :2], truth[:, :2])),
        "now": rms(errors_when_aligned(said, truth[:, :2])),
        "end": rms(at_end),
        "worst": float(at_end.max()),
        "odometry over 3 m": _over_way(odometry, truth),
        "over 3 m": _over_way(path, truth),
        "wrong": float((is_tracking & (off > np.maximum(WRONG_M, WRONG_SIGMAS * sigma))).mean()),
        "not tracking": float((~is_tracking).mean()),
    }


def _explained(found: Followed, ranges: Floats, bearings: Floats) -> float:
    """Return the share of the echoes, from the path as known at the end, that lie near a wall or a corner."""
    walls = [Segment(np.array([w["x1"], w["y1"]]), np.array([w["x2"], w["y2"]])) for w in found.summary["walls"]]
    corners = [Corner(one["x"], one["y"], is_edge=False) for one in found.summary["corners"]]
    echoes = echo_places(found.path(), ranges, bearings)
    return float((away_from(echoes, walls, corners) < EXPLAINED_M).mean())


def _over_way(poses: Floats, truth: Floats) -> float:
    """Return the error of where the robot is `WAY_M` later, in its own frame, m."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    first = np.flatnonzero(way < way[-1] - WAY_M)
    later = np.searchsorted(way, way[first] + WAY_M)
    moved = []
    for at in (poses, truth):
        (dx, dy), c, s = (at[later, :2] - at[first, :2]).T, np.cos(at[first, 2]), np.sin(at[first, 2])
        moved.append(np.column_stack([c * dx + s * dy, c * dy - s * dx]))
    return rms(np.hypot(*(moved[0] - moved[1]).T)) if len(first) else 0.0


def rms(errors: Floats) -> float:
    """Return the root mean square of errors."""
    return float(np.sqrt((errors**2).mean()))
