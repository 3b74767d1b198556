"""Evidence grids compared: rooms by a ring cut from a laser's scans, a real corridor, and the time of a firing.

In the rooms the cells where the laser hit something are the truth. In the corridor there is none: blocks of ten rows
are entered and left out in turn, and the grid predicts the left out readings. A cell is occupied above one half.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, get_args

import numpy as np
from numpy.typing import NDArray

from bench.laser_rooms import REACH_M, RING, LaserLog, read_carmen, sonar
from bench.peers.occupancy_grids import PEERS
from config.errors import WRONG_CALL, UserError
from config.robot import RingConfig, SensorConfig
from config.settings import GridConfig
from drivers.messages import Firing, Floats, Pose
from perception.localization.room.expected_ranges import Reflection
from perception.mapping.grid.evidence_grid import EvidenceGrid

CELL_M: Final = 0.1
OURS: Final = ("directed", "moravec_elfes", "elfes")
NAMES: Final = (*OURS, *PEERS)
ASKED_FROM: Final = ("directed", "response grid")
"""Grids that are asked from the looking direction where a reading is predicted."""
BLOCK: Final = 10
NEAR_M: Final = 0.2
CORRIDOR_HALF_RAD: Final = math.radians(10.0)
CORRIDOR_AXES_DEG: Final = (-90.0, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90.0)
CORRIDOR_MM: Final = (170.0, 5000.0)
"""Valid readings of that recording, mm."""
OCTETS: Final = 3
Rows = dict[str, dict[str, float]]
Bools = NDArray[np.bool_]


def make_grid(name: str, ring: RingConfig, way: Floats) -> EvidenceGrid:
    """Return a grid of ours or of a peer by its name, whose window holds all that is heard on a way, m, (n, 2)."""
    low, high = way.min(axis=0), way.max(axis=0)
    cells = 2 ** math.ceil(math.log2((float((high - low).max()) + 2.0 * REACH_M + 1.0) / CELL_M))
    config = GridConfig().model_copy(update={"method": name, "cells": cells, "cell_m": CELL_M})
    grid = EvidenceGrid(ring, config)
    if name in PEERS:
        grid.method = PEERS[name](grid.window, grid.ring)
    grid.window.fix(*(0.5 * (low + high)).tolist())
    return grid


def measure_rooms(paths: Sequence[Path], seed: int, report: Callable[[str], None]) -> Rows:
    """Return F1, precision and recall of the occupied cells, by grid, building and reflection.

    Parameters
    ----------
    paths : sequence of Path
        CARMEN logs of laser scans with corrected poses.
    seed : int
        Of the readings that are too long.
    report : callable
        Called with a line on what is running.
    """
    rows: Rows = {name: {} for name in NAMES}
    for path in paths:
        log, label = read_carmen(path), path.name.split(".")[0]
        for reflection in get_args(Reflection):
            rng = np.random.default_rng(seed)
            ranges = [sonar(log, k, reflection, rng) for k in range(len(log.poses))]
            for name in NAMES:
                report(f"grid: {name}, {label}, {reflection}")
                f1, precision, recall = room_score(name, log, ranges)
                rows[name] |= {
                    f"{label} {reflection} F1": f1, f"{label} {reflection} precision": precision,
                    f"{label} {reflection} recall": recall,
                }  # fmt: skip
    return rows


def room_score(name: str, log: LaserLog, ranges: Sequence[Floats]) -> tuple[float, float, float]:
    """Return F1, precision and recall of a grid after a drive along all scans; one cell beside counts as right."""
    grid = make_grid(name, RING, log.poses[:, :2])
    for k, (pose, read) in enumerate(zip(log.poses.tolist(), ranges, strict=True)):
        grid.observe(Firing(float(k), Pose(*pose), pose[2], read))
    window = grid.occupancy()
    occupied = window.occupied > 0.5
    truth = hit_cells(log, window.x_m, window.y_m, len(occupied))
    precision = float((occupied & widened(truth)).sum() / max(1, occupied.sum()))
    recall = float((truth & widened(occupied)).sum() / max(1, truth.sum()))
    return 2.0 * precision * recall / max(1e-9, precision + recall), precision, recall


def hit_cells(log: LaserLog, x_m: float, y_m: float, cells: int) -> Bools:
    """Return the cells in which the laser hit something within the ring's reach."""
    truth = np.zeros((cells, cells), np.bool_)
    for k, (x, y, theta) in enumerate(log.poses.tolist()):
        near = log.ranges_m[k] <= REACH_M
        ends = log.ranges_m[k][near], theta + log.bearings[near]
        column = np.floor((x + ends[0] * np.cos(ends[1]) - x_m) / CELL_M).astype(np.int64)
        row = np.floor((y + ends[0] * np.sin(ends[1]) - y_m) / CELL_M).astype(np.int64)
        inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < cells)
        truth[row[inside], column[inside]] = True
    return truth


def widened(cells: Bools) -> Bools:
    """Return the cells and all their neighbours: those within 0.15 m of cells of 0.1 m."""
    padded = np.pad(cells, 1)
    rows, columns = cells.shape
    found = np.zeros_like(cells)
    for i in range(3):
        for j in range(3):
            found |= padded[i : i + rows, j : j + columns]
    return found


@dataclass(frozen=True, slots=True)
class Corridor:
    """The recording of eight sonars: poses (n, 3), and ranges (n, 8), NaN where a value is an old one."""

    poses: Floats
    ranges_m: Floats


