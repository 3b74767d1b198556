"""A known room: global localisation on the way, tracking, and a robot that is carried to another place.

In furnished rooms of the emulator, or in real buildings, whose ranges are cut from a laser's recording.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final, get_args

import numpy as np
from rich.table import Table

from bench.laser_rooms import RING, LaserLog, laser_drive, read_carmen, wall_map
from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from bench.trials.known_room_trials import (
    SURE,
    KnownDrive,
    Trace,
    building_drive,
    figures,
    follow,
    furnished_drive,
)  # fmt: skip
from bench.trials.large_building import Building
from config.robot import RingConfig
from drivers.messages import Pose
from perception.localization.known_room.known_room import KnownRoom
from perception.localization.room.expected_ranges import Reflection
from perception.localization.room.room import Room, room_of
from runtime.timing.footprint import rss_mb

LENGTH_M: Final = 10.0
"""Way before the robot is carried, and after."""
LASER_M: Final = 20.0
"""The same in buildings that a laser has recorded, and in a large building."""
BUILDING_SEED: Final = 0
Rows = dict[str, dict[str, float]]


def measure(ring: RingConfig, seeds: Iterable[int], report: Callable[[str], None]) -> Rows:
    """Return the figures of one drive in each furnished room, by model of reflection; also of a stand in each, and of
    a drive with the map of another room.

    Parameters
    ----------
    ring
        The ring.
    seeds
        Which rooms.
    report
        Called with a line on what is running.
    """
    rows, seeds = {}, tuple(seeds)
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        drives = (furnished_drive(ring, seed, acoustics, LENGTH_M, kidnapped=True) for seed in seeds)
        figures_of = _figures_of(ring, drives, report)
        stands, maps = [], []
        for seed in seeds:
            report(f"known room: stand and wrong map {seed}")
            stand = furnished_drive(ring, seed, acoustics, LENGTH_M, standing=True)
            stands.append(follow(KnownRoom(stand.room, ring), stand))
            drive = furnished_drive(ring, seed, acoustics, LENGTH_M)
            maps.append(follow(KnownRoom(room_of(furnished_room(seed + 1).world), ring), drive))
        said = [(trace.probability > SURE, trace.right) for trace in stands]
        rows[f"furnished, {reflection}"] = figures_of | {
            "standing_right": sum(bool(sure[-1] and right[-1]) for sure, right in said),
            "standing_wrong": sum(bool(sure[-1] and not right[-1]) for sure, right in said),
            "wrong_map_drives_said": sum(bool((trace.probability > SURE).any()) for trace in maps),
            "wrong_map_share_said": sum(float((trace.probability > SURE).mean()) for trace in maps) / len(maps),
        }
    return rows


def _figures_of(ring: RingConfig, drives: Iterable[KnownDrive], report: Callable[[str], None]) -> dict[str, float]:
    traces, costs_s = [], list[float]()
    for k, drive in enumerate(drives):
        report(f"known room: drive {k}")
        traces.append(follow(KnownRoom(drive.room, ring), drive, costs_s))
    cost_ms = 1e3 * np.array(costs_s)
    return asdict(figures(traces)) | {"ms_median": float(np.median(cost_ms)), "ms_mean": float(cost_ms.mean())}


def measure_building(
    ring: RingConfig, side_m: float, seeds: Iterable[int], report: Callable[[str], None]
) -> Rows:  # fmt: skip
    """Return the figures of drives from an unknown start in a building of many rooms, by model of reflection.

    Parameters
    ----------
    ring
        The ring.
    side_m
        Length and width of the building.
    seeds
        Which drives.
    report
        Called with a line on what is running.
    """
    rows, seeds = {}, tuple(seeds)
    for reflection in get_args(Reflection):
        building = Building(BUILDING_SEED, side_m, ACOUSTICS.model_copy(update={"model": reflection}))
        traces, costs_s, longest_s, first_s = [], list[float](), list[float](), 0.0
        for seed in seeds:
            report(f"building of {side_m:g} m, {reflection}: drive {seed}")
            drive = building_drive(ring, building, seed, LASER_M)
            begin_s = time.thread_time()
            localizer = KnownRoom(drive.room, ring, seed=seed)
            first_s = first_s or time.thread_time() - begin_s
            took_s = list[float]()
            traces.append(follow(localizer, drive, took_s))
            costs_s += took_s
            longest_s.append(max(took_s))
        cost_ms = 1e3 * np.array(costs_s)
        rows[f"{side_m:g} m, {reflection}"] = {
            "walls": len(building.world.wall),
            "drums": len(building.world.drum),
            "map_made_s": first_s,
            **asdict(figures(traces)),
            "ms_median": float(np.median(cost_ms)),
            "ms_p99": float(np.quantile(cost_ms, 0.99)),
            "longest_search_s": max(longest_s),
            "rss_mb": (rss_mb() or 0.0),
        }
    return rows


def measure_lasers(paths: Sequence[Path], drives: int, seeds: Iterable[int], report: Callable[[str], None]) -> Rows:
    """Return the figures in the buildings that a laser has recorded, by building and model of reflection.

    Parameters
    ----------
    paths
        CARMEN logs.
    drives
        Drives from an unknown start in each, evenly spaced along the recording; half-way the robot is carried.
    seeds
        Of the errors of the drives that are tracked from a known start along the whole recording.
    report
        Called with a line on what is running.
    """
    rows, seeds = {}, tuple(seeds)
    for path in paths:
        log = read_carmen(path)
        report(f"{path.name}: the map")
        every = range(len(log.poses))
        room = wall_map(log, every)
        for reflection in get_args(Reflection):
            tracked = []
            for seed in seeds:
                report(f"{path.name}, {reflection}: tracking {seed}")
                drive = laser_drive(log, room, every, reflection, seed)
                localizer = KnownRoom(room, RING, seed=seed)
                localizer.observe(drive.firings[0])
                localizer.assume(Pose(*drive.truth[0].tolist()))
                tracked.append(follow(localizer, drive))
            traces, costs_s = [], list[float]()
            for k in range(drives):
                report(f"{path.name}, {reflection}: unknown start {k}")
                drive = carried_drive(log, room, (k / drives, k / drives + 0.5), reflection, k)
                traces.append(follow(KnownRoom(room, RING, seed=k), drive, costs_s))
            rows[f"{path.name.split('.')[0]}, {reflection}"] = (
                _tracking_figures(tracked) | asdict(figures(traces)) | {"ms_mean": 1e3 * float(np.mean(costs_s))}
            )
    return rows


def carried_drive(
    log: LaserLog, room: Room, begin_shares: tuple[float, float], reflection: Reflection, seed: int
) -> KnownDrive:  # fmt: skip
    """Return a drive of `LASER_M` from one place of a recording, and as far again from another one.

    Parameters
    ----------
    log, room, reflection, seed
        As of `bench.laser_rooms.laser_drive`.
    begin_shares
        Where each part begins, as a share of the scans from which it can be driven whole; modulo 1.
    """
    scans, way_m = len(log.poses), np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(log.poses[:, :2], axis=0).T))])
    last = max(0, int(np.searchsorted(way_m, way_m[-1] - LASER_M)) - 1)
    parts = []
    for share in begin_shares:
        begin = int(share % 1.0 * last)
        parts.append(range(begin, min(scans, int(np.searchsorted(way_m, way_m[begin] + LASER_M)) + 1)))
    return laser_drive(log, room, [*parts[0], *parts[1]], reflection, seed, carried_at=len(parts[0]))


def _tracking_figures(traces: Sequence[Trace]) -> dict[str, float]:
    """Return the errors at all firings of drives from a known start, sure of the place or not."""
    error_m = np.concatenate([trace.error_m for trace in traces])
    error_deg = np.degrees(np.concatenate([trace.error_rad for trace in traces]))
    said = np.concatenate([trace.probability > SURE for trace in traces])
    right = np.concatenate([trace.right for trace in traces])
    return {
        "tracked_median_m": float(np.median(error_m)),
        "tracked_p95_m": float(np.quantile(error_m, 0.95)),
        "tracked_median_deg": float(np.median(error_deg)),
        "tracked_p95_deg": float(np.quantile(error_deg, 0.95)),
        "tracked_sure_share": float(said.mean()),
        "tracked_wrong_share": float((said & ~right).mean()),
    }


def known_room_table(rows: Rows) -> Table:
    """Return the table: one column for each kind of room."""
    table = Table(title="known room: unknown start, odometry 3 %/2 %, kidnapped half-way", title_justify="left")
    table.add_column("figure")
    for name in rows:
        table.add_column(name, justify="right")
    for figure in next(iter(rows.values())):
        cells = (row[figure] for row in rows.values())
        table.add_row(figure, *(f"{cell}" if isinstance(cell, int) else f"{cell:.3g}" for cell in cells))
    return table
