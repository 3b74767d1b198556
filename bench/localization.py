"""Global localisation from one stand of the ring in random known rooms, by both models of reflection."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Final, get_args

import numpy as np
from rich.table import Table

from bench.trials.localization_trials import figures, localize_once
from bench.trials.random_rooms import ACOUSTICS
from config.robot import RingConfig
from perception.localization.room.expected_ranges import Reflection

COLUMNS: Final = ("trials", "right", "offered", "wrong_alone", "confidently_wrong", "lost", "median_m", "max_m",
                  "median_deg", "max_deg", "cpu_ms_p50", "cpu_ms_max", "other_maps", "answers_there")  # fmt: skip

OTHER_MAPS: Final = 4
"""Every so many rooms, one is also tried with the map of another room."""


def measure(ring: RingConfig, seeds: Iterable[int], report: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Return the figures of one stand in each room, by model of reflection.

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
    seeds = tuple(seeds)
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        localize_once(ring, seeds[0], acoustics)
        trials, cpu_ms = [], []
        for seed in seeds:
            report(f"localization: {reflection}, room {seed}")
            begin_s = time.process_time()
            trials.append(localize_once(ring, seed, acoustics))
            cpu_ms.append(1e3 * (time.process_time() - begin_s))
        cpu = {"cpu_ms_p50": float(np.median(cpu_ms)), "cpu_ms_max": max(cpu_ms)}
        elsewhere = [localize_once(ring, seed, acoustics, map_seed=seed + 1) for seed in seeds[::OTHER_MAPS]]
        there = {"other_maps": len(elsewhere), "answers_there": sum(bool(trial.candidates) for trial in elsewhere)}
        rows[reflection] = asdict(figures(trials)) | cpu | there
    return rows


def localization_table(rows: dict[str, dict[str, float]]) -> Table:
    """Return the table: one row for each model of reflection."""
    table = Table(
        title="global localisation from one stand: 1 % noise, 3 % outliers, 5 % drop-outs", title_justify="left"
    )
    table.add_column("reflection")
    for column in COLUMNS:
        table.add_column(column, justify="right")
    for name, row in rows.items():
        cells = (row[column] for column in COLUMNS)
        table.add_row(name, *(f"{cell}" if isinstance(cell, int) else f"{cell:.3g}" for cell in cells))
    return table
