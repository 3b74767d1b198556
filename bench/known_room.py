"""A known room: global localisation on the way, tracking, and a robot that is carried to another place."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Final, get_args

import numpy as np
from rich.table import Table

from config.robot import RingConfig
from perception.localization.expected_ranges import Reflection
from perception.localization.known_room import KnownRoom
from perception.localization.room import room_of
from runtime.simulation.furnished_rooms import ACOUSTICS, furnished_room
from runtime.simulation.known_room_trials import SURE, KnownDrive, figures, follow, furnished_drive

LENGTH_M: Final = 10.0
"""Way before the robot is carried, and after."""
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
