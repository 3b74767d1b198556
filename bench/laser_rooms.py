"""Real buildings as known rooms: ring logs that are cut from the scans of a laser, and maps of its hits.

No public recording of a sonar ring with its true places is known. A laser's recording with corrected poses takes its
place: eleven sensors that look ahead, each with the scan's rays inside its beam. The map holds straight walls only,
as a user would draw it; what else the scans have is the clutter that a map lacks.
"""

from __future__ import annotations

import gzip
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bench.trials.known_room_trials import KnownDrive, drifting_odometry
from config.errors import WRONG_CALL, UserError
from config.robot import FiringConfig, RingConfig, SensorConfig
from config.world import WallConfig
from drivers.messages import Firing, Floats
from perception.localization.room.expected_ranges import Reflection
from perception.localization.room.room import Room, make_room

AXES_DEG: Final = tuple(range(-75, 76, 15))
RESOLUTION_M: Final = 0.03048
"""A tenth of a foot."""
REACH_M: Final = 5.0
RING: Final = RingConfig(
    sensors=tuple(SensorConfig(x_m=0.0, y_m=0.0, angle_deg=float(axis)) for axis in AXES_DEG),
    beam_half_angle_deg=12.0, resolution_m=RESOLUTION_M, range_min_m=0.15, range_max_m=REACH_M,
    firing=FiringConfig(sets=(tuple(range(len(AXES_DEG))),)),
)  # fmt: skip
"""The ring that is cut from the scans."""

MIRROR_RAD: Final = math.radians(6.0)
"""A mirror answers where its normal is this near to the ray."""
EDGE_M: Final = 1.0
"""An edge answers up to this distance."""
LONG_SHARE: Final = 0.3
LONG_M: Final = (0.3, 2.0)
"""Where nothing answers, so many readings are too long, by this much; the others are silent."""
STEP_M: Final = 0.3
"""Neighbouring rays whose ranges differ by more than this hit different surfaces."""
NORMAL_RAYS: Final = 3
"""Rays on each side that a surface's normal is fitted to."""

MAP_REACH_M: Final = 15.0
"""Hits farther away do not enter the map."""
FLAT_M: Final = 0.05
"""A wall's hits of one scan are nearer to its line than this, …"""
SAME_M: Final = 0.1
SAME_RAD: Final = math.radians(6.0)
"""… and one wall's lines of two scans are nearer to each other than this."""
OPENING_M: Final = 0.4
"""A greater gap between hits of one line is an opening."""
PIECE_M: Final = 0.2
SCANS_MAX: Final = 400
"""Scans of a recording that the walls of a world are made of, evenly spaced."""
WALL_M: Final = 0.4
"""Shorter walls are left out of a known room's map, and of a world to drive in: they are clutter."""


@dataclass(frozen=True, slots=True)
class LaserLog:
    """Scans with their corrected poses.

    Attributes
    ----------
    poses : (n, 3) float
        Of the scanner, m and rad.
    ranges_m : (n, k) float
        Counter-clockwise; inf where nothing was hit.
    bearings : (k,) float
        Of the rays in the scanner's frame, rad.
    """

    poses: Floats
    ranges_m: Floats
    bearings: Floats

    def hits(self, k: int) -> Floats:
        """Return the hits of a scan in the scanner's frame, m, shape (rays, 2); not finite where there is none."""
        with np.errstate(invalid="ignore"):
            rays = np.column_stack([np.cos(self.bearings), np.sin(self.bearings)])
            return np.asarray(rays * self.ranges_m[k][:, None])


def read_carmen(path: Path, none_m: float = 40.0) -> LaserLog:
    """Return the scans of a CARMEN log: its lines `FLASER n r1 … rn x y theta …`, a fan of 180°.

    Parameters
    ----------
    path : Path
        The log, plain or compressed by gzip.
    none_m : float
        A range from here on is none, m.

    Raises
    ------
    UserError
        The file cannot be read, or has no two scans of one form.
    """
    try:
        data = path.read_bytes()
        text = (gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data).decode("ascii", "replace")
        rows = [line.split() for line in text.splitlines() if line.startswith("FLASER ")]
        values = np.array([row[2 : 5 + int(row[1])] for row in rows], dtype=np.float64)
    except (OSError, EOFError, ValueError, IndexError) as error:
        raise UserError(f"{path}: cannot read this CARMEN log: {error}", WRONG_CALL) from error
    if values.ndim != 2 or len(values) < 2 or values.shape[1] < 10 or not np.isfinite(values).all():
        raise UserError(
            f"{path}: expected a CARMEN log with at least two lines FLASER n r1 … rn x y theta", WRONG_CALL
        )
    ranges_m, poses, count = values[:, :-3], values[:, -3:], values.shape[1] - 3
    step = math.pi / (count - 1 if count % 2 else count)
    bearings = -0.5 * math.pi + step * np.arange(count)
    return LaserLog(poses, np.where((ranges_m > 0.0) & (ranges_m < none_m), ranges_m, np.inf), bearings)


