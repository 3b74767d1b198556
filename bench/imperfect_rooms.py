"""Furnished, imperfect rooms by each model of their acoustics, rooms of walls alone, the paper's hall by rays."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final, get_args

import numpy as np

from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from bench.trials.imperfect_rooms import JITTER, imperfect_room
from bench.trials.imperfect_trials import figures, try_room
from config.load import load_settings
from config.settings import Settings
from config.units import FOOT_M
from config.world import AcousticsConfig, DrumConfig, PolygonConfig, WorldConfig
from perception.localization.room.expected_ranges import Reflection
from runtime.simulation.open_loop import HallOutcome, run_hall
from runtime.simulation.scenes import Hall, halls

ROBOTS: Final = ("denning", "p3dx")
RASTER_M: Final = 0.02
"""Cell of AMRISim's raster."""
HALL_ACOUSTICS: Final = {
    "ray": AcousticsConfig(model="rays", rays=1),
    "3 rays": AcousticsConfig(model="rays", rays=3),
    "ray, raster": AcousticsConfig(model="rays", rays=1),
    "10 rays": AcousticsConfig(model="rays", rays=10),
    "cone": AcousticsConfig(model="cone"),
}


def measure(
    settings: Settings,
    seeds: Iterable[int],
    models: Iterable[str],
    step_m: float,
    drums: int,
    report: Callable[[str], None],
) -> dict[str, dict[str, float]]:
    """Return the figures of all rooms, by model.

    Parameters
    ----------
    settings
        Ring, models and perception.
    seeds
        Which rooms.
    models
        Names of `imperfect_rooms.MODELS`.
    step_m
        Distance between two firings of one sensor.
    drums
        Drums in each room.
    report
        Called with a line on what is running.
    """
    rows, seeds, settings = {}, tuple(seeds), settings.of_log()
    for model in models:
        trials = []
        for seed in seeds:
            report(f"imperfect rooms: {model}, room {seed}")
            trials.append(try_room(settings, imperfect_room(seed, model, drums), seed, step_m))
        rows[model] = figures(trials)
    return rows


def measure_jitter(
    settings: Settings, seeds: Iterable[int], step_m: float, report: Callable[[str], None]
) -> dict[str, dict[str, float]]:  # fmt: skip
    """Return the figures of the rooms of `bench.walls` where poses jump as real ones do, by model of reflection.

    Parameters
    ----------
    settings, seeds, step_m, report
        As for `measure`.
    """
    rows, seeds = {}, tuple(seeds)
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection, **JITTER})
        trials = []
        for seed in seeds:
            report(f"pose jitter: {reflection}, room {seed}")
            trials.append(try_room(settings, furnished_room(seed, acoustics), seed, step_m, is_empty=True))
        rows[f"{reflection}, jitter"] = figures(trials)
    return rows


def measure_halls(seeds: Iterable[int], report: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Return the figures of the paper's hall, by robot and model of the beam.

    Parameters
    ----------
    seeds
        Of the noise.
    report
        Called with a line on what is running.
    """
    rows, seeds = {}, tuple(seeds)
    (hall,) = halls("clean")
    for robot in ROBOTS:
        settings = load_settings("hallway", ["perception.method=bayes"], robot=robot)
        for name, acoustics in HALL_ACOUSTICS.items():
            outcomes: list[HallOutcome] = []
            world = hall.world.model_copy(update={"acoustics": acoustics})
            heard = rastered(world) if name.endswith("raster") else world
            for seed in seeds:
                report(f"paper's hall: {robot}, {name}, seed {seed}")
                outcomes.append(run_hall(settings, Hall(hall.name, world), seed, Hall(hall.name, heard)))
            rows[f"{robot}, {name}"] = _hall_figures(outcomes)
    return rows


def rastered(world: WorldConfig, cell_m: float = RASTER_M) -> WorldConfig:
    """Return a world whose drums are made of the cells of a raster, as AMRISim and Stage have them."""
    outlines = tuple(_cells_of(drum, cell_m) for drum in world.drum)
    return world.model_copy(update={"drum": (), "polygon": (*world.polygon, *outlines)})


def _cells_of(drum: DrumConfig, cell_m: float) -> PolygonConfig:
    """Return the outline of the cells in whose column or row a drum has its middle, counter-clockwise."""
    below, above = list[tuple[float, float]](), list[tuple[float, float]]()
    for column in range(
        math.floor((drum.x_m - drum.radius_m) / cell_m), math.ceil((drum.x_m + drum.radius_m) / cell_m)
    ):
        off = (column + 0.5) * cell_m - drum.x_m
        if abs(off) < drum.radius_m:
            half = math.sqrt(drum.radius_m**2 - off**2)
            low, high = math.floor((drum.y_m - half) / cell_m), math.ceil((drum.y_m + half) / cell_m)
            for edge in (column, column + 1):
                below.append((edge * cell_m, low * cell_m))
                above.append((edge * cell_m, high * cell_m))
    return PolygonConfig(vertices_m=tuple(dict.fromkeys([*below, *reversed(above)])))


def _hall_figures(outcomes: Sequence[HallOutcome]) -> dict[str, float]:
    drums = [row for outcome in outcomes for row in outcome.drums]
    errors_ft = [row["error"] / FOOT_M for row in drums if row["error"] is not None]
    return {
        "drives": len(outcomes),
        "drums": len(drums),
        "found": len(errors_ft),
        "false": sum(outcome.false for outcome in outcomes),
        "error, ft": float(np.mean(errors_ft)) if errors_ft else float("nan"),
        "worst, ft": max(errors_ft, default=float("nan")),
    }
