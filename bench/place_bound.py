"""What any rule could know of a place in a known room: an exact Bayes filter over all poses of a grid.

Nothing is searched, dropped or confirmed: each pose has its probability, odometry moves it, readings weigh it, and a
small share begins anew anywhere, since the robot may be carried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from bench.known_room import Rows, carried_drive
from bench.laser_rooms import RING, read_carmen, wall_map
from bench.trials.known_room_trials import KnownDrive, Trace, figures, follow
from config.robot import RingConfig
from drivers.messages import Firing, Floats, Pose, wrap_angle
from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.localization.known_room.known_room import KnownRoom
from perception.localization.known_room.mixed_reflection import LATE_M, WILD_HEARD
from perception.localization.known_room.particle_update import TEMPER
from perception.localization.known_room.pose_grid import GRID_CELL_M, GRID_DROPOUT, SIGMA_M, SIGMA_SHARE, WILD_MIN
from perception.localization.localized_pose import Status
from perception.localization.room.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.room.range_likelihood import HEARD_PRIOR
from perception.localization.room.room import Room

HEADINGS: Final = 72
STEP_RAD: Final = math.tau / HEADINGS
CLEAR_M: Final = 0.2
"""The ring's centre is nowhere nearer to a wall."""
SPECULAR: Final = {"cone": 0.1, "specular": 0.8}
LATE: Final = 0.2
"""Shares of the readings by their causes, as the program has learned them where it knows its place."""
CARRIED: Final = 0.002
"""Share of the probability that begins anew at each metre."""
SCALE_WALK: Final = 0.0045
"""Variance of a place on each axis, m²/m: a scale of odometry that is off by 3 % for some metres."""
HEADING_WALK: Final = math.radians(1.0) ** 2
TURN_SHARE: Final = 0.03
"""Variance of the heading, rad²/m, and standard deviation of a turn as a share of it."""
NEAR_M: Final = 0.5
NEAR_RAD: Final = math.radians(12.0)
"""A place's probability is that of all poses so near to it."""
CODES: Final = 64
"""A range is so many parts of the window; the next code is silence."""

BEGIN: Final = 0.55
AWAY: Final = 0.43
"""Drive k of n begins at (k + `BEGIN`) / n of the recording, and after it was carried so much farther on."""

Codes = NDArray[np.uint8]


class Grid(NamedTuple):
    """The poses of a room and what a sensor reads there."""

    origin: Floats
    """Middle of the first cell, m."""
    free: NDArray[np.bool_]
    """Where the ring's centre may be, shape (rows, columns)."""
    codes: dict[Reflection, Codes]
    """Expected ranges of a sensor in the ring's middle, shape (HEADINGS, rows, columns) by its direction."""


def surfaces_near(room: Room, x: float, y: float, window_m: float) -> Room:
    """Return the surfaces that a sensor at a place can hear.

    Parameters
    ----------
    room : Room
        All surfaces.
    x, y : float
        The place, m.
    window_m : float
        Greatest range, m.

    Returns
    -------
    Room
        A part of the room; it may have no surface.
    """
    to_x, to_y = x - room.walls[:, 0], y - room.walls[:, 1]
    along_x, along_y = room.walls[:, 2] - room.walls[:, 0], room.walls[:, 3] - room.walls[:, 1]
    share = np.clip((to_x * along_x + to_y * along_y) / (along_x**2 + along_y**2), 0.0, 1.0)
    walls = np.hypot(to_x - share * along_x, to_y - share * along_y) <= window_m
    heard_m = np.where(room.corners[:, 3] < np.pi, window_m, EDGE_REACH_M)
    corners = np.hypot(room.corners[:, 0] - x, room.corners[:, 1] - y) <= heard_m
    distance = np.hypot(room.circles[:, 0] - x, room.circles[:, 1] - y) - room.circles[:, 2]
    circles = room.circles[distance <= window_m]
    return Room(room.walls[walls], room.normals[walls], room.offsets[walls], room.corners[corners], circles)


def make_grid(room: Room, ring: RingConfig) -> Grid:
    """Return the grid of a room for a ring whose sensors stand at its centre."""
    low, high = room.bounds
    shape = tuple(np.ceil((high - low) / GRID_CELL_M).astype(int).tolist())
    origin = low + 0.5 * GRID_CELL_M
    axes: Floats = STEP_RAD * np.arange(HEADINGS, dtype=np.float64)
    free, half = np.zeros(shape, dtype=np.bool_), math.radians(ring.beam_half_angle_deg)
    silent = np.full((HEADINGS, *shape), CODES, np.uint8)
    codes: dict[Reflection, Codes] = {"cone": silent, "specular": silent.copy()}
    for i, j in np.ndindex(*shape):
        x, y = (origin + GRID_CELL_M * np.array([i, j])).tolist()
        near = surfaces_near(room, x, y, ring.window_m)
        beams = Beams(np.full(HEADINGS, x), np.full(HEADINGS, y), axes)
        for reflection, table in codes.items():
            ranges_m = expected_ranges(near, beams, half, reflection).range_m
            heard = ranges_m <= ring.window_m
            table[heard, i, j] = np.minimum(CODES - 1, ranges_m[heard] * (CODES / ring.window_m))
        nearest_m = expected_ranges(near, Beams(*(part[:1] for part in beams)), math.pi * 0.49, "cone").range_m
        behind = Beams(beams.x[:1], beams.y[:1], beams.axis[:1] + math.pi)
        nearest_m = np.minimum(nearest_m, expected_ranges(near, behind, math.pi * 0.49, "cone").range_m)
        free[i, j] = bool(nearest_m[0] > CLEAR_M)
    return Grid(origin, free, codes)


