"""What is explained of real drives: echoes near reported surfaces, and reported surfaces with nothing near.

A drive is a folder with `ring.csv` (a ring log), `robot.toml`, `truth.csv` (x, y, theta of each row) and
`bearings.csv` (in the robot's frame, of what answered; empty for silence and strays). Beside it, in
`NAME-points.csv`, are the points (x, y) that a laser saw, where the folder is `NAME-SURFACES`. Lengths are metres,
angles radians.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from bench.free_cells import echoes_of, placed_ring
from bench.range_statistics import POSE_COLUMNS, read_tables
from bench.trials.imperfect_trials import (
    EXPLAINED_M,
    NEAR_M,
    ROUND,
    away_from,
    distances,
    false_length,
    reported_lines,
)
from bench.trials.wall_trials import Segment, reported_corners, reported_walls
from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing, Floats, Pose
from perception.pipeline import Perception
from runtime.analysis.export.occupancy_image import FREE, OCCUPIED, RESOLUTION_M, occupancy_image
from runtime.analysis.export.world_file import world_of
from runtime.recording.ring_log_replay import FiringReplayer

ROUNDINGS: Final = ((1e-4, 1e-3, 1e-3), (1e-3, 1e-3, 1e-2), (1e-4, 1e-2, 1e-3))
"""Steps of poses (m and rad), ranges (m) and times (s) to which a drive is rounded, in turns."""
Row = dict[str, float]


@dataclass(frozen=True, slots=True)
class RealDrive:
    """A drive with its truth.

    Attributes
    ----------
    settings : Settings
        Of its robot.
    firings : tuple of Firing
        At the true poses.
    echoes, points : (n, 2), (m, 2) float
        Where echoes came from, and what the laser saw, m.
    """

    settings: Settings
    firings: tuple[Firing, ...]
    echoes: Floats
    points: Floats


def read_drive(folder: Path) -> RealDrive:
    """Return the drive of a folder.

    Raises
    ------
    UserError
        A file is missing or has no numbers.
    """
    settings = load_settings(None, robot=str(folder / "robot.toml")).of_log()
    ring, truth, bearings = read_tables(folder, "ring.csv", "truth.csv", "bearings.csv")
    (points,) = read_tables(folder.parent, f"{folder.name.rsplit('-', 1)[0]}-points.csv")
    times, ranges = ring[:, 0], ring[:, POSE_COLUMNS:]
    echoes = echo_places(truth, ranges, bearings)
    firings = tuple(
        Firing(float(t), Pose(x, y, theta), theta, row)
        for t, (x, y, theta), row in zip(times, truth.tolist(), ranges, strict=True)
    )
    return RealDrive(settings, firings, echoes, points)


def echo_places(poses: Floats, ranges: Floats, bearings: Floats) -> Floats:
    """Return where echoes came from, shape (n, 2), m.

    Parameters
    ----------
    poses : (k, 3) float
        x, y (m) and direction (rad) of the ring at each firing.
    ranges, bearings : (k, sensors) float
        What was heard, m, and where that was in the robot's frame, rad; not finite for silence and strays.
    """
    rows, columns = np.nonzero(np.isfinite(ranges) & np.isfinite(bearings))
    angles, heard = poses[rows, 2] + bearings[rows, columns], ranges[rows, columns]
    return np.asarray(poses[rows, :2] + heard[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]))


def rounded(firings: Iterable[Firing], steps: tuple[float, float, float]) -> list[Firing]:
    """Return firings with poses, ranges and times in whole steps, as `ROUNDINGS` has them."""
    pose_step, range_step, time_step = steps
    found = []
    for firing in firings:
        x, y, theta = (round(v / pose_step) * pose_step for v in (firing.pose.x, firing.pose.y, firing.pose.theta))
        ranges = np.round(firing.ranges_m / range_step) * range_step
        found.append(Firing(round(firing.robot_s / time_step) * time_step, Pose(x, y, theta), theta, ranges))
    return found


def perceived(drive: RealDrive, firings: Iterable[Firing]) -> Perception:
    """Return perception after it was given firings of a drive."""
    replayer = FiringReplayer(drive.settings, firings)
    for _ in replayer:
        pass
    return replayer.perception


def score_image(drive: RealDrive, perception: Perception) -> Row:
    """Return what is false of the exported image of a drive: occupied pixels and laser points in free ones."""
    settings, mapped = drive.settings, drive.settings.perception.maps_surfaces
    ring, radius_m = settings.ring, settings.body.radius_m
    seen = (*perception.labelled_objects(), *perception.archived_objects())
    walls = np.array([(*wall.begin, *wall.end) for wall in reported_walls(seen)]).reshape(-1, 4)
    bodies = [one for one in seen if one.ends is None]
    world = world_of(bodies, walls, settings.models, perception.polylines())
    way = np.array([(firing.pose.x, firing.pose.y) for firing in drive.firings])
    echoes = echoes_of(drive.firings, placed_ring(ring))
    image = occupancy_image(world, echoes, ring, way, radius_m, surfaces_mapped=mapped)
    pixels, corner = image.pixels[::-1], (image.x_m, image.y_m)
    rows, columns = np.nonzero(pixels == OCCUPIED)
    occupied = np.column_stack([columns + 0.5, rows + 0.5]) * RESOLUTION_M + corner
    away = np.array([np.hypot(*(drive.points - place).T).min() for place in occupied])
    at = np.floor((drive.points - corner) / RESOLUTION_M).astype(np.int64)
    at = at[((at >= 0) & (at < pixels.shape[::-1])).all(axis=1)]
    is_free = pixels[at[:, 1], at[:, 0]] == FREE
    return {"image false": float((away > NEAR_M).mean()), "points in free": float(is_free.sum() / len(drive.points))}


def score(drive: RealDrive, perception: Perception) -> Row:
    """Return what is explained of a drive, and what is false, after perception was given its firings."""
    seen = (*perception.labelled_objects(), *perception.archived_objects())
    walls, lines = reported_walls(seen), reported_lines(perception)
    away = away_from(drive.echoes, walls, reported_corners(seen))

    def to_surface(x: float, y: float) -> float:
        return float(np.hypot(*(drive.points - (x, y)).T).min())

    return {
        "echoes": len(away),
        "explained": float((away < EXPLAINED_M).mean()),
        "false": _share(false_length(walls, to_surface), walls),
        "with outlines": float((np.minimum(away, distances(drive.echoes, lines)) < EXPLAINED_M).mean()),
        "outlines false": _share(false_length(lines, to_surface), lines),
        "drums": sum(one.model in ROUND for one in perception.objects()),
    }


def _share(of_m: float, pieces: Sequence[Segment]) -> float:
    """Return a length as a share of that of all pieces; 0 without any."""
    return of_m / sum(piece.length_m for piece in pieces) if pieces else 0.0


def measure(folders: Iterable[Path], roundings: int, report: Callable[[str], None]) -> dict[str, Row]:
    """Return the figures of each drive.

    Parameters
    ----------
    folders
        The drives.
    roundings
        How many times each is perceived again with rounded numbers; the spread of the explained share is a figure.
    report
        Called with a line on what is running.
    """
    rows = {}
    for folder in folders:
        report(f"real rooms: {folder.name}")
        drive = read_drive(folder)
        perception = perceived(drive, drive.firings)
        row = score(drive, perception) | score_image(drive, perception)
        others = [row["explained"]]
        for k in range(roundings):
            report(f"real rooms: {folder.name}, rounded {k + 1} of {roundings}")
            steps = tuple((1.0 + 0.1 * (k // len(ROUNDINGS))) * step for step in ROUNDINGS[k % len(ROUNDINGS)])
            again = perceived(drive, rounded(drive.firings, (steps[0], steps[1], steps[2])))
            others.append(score(drive, again)["explained"])
        row["spread"] = max(others) - min(others)
        rows[folder.name] = row
    return rows
