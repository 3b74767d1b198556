"""False walls where nothing but drums stands: random halls, by both models of reflection, and hours in one hall."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final, get_args

from bench.trials.false_wall_trials import STEPS_M, FalseWallTrial, drive_hall, try_hall
from config.settings import Settings
from perception.localization.room.expected_ranges import Reflection
from runtime.simulation.random_halls import ACOUSTICS

Row = dict[str, float]
LOOP_SEED: Final = 0


def measure(
    settings: Settings, seeds: Iterable[int], hours: float, report: Callable[[str], None]
) -> dict[str, Row]:  # fmt: skip
    """Return the figures of all halls, by model of reflection, and of the shipped hall driven for hours.

    Parameters
    ----------
    settings
        The robot, its models and perception, and the shipped hall.
    seeds
        Which random halls.
    hours
        Virtual time in the shipped hall, by each model of reflection; 0: none.
    report
        Called with a line on what is running.
    """
    rows = {}
    seeds = tuple(seeds)
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        trials = []
        for k, seed in enumerate(seeds):
            report(f"false walls: {reflection}, hall {seed}")
            trials.append(try_hall(settings, seed, acoustics, STEPS_M[k % len(STEPS_M)]))
        if trials:
            rows[f"{reflection}, {len(trials)} halls"] = figures(trials)
    hall = settings.world
    for reflection in get_args(Reflection) if hall is not None and hours > 0.0 else ():
        assert hall is not None
        world = hall.model_copy(update={"acoustics": hall.acoustics.model_copy(update={"model": reflection})})

        def tell(done: float, name: str = reflection) -> None:
            report(f"false walls: {name}, the shipped hall, {done:.2f} h")

        rows[f"{reflection}, {hours:g} h"] = figures([drive_hall(settings, world, LOOP_SEED, hours, tell)])
    return rows


def figures(trials: Sequence[FalseWallTrial]) -> Row:
    """Return the figures of these drives."""
    return {
        "drives": len(trials),
        "looks": sum(trial.looks for trial in trials),
        "with a wall": sum(trial.with_wall for trial in trials),
        "with a sure wall": sum(trial.with_sure_wall for trial in trials),
        "drives with a wall at some time": sum(trial.with_wall > 0 for trial in trials),
        "walls at the end": sum(trial.at_end for trial in trials),
    }
