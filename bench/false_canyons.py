"""False canyons where no dead end is: random drum halls and corridors with doorways, by both models of reflection."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import get_args

import numpy as np

from bench.trials.false_canyon_trials import FalseCanyonTrial, corridor, try_path
from bench.trials.false_wall_trials import STEPS_M, drum_hall
from config.settings import Settings
from perception.localization.room.expected_ranges import Reflection
from runtime.simulation.random_halls import ACOUSTICS

Row = dict[str, float]


def measure(
    settings: Settings, halls: Iterable[int], corridors: Iterable[int], report: Callable[[str], None]
) -> dict[str, Row]:  # fmt: skip
    """Return the figures of the halls and of the corridors, by model of reflection.

    Parameters
    ----------
    settings
        The robot, its models and perception.
    halls, corridors
        Which of them, by seed.
    report
        Called with a line on what is running.
    """
    rows = {}
    halls, corridors, sure = tuple(halls), tuple(corridors), settings.behaviors.leave_canyon.probability_min
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        trials = []
        for k, seed in enumerate(halls):
            report(f"false canyons: {reflection}, hall {seed}")
            trials.append(try_path(settings, *drum_hall(seed, acoustics), seed, STEPS_M[k % len(STEPS_M)]))
        if trials:
            rows[f"{reflection}, {len(trials)} drum halls"] = figures(trials, sure)
        trials = []
        for seed in corridors:
            report(f"false canyons: {reflection}, corridor {seed}")
            trials.append(try_path(settings, *corridor(seed, acoustics), seed))
        if trials:
            rows[f"{reflection}, {len(trials)} corridors"] = figures(trials, sure)
    return rows


def figures(trials: Sequence[FalseCanyonTrial], sure: float) -> Row:
    """Return the figures of these drives; a canyon is sure from this probability on."""
    quanta_ms = 1e3 * np.array([taken for trial in trials for taken in trial.quanta_s] or [0.0])
    return {
        "drives": len(trials),
        "driven, m": sum(trial.driven_m for trial in trials),
        "canyons reported": sum(len(trial.reported) for trial in trials),
        "sure ones": sum(trial.above(sure) for trial in trials),
        "drives with one": sum(len(trial.reported) > 0 for trial in trials),
        "canyons at the end": sum(trial.at_end for trial in trials),
        "a place p50, ms": float(np.median(quanta_ms)),
        "p99, ms": float(np.quantile(quanta_ms, 0.99)),
    }