def measure(paths: Sequence[Path], drives: int, first: int, report: Callable[[str], None]) -> Rows:
    """Return figures of drives from an unknown start, then carried, by building, model of reflection and method.

    Parameters
    ----------
    paths
        CARMEN logs.
    drives
        Drives in each building, evenly spaced along the recording.
    first
        Seed of the first drive.
    report
        Called with a line on what is running.
    """
    rows: Rows = {}
    for path in paths:
        log, name = read_carmen(path), path.name.split(".")[0]
        report(f"{name}: the map")
        room = wall_map(log, range(len(log.poses)))
        grid = make_grid(room, RING)
        for reflection in get_args(Reflection):
            exact, ours = [], []
            for k in range(drives):
                report(f"{name}, {reflection}: drive {k}")
                begins = (k + BEGIN) / drives, (k + BEGIN) / drives + AWAY
                drive = carried_drive(log, room, begins, reflection, first + k)
                exact.append(follow_exactly(grid, drive, RING, reflection))
                ours.append(follow(KnownRoom(room, RING, seed=first + k), drive))
            for method, traces in (("exact filter", exact), ("ours", ours)):
                rows[f"{name}, {reflection}, {method}"] = asdict(figures(traces))
    return rows


def follow_exactly(grid: Grid, drive: KnownDrive, ring: RingConfig, reflection: Reflection) -> Trace:
    """Return what the filter knows along a drive: the most likely place, and the probability of what is near it."""
    rows: list[tuple[float, float, float]] = []
    for (place, heading, probability), (x, y, theta) in zip(
        _posterior(grid, drive.firings, ring, reflection), drive.truth.tolist(), strict=True
    ):
        off = math.hypot(float(place[0]) - x, float(place[1]) - y)
        rows.append((off, abs(wrap_angle(heading - theta)), probability))
    error_m, error_rad, probability = np.array(rows).T
    status = tuple[Status, ...]("tracking" for _ in rows)
    return Trace(drive.way_m(), error_m, error_rad, probability, status, drive.carried_at)


def _posterior(
    grid: Grid, firings: list[Firing], ring: RingConfig, reflection: Reflection
) -> Iterator[tuple[Floats, float, float]]:
    """Yield place (m), heading (rad) and probability after each firing."""
    even = np.broadcast_to(grid.free, (HEADINGS, *grid.free.shape)) / (HEADINGS * float(grid.free.sum()))
    chances, before = even.copy(), firings[0].pose
    for firing in firings:
        step = before.inverse().compose(firing.pose)
        before = firing.pose
        chances = _moved(chances, step) * grid.free
        begins = CARRIED * math.hypot(step.x, step.y)
        chances = (1.0 - begins) / chances.sum() * chances + begins * even
        log_ratio = _log_ratios(grid, firing.ranges_m, ring, reflection)
        chances *= np.exp(log_ratio - log_ratio.max())
        chances /= chances.sum()
        yield _best(grid, chances)


def _moved(chances: Floats, step: Pose) -> Floats:
    """Return the probabilities after a step by odometry, as uncertain as that is."""
    way, turn = math.hypot(step.x, step.y), wrap_angle(step.theta)
    steps = math.floor(turn / STEP_RAD)
    share = turn / STEP_RAD - steps
    moved = np.empty_like(chances)
    spread = min(0.2, 0.5 * SCALE_WALK * way / GRID_CELL_M**2)
    for heading, layer in enumerate(chances):
        middle = heading * STEP_RAD + 0.5 * turn
        cos, sin = math.cos(middle) / GRID_CELL_M, math.sin(middle) / GRID_CELL_M
        shifted = _shifted(layer, cos * step.x - sin * step.y, sin * step.x + cos * step.y)
        beside = (
            _shifted(shifted, 1, 0) + _shifted(shifted, -1, 0) + _shifted(shifted, 0, 1) + _shifted(shifted, 0, -1)
        )
        moved[heading] = (1.0 - 4.0 * spread) * shifted + spread * beside
    moved = (1.0 - share) * np.roll(moved, steps, axis=0) + share * np.roll(moved, steps + 1, axis=0)
    blur = min(1.0 / 3.0, 0.5 * (HEADING_WALK * way + (TURN_SHARE * turn) ** 2) / STEP_RAD**2)
    blurred: Floats = (1.0 - 2.0 * blur) * moved + blur * (np.roll(moved, 1, axis=0) + np.roll(moved, -1, axis=0))
    return blurred


