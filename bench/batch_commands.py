"""Measurements of many runs: what a search recovers, how a sweep scales, what the scheduler costs, replay speed."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from bench.batch import (
    measure_replay,
    measure_scaling,
    measure_scheduler,
    record_drive,
    replay_table,
    scaling_table,
    scheduler_table,
)  # fmt: skip
from bench.table import report
from config.load import load_settings
from runtime.support.kernel_cache import use_kernel_cache
from runtime.support.kernel_warmup import prepare_kernels


def tune(
    *,
    json: str = "tune.json",
    halls: int = 30,
    first: int = 0,
    trials: int = 40,
    workers: int = 2,
    blind: bool = False,
) -> int:
    """Measure how much of the recall that wrong settings lose is found again by `echolocate tune`.

    Parameters
    ----------
    json
        File to write.
    halls
        Random halls with a ring log each; every third is held out.
    first
        Seed of the first.
    trials
        Combinations of settings to try.
    workers
        Processes.
    blind
        Search without the truth, by the readings alone.
    """
    use_kernel_cache()
    from bench.tuning import measure, tuning_table

    with tempfile.TemporaryDirectory() as folder:
        rows = measure(Path(folder), range(first, first + halls), trials=trials, workers=workers, blind=blind)
    return report(json, rows, tuning_table(rows))


def sweep(
    *,
    json: str = "sweep.json",
    runs: int = 1000,
    workers: Annotated[tuple[int, ...], Parameter(consume_multiple=True)] = (1, 2),
    rounds: int = 1,
) -> int:
    """Measure how long a sweep takes with each number of workers on this machine, in turns.

    Parameters
    ----------
    json
        File to write.
    runs
        Runs of each sweep: perception alone, in a random hall each.
    workers
        Numbers of processes.
    rounds
        Sweeps with each.
    """
    use_kernel_cache()
    console = Console(stderr=True)
    prepare_kernels(load_settings("hallway", models=["drum"]), console)
    with console.status("bench") as status:
        rows = measure_scaling(runs, workers, rounds, status.update)
    return report(json, rows, scaling_table(rows))


def scheduler(*, json: str = "scheduler.json", workers: int = 100, runs: int = 1000, seconds: float = 5.0) -> int:
    """Measure what Dask's scheduler costs beside many workers, which live in one process and only wait.

    Parameters
    ----------
    json
        File to write.
    workers
        Workers of one thread each.
    runs
        Runs of all.
    seconds
        Time of a run, s.
    """
    figures = measure_scheduler(workers, runs, seconds)
    return report(json, figures, scheduler_table(figures))


def replay(*files: Path, json: str = "replay.json") -> int:
    """Measure how fast recordings are replayed in a sweep, and what ten thousand hours would take.

    Parameters
    ----------
    files
        Recordings or ring logs; by default those of a drive through the hallway.
    json
        File to write.
    """
    use_kernel_cache()
    settings = load_settings("hallway", models=["drum"])
    prepare_kernels(settings, Console(stderr=True))
    with tempfile.TemporaryDirectory() as folder:
        rows = measure_replay(files or record_drive(Path(folder)), settings)
    return report(json, rows, replay_table(rows))
