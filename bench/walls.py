"""Walls and corners found in random rooms with doorways and drums, by both models of reflection and several steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Final, get_args

from rich.table import Table

from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from bench.trials.wall_trials import figures, try_room
from config.settings import Settings
from config.units import FOOT_M
from perception.localization.room.expected_ranges import Reflection

COLUMNS: Final = ("rooms", "walls", "found", "false", "lines_a_wall", "offset_mean_m", "offset_p95_m",
                  "angle_mean_deg", "angle_p95_deg", "corners", "corners_found", "corner_mean_m", "corner_p95_m",
                  "false_corners")  # fmt: skip


def measure(
    settings: Settings, seeds: Iterable[int], steps_ft: Iterable[float], report: Callable[[str], None]
) -> dict[str, dict[str, float]]:
    """Return the figures of all rooms, by model of reflection and step.

    Parameters
    ----------
    settings
        Ring, models and perception.
    seeds
        Which rooms.
    steps_ft
        Distances between two firings of one sensor, ft.
    report
        Called with a line on what is running.
    """
    rows = {}
    seeds, steps_ft = tuple(seeds), tuple(steps_ft)
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        for step_ft in steps_ft:
            trials = []
            for seed in seeds:
                report(f"walls: {reflection}, {step_ft:g} ft, room {seed}")
                trials.append(try_room(settings, furnished_room(seed, acoustics), seed, step_ft * FOOT_M))
            rows[f"{reflection}, {step_ft:g} ft"] = asdict(figures(trials))
    return rows


def walls_table(rows: dict[str, dict[str, float]]) -> Table:
    """Return the table: one row for each model of reflection and step."""
    table = Table(title="walls of random rooms: 1 % noise, 3 % outliers, 5 % drop-outs", title_justify="left")
    table.add_column("reflection, step")
    for column in COLUMNS:
        table.add_column(column, justify="right")
    for name, row in rows.items():
        cells = (row[column] for column in COLUMNS)
        table.add_row(name, *(f"{cell}" if isinstance(cell, int) else f"{cell:.3g}" for cell in cells))
    return table
