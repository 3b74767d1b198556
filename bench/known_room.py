"""A known room: global localisation on the way, tracking, and a robot that is carried to another place."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Final, get_args

from rich.table import Table

from config.robot import RingConfig
from perception.localization.expected_ranges import Reflection
from perception.localization.known_room import KnownRoom
from runtime.simulation.furnished_rooms import ACOUSTICS
from runtime.simulation.known_room_trials import KnownDrive, figures, follow, furnished_drive

LENGTH_M: Final = 10.0
"""Way before the robot is carried, and after."""
Rows = dict[str, dict[str, float]]


def measure(ring: RingConfig, seeds: Iterable[int], report: Callable[[str], None]) -> Rows:
    """Return the figures of one drive in each furnished room, by model of reflection.

    Parameters
    ----------
    ring
        The ring.
    seeds
        Which rooms.
    report
        Called with a line on what is running.
    """
    rows = {}
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        drives = (furnished_drive(ring, seed, acoustics, LENGTH_M, kidnapped=True) for seed in seeds)
        rows[f"furnished, {reflection}"] = _figures_of(ring, drives, report)
    return rows


def _figures_of(ring: RingConfig, drives: Iterable[KnownDrive], report: Callable[[str], None]) -> dict[str, float]:
    traces, cpu_s, firings = [], 0.0, 0
    for k, drive in enumerate(drives):
        report(f"known room: drive {k}")
        begin_s = time.process_time()
        traces.append(follow(KnownRoom(drive.room, ring), drive))
        cpu_s += time.process_time() - begin_s
        firings += len(drive.firings)
    return asdict(figures(traces)) | {"cpu_ms_firing": 1e3 * cpu_s / firings}


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
