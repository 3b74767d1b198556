"""What is explained of real drives: echoes near reported surfaces, and reported surfaces with nothing near.

A drive is a folder with `ring.csv` (a ring log), `robot.toml`, `truth.csv` (x, y, theta of each row) and
`bearings.csv` (in the robot's frame, of what answered; empty for silence and strays). Beside it, in
`NAME-points.csv`, are the points (x, y) that a laser saw, where the folder is `NAME-SURFACES`. Lengths are metres,
angles radians.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from config.errors import WRONG_CALL, UserError
from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing, Floats, Pose
from perception.kernel import Ints
from perception.mapping.surfaces.surface_list import find_near
from perception.pipeline import Perception
from runtime.recording.ring_log_replay import FiringReplayer

EXPLAINED_M: Final = 0.1
"""An echo is explained by a surface within this."""
FALSE_M: Final = 0.15
"""A place of a surface is false if the laser saw nothing within this."""
STEP_M: Final = 0.05
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


def read_table(path: Path) -> tuple[list[str], Floats]:
    """Return the header and the numbers of a table; an empty cell is NaN.

    Raises
    ------
    UserError
        It cannot be read.
    """
    try:
        with path.open(newline="") as file:
            header, *rows = csv.reader(file)
        return header, np.array([[float(cell or "nan") for cell in row] for row in rows])
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: {error}; a drive needs ring.csv, truth.csv, bearings.csv", WRONG_CALL) from error


def read_drive(folder: Path) -> RealDrive:
    """Return the drive of a folder.

    Raises
    ------
    UserError
        A file is missing or has no numbers.
    """
    settings = load_settings(None, robot=str(folder / "robot.toml")).of_log()
    _, ring = read_table(folder / "ring.csv")
    _, truth = read_table(folder / "truth.csv")
    _, bearings = read_table(folder / "bearings.csv")
    _, points = read_table(folder.parent / f"{folder.name.rsplit('-', 1)[0]}-points.csv")
    times, ranges = ring[:, 0], ring[:, 4:]
    rows, columns = np.nonzero(np.isfinite(ranges) & np.isfinite(bearings))
    angles, heard = truth[rows, 2] + bearings[rows, columns], ranges[rows, columns]
    echoes = truth[rows, :2] + heard[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    firings = tuple(
        Firing(float(t), Pose(x, y, theta), theta, row)
        for t, (x, y, theta), row in zip(times, truth.tolist(), ranges, strict=True)
    )
    return RealDrive(settings, firings, echoes, points)


def rounded(firings: Iterable[Firing], steps: tuple[float, float, float]) -> list[Firing]:
    """Return firings with poses, ranges and times in whole steps, as `ROUNDINGS` has them."""
    pose_step, range_step, time_step = steps
    found = []
    for firing in firings:
        x, y, theta = (round(v / pose_step) * pose_step for v in (firing.pose.x, firing.pose.y, firing.pose.theta))
        ranges = np.round(firing.ranges_m / range_step) * range_step
        found.append(Firing(round(firing.robot_s / time_step) * time_step, Pose(x, y, theta), theta, ranges))
    return found


def score(drive: RealDrive, firings: Iterable[Firing]) -> Row:
    """Return what is explained of a drive, and what is false, after its firings were perceived."""
    replayer = FiringReplayer(drive.settings, firings)
    for _ in replayer:
        pass
    walls, outlines, corners = surfaces(replayer.perception)
    found = near(drive.echoes, np.concatenate([walls, np.hstack([corners, corners])]))
    both = found | near(drive.echoes, outlines)
    return {
        "echoes": len(found),
        "explained": float(found.mean()),
        "false": false_share(walls, drive.points),
        "with outlines": float(both.mean()),
        "outlines false": false_share(outlines, drive.points),
        "drums": sum(one.model in {"drum", "semicircle"} for one in replayer.perception.objects()),
    }


def surfaces(perception: Perception) -> tuple[Floats, Floats, Floats]:
    """Return the ends of walls and of the parts of polylines, (n, 4), and the corners, (m, 2), m."""
    seen = (*perception.labelled_objects(), *perception.archived_objects())
    walls = [one.ends for one in seen if one.ends is not None]
    corners = [(one.x, one.y) for one in seen if one.model in {"inside corner", "edge"}]
    parts = [np.column_stack([one.points[:-1], one.points[1:]]) for one in perception.polylines()]
    outlines = np.concatenate(parts) if parts else np.empty((0, 4))
    return np.array(walls).reshape(-1, 4), outlines, np.array(corners).reshape(-1, 2)


def near(points: Floats, ends: Floats, within: float = EXPLAINED_M) -> Ints:
    """Return 1 for each point near one of some segments, else 0."""
    found = np.zeros(len(points), np.int64)
    find_near(np.ascontiguousarray(points), np.ascontiguousarray(ends), within, found)
    return found


def false_share(ends: Floats, points: Floats) -> float:
    """Return the share of the length of segments with no point near; 0 without any."""
    false_m, total_m = 0.0, 0.0
    dots = np.hstack([points, points])
    for x1, y1, x2, y2 in ends.tolist():
        length = math.hypot(x2 - x1, y2 - y1)
        shares = np.linspace(0.0, 1.0, max(2, int(length / STEP_M)))[:, None]
        places = np.array([x1, y1]) + shares * np.array([x2 - x1, y2 - y1])
        false_m += length * (1.0 - float(near(places, dots, FALSE_M).mean()))
        total_m += length
    return false_m / total_m if total_m > 0.0 else 0.0


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
        row = score(drive, drive.firings)
        others = [row["explained"]]
        for k in range(roundings):
            report(f"real rooms: {folder.name}, rounded {k + 1} of {roundings}")
            steps = tuple((1.0 + 0.1 * (k // len(ROUNDINGS))) * step for step in ROUNDINGS[k % len(ROUNDINGS)])
            others.append(score(drive, rounded(drive.firings, (steps[0], steps[1], steps[2])))["explained"])
        row["spread"] = max(others) - min(others)
        rows[folder.name] = row
    return rows