def _shifted(layer: Floats, rows: float, columns: float) -> Floats:
    """Return an array shifted by parts of a cell, between its neighbours linearly; nothing comes in at its rim."""
    found = np.zeros_like(layer)
    i, j = math.floor(rows), math.floor(columns)
    for a, share_i in ((i, i + 1 - rows), (i + 1, rows - i)):
        for b, share_j in ((j, j + 1 - columns), (j + 1, columns - j)):
            height, width = layer.shape[0] - abs(a), layer.shape[1] - abs(b)
            if share_i * share_j > 0.0 and height > 0 and width > 0:
                to_i, to_j, from_i, from_j = max(0, a), max(0, b), max(0, -a), max(0, -b)
                found[to_i : to_i + height, to_j : to_j + width] += (
                    share_i * share_j * layer[from_i : from_i + height, from_j : from_j + width]
                )
    return found


def _log_ratios(grid: Grid, ranges_m: Floats, ring: RingConfig, reflection: Reflection) -> Floats:
    """Return the log likelihood ratio of readings at each pose to readings from anywhere, nat, with `TEMPER`."""
    total = np.zeros((HEADINGS, *grid.free.shape))
    for (_, _, axis), range_m in zip(ring.mounts, ranges_m.tolist(), strict=True):
        table = np.log(_ratios(range_m, ring.window_m, SPECULAR[reflection]))
        turn = round(axis / STEP_RAD)
        cone, mirror = (np.roll(grid.codes[of], -turn, axis=0) for of in ("cone", "specular"))
        total += table[cone, mirror]
    return TEMPER * total


def _ratios(range_m: float, window_m: float, specular: float) -> Floats:
    """Return a reading's likelihood ratio for each code by `cone` and by `specular`, shape (CODES + 1, CODES + 1).

    The mixture of `perception.localization.known_room.mixed_reflection`.
    """
    expected = np.append((np.arange(CODES) + 0.5) * (window_m / CODES), math.inf)
    answers, heard = np.isfinite(expected), math.isfinite(range_m)
    anything = WILD_HEARD / window_m if heard else 1.0 - WILD_HEARD
    anywhere = HEARD_PRIOR / window_m if heard else 1.0 - HEARD_PRIOR
    if heard:
        sigma = np.hypot(SIGMA_M, SIGMA_SHARE * np.where(answers, expected, 0.0))
        error = np.where(answers, range_m - np.where(answers, expected, 0.0), math.inf)
        echo = (1.0 - GRID_DROPOUT) * np.exp(-0.5 * (error / sigma) ** 2) / (sigma * math.sqrt(math.tau))
        away = np.where((error > 0.0) & (error <= LATE_M), LATE / LATE_M, 0.0)[:, None]
    else:
        echo = np.where(answers, GRID_DROPOUT, 1.0)
        away = np.full((CODES + 1, 1), 1.0 - LATE)
    mirror = np.where(answers, echo, away)
    mixed: Floats = (1.0 - WILD_MIN) * ((1.0 - specular) * echo[:, None] + specular * mirror) + WILD_MIN * anything
    return mixed / anywhere


def _best(grid: Grid, chances: Floats) -> tuple[Floats, float, float]:
    """Return place and heading of the most likely region, and its probability."""
    heading, i, j = np.unravel_index(int(chances.argmax()), chances.shape)
    place, angle, share = grid.origin + GRID_CELL_M * np.array([i, j]), float(heading) * STEP_RAD, 0.0
    for _ in range(2):
        cells = np.rint((place - grid.origin) / GRID_CELL_M).astype(int)
        reach, turns = math.ceil(NEAR_M / GRID_CELL_M), math.floor(NEAR_RAD / STEP_RAD)
        middle = round(angle / STEP_RAD)
        low_i, low_j = (max(0, int(cell) - reach) for cell in cells)
        around = np.arange(middle - turns, middle + turns + 1)
        part = chances[around % HEADINGS, low_i : int(cells[0]) + reach + 1, low_j : int(cells[1]) + reach + 1]
        share = float(part.sum())
        at_i = low_i + np.arange(part.shape[1]) @ part.sum(axis=(0, 2)) / share
        at_j = low_j + np.arange(part.shape[2]) @ part.sum(axis=(0, 1)) / share
        place = grid.origin + GRID_CELL_M * np.array([at_i, at_j])
        angle = float(around @ part.sum(axis=(1, 2))) / share * STEP_RAD
    return place, angle, share