def read_corridor(folder: Path) -> Corridor:
    """Return the recording from its two files, poses.txt and measurement.txt.

    A range is fresh where it changes; a sensor without an echo says so in every row.

    Raises
    ------
    UserError
        They cannot be read.
    """
    try:
        poses, raw = np.loadtxt(folder / "poses.txt"), np.loadtxt(folder / "measurement.txt")[:, 1:]
        angles = np.unwrap(np.radians(0.1 * poses[:, 3]))
    except (OSError, ValueError, IndexError) as error:
        raise UserError(f"{folder}: cannot read poses.txt and measurement.txt: {error}", WRONG_CALL) from error
    low, high = CORRIDOR_MM
    is_fresh = np.vstack([np.zeros((1, raw.shape[1]), np.bool_), raw[1:] != raw[:-1]])
    ranges = np.where((raw >= low) & (raw <= high) & is_fresh, 1e-3 * raw, np.nan)
    return Corridor(np.column_stack([1e-3 * poses[:, 1:3], angles]), np.where(raw > high, np.inf, ranges))


CORRIDOR_RING: Final = RING.model_copy(update={
    "sensors": tuple(SensorConfig(x_m=0.0, y_m=0.0, angle_deg=axis) for axis in CORRIDOR_AXES_DEG),
    "beam_half_angle_deg": math.degrees(CORRIDOR_HALF_RAD), "resolution_m": 0.01, "range_min_m": 0.17,
})  # fmt: skip


def measure_corridor(folder: Path, report: Callable[[str], None]) -> Rows:
    """Return how well each grid predicts the readings that were left out, by grid and by which blocks were.

    Parameters
    ----------
    folder : Path
        Of the recording.
    report : callable
        Called with a line on what is running.
    """
    corridor = read_corridor(folder)
    rows: Rows = {}
    for name in NAMES:
        report(f"grid: {name}, corridor")
        rows[name] = {}
        for parity, label in ((1, ""), (0, "swapped ")):
            for key, value in corridor_score(name, corridor, parity).items():
                rows[name][label + key] = value
    return rows


def corridor_score(name: str, corridor: Corridor, parity: int) -> dict[str, float]:
    """Return the figures of one grid where the blocks of one parity are left out."""
    grid = make_grid(name, CORRIDOR_RING, corridor.poses[:, :2])
    left_out = np.arange(len(corridor.poses)) // BLOCK % 2 == parity
    for k in np.flatnonzero(~left_out).tolist():
        x, y, theta = corridor.poses[k].tolist()
        grid.observe(Firing(float(k), Pose(x, y, theta), theta, corridor.ranges_m[k]))
    errors, silent, nothing, echoes, silences = list[float](), 0, 0, 0, 0
    anywhere = grid.occupancy()
    for k in np.flatnonzero(left_out).tolist():
        x, y, theta = corridor.poses[k].tolist()
        window = grid.occupancy((x, y)) if name in ASKED_FROM else anywhere
        distances, directions = occupied_from(window.occupied, window.x_m, window.y_m, x, y)
        for axis, r in zip(CORRIDOR_AXES_DEG, corridor.ranges_m[k].tolist(), strict=True):
            if math.isnan(r):
                continue
            off = np.mod(directions - theta - math.radians(axis) + math.pi, 2.0 * math.pi) - math.pi
            predicted = float(distances[np.abs(off) <= CORRIDOR_HALF_RAD].min(initial=np.inf))
            if math.isinf(r):
                silences += 1
                silent += math.isfinite(predicted)
            else:
                echoes += 1
                nothing += math.isinf(predicted)
                errors += [abs(predicted - r)] if math.isfinite(predicted) else []
    return {
        "within 0.2 m, %": 100.0 * sum(error <= NEAR_M for error in errors) / echoes,
        "median error, m": float(np.median(errors)),
        "nothing predicted, %": 100.0 * nothing / echoes,
        "predicted where silent, %": 100.0 * silent / silences,
        "echoes": echoes,
        "silences": silences,
    }


def occupied_from(occupied: NDArray[np.float32], x_m: float, y_m: float, x: float, y: float) -> tuple[Floats, Floats]:
    """Return distance (m) and direction (rad) of each occupied cell within reach of a place."""
    row, column = np.nonzero(occupied > 0.5)
    dx, dy = x_m + (column + 0.5) * CELL_M - x, y_m + (row + 0.5) * CELL_M - y
    distances = np.hypot(dx, dy)
    near = distances <= REACH_M
    return distances[near], np.arctan2(dy, dx)[near]


def measure_cost(ring: RingConfig, firings: int = 2000) -> Rows:
    """Return the time of a firing and of a window of our grids in the shipped window, median and 99 %, ms.

    Parameters
    ----------
    ring : RingConfig
        The sensors; every third fires at a time, and a third of those hears nothing.
    firings : int
        How many.
    """
    rows: Rows = {}
    sensors = len(ring.mounts)
    for name in OURS:
        rng = np.random.default_rng(0)
        grid = EvidenceGrid(ring, GridConfig.model_validate({"method": name}))
        entered, asked = list[float](), list[float]()
        for k in range(firings):
            ranges = np.full(sensors, np.nan)
            fired = np.arange(k % OCTETS, sensors, OCTETS)
            ranges[fired] = np.where(rng.random(len(fired)) < 0.33, np.inf, rng.uniform(0.5, 7.0, len(fired)))
            firing = Firing(0.05 * k, Pose(0.015 * k, 0.0, 0.0), 0.0, ranges)
            begin = time.thread_time()
            grid.observe(firing)
            middle = time.thread_time()
            grid.occupancy()
            entered.append(middle - begin)
            asked.append(time.thread_time() - middle)
        rows[name] = {
            f"{what}, {label}": 1e3 * float(np.quantile(times[100:], q))
            for what, times in (("firing", entered), ("window", asked))
            for label, q in (("median ms", 0.5), ("p99 ms", 0.99))
        }
    return rows
