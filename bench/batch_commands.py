"""Measurements of many runs: what a search recovers, how a sweep scales, what the scheduler costs, replay speed."""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench.table import report
from runtime.support.kernel_cache import use_kernel_cache


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