def sonar(log: LaserLog, k: int, reflection: Reflection, rng: np.random.Generator) -> Floats:
    """Return what the ring reads at a scan, m; inf for silence, shape (sensors,).

    Parameters
    ----------
    log : LaserLog
        The scans.
    k : int
        Which.
    reflection : str
        `cone`: the nearest hit in the beam. `specular`: the nearest one that is square to its ray, or an edge nearby.
    rng : numpy.random.Generator
        Which readings are too long.
    """
    ranges_m = log.ranges_m[k]
    answers = np.isfinite(ranges_m)
    if reflection == "specular":
        answers = answers & _mirrors(log, k)
    found = np.full(len(AXES_DEG), np.inf)
    for i, axis in enumerate(np.radians(AXES_DEG)):
        beam = np.abs(log.bearings - axis) <= math.radians(RING.beam_half_angle_deg) + 1e-9
        found[i] = np.min(ranges_m[beam & answers], initial=np.inf)
        if not np.isfinite(found[i]) and reflection == "specular" and rng.random() < LONG_SHARE:
            found[i] = np.min(ranges_m[beam]) + rng.uniform(*LONG_M)
    heard = (found >= RING.range_min_m) & (found <= REACH_M)
    return np.where(heard, np.rint(found / RESOLUTION_M) * RESOLUTION_M, np.inf)


def _mirrors(log: LaserLog, k: int) -> NDArray[np.bool_]:
    """Return which rays of a scan come back from a smooth surface, shape (rays,)."""
    ranges_m, hits = log.ranges_m[k], log.hits(k)
    answers = np.zeros(len(ranges_m), dtype=np.bool_)
    with np.errstate(invalid="ignore"):
        breaks = ~(np.abs(np.diff(ranges_m)) <= STEP_M)
    for i in np.flatnonzero(np.isfinite(ranges_m)).tolist():
        low, high = i, i
        while low > max(0, i - NORMAL_RAYS) and not breaks[low - 1]:
            low -= 1
        while high < min(len(ranges_m) - 1, i + NORMAL_RAYS) and not breaks[high]:
            high += 1
        left = ranges_m[i - 1] if i else ranges_m[i]
        right = ranges_m[i + 1] if i + 1 < len(ranges_m) else ranges_m[i]
        if ranges_m[i] <= EDGE_M and max(left, right) > ranges_m[i] + STEP_M:
            answers[i] = True
        elif high - low >= 2:
            off = hits[low : high + 1] - hits[low : high + 1].mean(axis=0)
            normal = np.linalg.eigh(off.T @ off)[1][:, 0]
            ray = hits[i] / ranges_m[i]
            answers[i] = abs(float(normal @ ray)) >= math.cos(MIRROR_RAD)
    return answers


