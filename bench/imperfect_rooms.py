"""Furnished, imperfect rooms by each model of their acoustics, and the paper's hall by rays on two robots."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

import numpy as np

from bench.trials.imperfect_rooms import imperfect_room
from bench.trials.imperfect_trials import figures, try_room
from config.load import load_settings
from config.settings import Settings
from config.units import FOOT_M
from config.world import AcousticsConfig
from runtime.simulation.open_loop import HallOutcome, run_hall
from runtime.simulation.scenes import Hall, halls

ROBOTS: Final = ("denning", "p3dx")
HALL_ACOUSTICS: Final = {
    "ray": AcousticsConfig(model="rays", rays=1),
    "3 rays": AcousticsConfig(model="rays", rays=3),
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
            world = hall.world.model_copy(
                update={"acoustics": acoustics}
            )  # fmt: skip
            for seed in seeds:
                report(f"paper's hall: {robot}, {name}, seed {seed}")
                outcomes.append(run_hall(settings, Hall(hall.name, world), seed))
            rows[f"{robot}, {name}"] = _hall_figures(outcomes)
    return rows


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
