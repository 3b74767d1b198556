"""Logs replayed with correction of drift and without: what it changes where odometry is good."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import mean
from typing import Final

from bench.correction_drives import correction_drive, level_name
from config.world import OdometryConfig
from drivers.messages import Pose, wrap_angle
from runtime.recording.replay_summary import ReplaySummary
from runtime.recording.ring_log_replay import replay_firings, replay_localized
from runtime.simulation.drift_trials import LEVELS

NEAR_GOOD: Final = OdometryConfig(scale=1.002, heading_rad_per_sqrt_m=math.radians(0.1))
MOVED_M: Final = 0.02
"""An object or a wall that is farther off than this has moved."""
SAME_M: Final = 0.5
"""Objects of two replays that are farther apart are two."""
MATCH_M: Final = 0.3048
"""An object farther than this from every drum is false."""

Wall = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Comparison:
    """One log; a pair is the value without correction and the one with it.

    Attributes
    ----------
    is_equal : bool
        Whether objects and walls are the same to the bit.
    more, fewer, moved : int
        Objects that only one replay has, and those that have moved.
    walls : int
        Walls of either replay that are not in the other one.
    false, missed : tuple of int
        By the truth.
    errors : tuple of list
        Distances of the objects from their drums, m.
    place_m : tuple of float
        Errors of the robot's place at the end.
    heading : tuple of float
        The same of its heading, rad.
    """

    is_equal: bool
    more: int
    fewer: int
    moved: int
    walls: int
    false: tuple[int, int]
    missed: tuple[int, int]
    errors: tuple[list[float], list[float]]
    place_m: tuple[float, float]
    heading: tuple[float, float]


def compare(seed: int, odometry: OdometryConfig) -> Comparison:
    """Replay one log both ways."""
    drive = correction_drive(seed, odometry)
    plain = replay_firings(drive.settings, drive.firings)
    corrected = replay_localized(drive.settings, drive.firings, lambda *_: None)
    before, after = _places(plain), _places(corrected)
    apart = _distances(before, after, SAME_M)
    of_truth = [_distances(found, drive.drums(), MATCH_M) for found in (before, after)]
    end, reported, found = drive.truth[-1], drive.firings[-1].pose, corrected["pose"]
    ends = (reported, Pose(found["x"], found["y"], found["theta"]))
    return Comparison(
        before == after and _walls(plain) == _walls(corrected),
        len(after) - len(apart), len(before) - len(apart), sum(distance > MOVED_M for distance in apart),
        unmatched(_walls(plain), _walls(corrected)) + unmatched(_walls(corrected), _walls(plain)),
        (len(before) - len(of_truth[0]), len(after) - len(of_truth[1])),
        (len(drive.drums()) - len(of_truth[0]), len(drive.drums()) - len(of_truth[1])),
        (of_truth[0], of_truth[1]),
        (_place_m(ends[0], end), _place_m(ends[1], end)),
        (_turn(ends[0], end), _turn(ends[1], end)),
    )  # fmt: skip


def measure(seeds: Iterable[int], report: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Return the figures of the logs, by level of odometry's errors.

    Parameters
    ----------
    seeds
        Which logs.
    report
        Called with a line on what is running.
    """
    seeds, rows = tuple(seeds), {}
    for odometry in (LEVELS[0], NEAR_GOOD, *LEVELS[1:3]):
        name = level_name(odometry) if odometry is not NEAR_GOOD else "0.2%, 0.1°/√m"
        trials = []
        for seed in seeds:
            report(f"correction: {name}, log {seed}")
            trials.append(compare(seed, odometry))
        rows[name] = {
            "logs": float(len(trials)), "equal": float(sum(one.is_equal for one in trials)),
            "more": float(sum(one.more for one in trials)), "fewer": float(sum(one.fewer for one in trials)),
            "moved": float(sum(one.moved for one in trials)), "walls": float(sum(one.walls for one in trials)),
        }  # fmt: skip
        for k, which in enumerate(("plain", "corrected")):
            errors = [error for one in trials for error in one.errors[k]]
            rows[name] |= {
                f"false, {which}": float(sum(one.false[k] for one in trials)),
                f"missed, {which}": float(sum(one.missed[k] for one in trials)),
                f"drum_m, {which}": mean(errors) if errors else math.nan,
                f"place_m, {which}": mean(one.place_m[k] for one in trials),
                f"heading_deg, {which}": math.degrees(mean(one.heading[k] for one in trials)),
            }
    return rows


def _places(summary: ReplaySummary) -> list[tuple[float, float]]:
    return [(one["x"], one["y"]) for one in summary["objects"]]


def _walls(summary: ReplaySummary) -> list[Wall]:
    return [(one["x1"], one["y1"], one["x2"], one["y2"]) for one in summary["walls"]]


def _distances(
    found: Sequence[tuple[float, float]], others: Sequence[tuple[float, float]], most_m: float
) -> list[float]:  # fmt: skip
    """Return the distances of the pairs of nearest places, each of which is in one pair."""
    apart, taken = [], set[tuple[str, int]]()
    for d, i, k in sorted((math.dist(a, b), i, k) for i, a in enumerate(found) for k, b in enumerate(others)):
        if d <= most_m and taken.isdisjoint({("found", i), ("other", k)}):
            taken |= {("found", i), ("other", k)}
            apart.append(d)
    return apart


def unmatched(walls: Sequence[Wall], others: Sequence[Wall]) -> int:
    """Return how many of the walls lie on none of the others."""
    return sum(all(_off_m(wall, other) > MOVED_M for other in others) for wall in walls)


def _off_m(wall: Wall, other: Wall) -> float:
    """Return how far the ends of a wall are from the line of another one that it overlaps, else infinity, m."""
    length = math.dist(other[:2], other[2:])
    ux, uy = (other[2] - other[0]) / length, (other[3] - other[1]) / length
    seen = [(x - other[0], y - other[1]) for x, y in (wall[:2], wall[2:])]
    along = [dx * ux + dy * uy for dx, dy in seen]
    if max(along) < 0.0 or min(along) > length:
        return math.inf
    return max(abs(dy * ux - dx * uy) for dx, dy in seen)


def _place_m(pose: Pose, true: Pose) -> float:
    return math.dist((pose.x, pose.y), (true.x, true.y))


def _turn(pose: Pose, true: Pose) -> float:
    return abs(wrap_angle(pose.theta - true.theta))