def world_walls(log: LaserLog) -> Floats:
    """Return the walls of a world to drive in, from so many scans at most as `SCANS_MAX`, shape (n, 4), m."""
    return wall_map(log, range(0, len(log.poses), max(1, len(log.poses) // SCANS_MAX)), WALL_M).walls


def walls_around(walls: Floats, low: Floats, high: Floats) -> tuple[WallConfig, ...]:
    """Return those of some walls, shape (n, 4), that reach into a box from one corner to the other, m."""
    ends = walls.reshape(-1, 2, 2)
    near = (ends.max(axis=1) >= low).all(axis=1) & (ends.min(axis=1) <= high).all(axis=1)
    return tuple(WallConfig(x1_m=a, y1_m=b, x2_m=c, y2_m=d) for a, b, c, d in walls[near].tolist())


def wall_map(log: LaserLog, scans: Sequence[int], least_m: float = PIECE_M) -> Room:
    """Return the straight walls that some scans hit.

    Parameters
    ----------
    log : LaserLog
        The scans.
    scans : sequence of int
        Which.
    least_m : float
        Shorter walls are left out, m.
    """
    pieces = [piece for k in scans for piece in _pieces(log, k)]
    pieces.sort(key=lambda piece: -float(np.hypot(*(piece[-1] - piece[0]))))
    walls: list[tuple[float, ...]] = []
    ends = np.array([[*piece[0], *piece[-1]] for piece in pieces])
    free = np.ones(len(pieces), dtype=np.bool_)
    for first in range(len(pieces)):
        if free[first]:
            members = np.array([first])
            points = pieces[first]
            for _ in range(3):
                middle, along, normal = _line(points)
                members = _members(ends, free, middle, along, normal)
                points = np.concatenate([pieces[i] for i in members] or [pieces[first]])
            free[members] = False
            free[first] = False
            middle, along, _ = _line(points)
            walls += [
                (*(middle + low * along), *(middle + high * along))
                for low, high in _intervals((ends[members].reshape(-1, 2, 2) - middle) @ along)
                if high - low >= least_m
            ]
    return make_room(np.array(walls))


def _members(
    ends: Floats, free: NDArray[np.bool_], middle: Floats, along: Floats, normal: Floats
) -> NDArray[np.int64]:
    """Return the free pieces that lie on a line."""
    off = (ends.reshape(-1, 2, 2) - middle) @ normal
    chord = ends[:, 2:] - ends[:, :2]
    turned = np.abs(chord @ normal) <= math.sin(SAME_RAD) * np.hypot(chord[:, 0], chord[:, 1])
    faces = chord @ along > 0.0  # a wall's two sides are hit in opposite order
    return np.flatnonzero(free & faces & turned & (np.abs(off).max(axis=1) <= SAME_M))


def _line(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Return middle, direction and normal of the line through points; the direction is from the first to the last."""
    middle = points.mean(axis=0)
    normal, along = np.linalg.eigh((points - middle).T @ (points - middle))[1].T
    chord = points[1] - points[0]
    return middle, along if along @ chord > 0.0 else -along, normal


def _intervals(spans: Floats) -> list[tuple[float, float]]:
    """Return the union of intervals, shape (n, 2), where gaps below `OPENING_M` are closed."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(np.sort(spans, axis=1).tolist()):
        if found and low <= found[-1][1] + OPENING_M:
            found[-1] = found[-1][0], max(found[-1][1], high)
        else:
            found.append((low, high))
    return found


def _pieces(log: LaserLog, k: int) -> list[Floats]:
    """Return the straight runs of a scan's hits in the map frame, m, shape (≥ 4, 2) each."""
    x, y, theta = log.poses[k].tolist()
    hits, ranges_m = log.hits(k), log.ranges_m[k]
    ok = ranges_m < MAP_REACH_M
    c, s = math.cos(theta), math.sin(theta)
    with np.errstate(invalid="ignore"):
        placed = hits @ np.array([[c, s], [-s, c]]) + (x, y)
        gap = np.hypot(*np.diff(hits, axis=0).T)
        # Rays that graze a wall hit it at distances that grow with the range.
        breaks = ~(ok[:-1] & ok[1:] & (gap <= np.maximum(STEP_M, 0.1 * ranges_m[1:])))
    starts = np.concatenate([[0], np.flatnonzero(breaks) + 1, [len(hits)]])
    stack = [(a, b) for a, b in pairwise(starts.tolist()) if ok[a]]
    found = []
    while stack:
        a, b = stack.pop()
        if b - a < 4:
            continue
        points = placed[a:b]
        chord = points[-1] - points[0]
        normal = np.array([-chord[1], chord[0]]) / max(1e-9, float(np.hypot(*chord)))
        off = np.abs((points - points[0]) @ normal)
        worst = int(off.argmax())
        if off[worst] > FLAT_M:
            stack += [(a, a + worst + 1), (a + worst, b)] if 0 < worst < b - a - 1 else []
        else:
            found.append(points)
    return found


def laser_drive(
    log: LaserLog, room: Room, scans: Sequence[int], reflection: Reflection, seed: int, carried_at: int | None = None
) -> KnownDrive:
    """Return the drive along some scans, with odometry that drifts.

    Parameters
    ----------
    log : LaserLog
        The scans.
    room : Room
        The map.
    scans : sequence of int
        Which, in the order of the drive.
    reflection : str
        How the building reflects.
    seed : int
        Of odometry's errors, and of readings that are too long.
    carried_at : int, optional
        Index in `scans` of the first one after the robot was carried.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 31]))
    truth = log.poses[list(scans)].copy()
    truth[:, 2] = np.unwrap(truth[:, 2])
    poses = drifting_odometry(truth, rng, carried_at)
    firings = [
        Firing(float(k), pose, pose.theta, sonar(log, scan, reflection, rng))
        for k, (pose, scan) in enumerate(zip(poses, scans, strict=True))
    ]
    return KnownDrive(room, firings, truth, carried_at)
