"""Runs on a pool: each once, tried again a few times, never more under way than the pool wants."""

from __future__ import annotations

import random
from collections import Counter

import pytest

from config.errors import UserError
from runtime.batch.dispatch import Done, dispatch
from runtime.batch.runs import Run
from runtime.batch.worker import Row


class FakePool:
    """A pool that ends runs in any order, and lets those fail that are named, that many times."""

    def __init__(self, seed: int, failures: dict[str, int]) -> None:
        self.rng = random.Random(seed)
        self.failures = failures
        self.under_way: list[tuple[Run, int]] = []
        self.most = 0
        self.attempts: Counter[str] = Counter()

    def capacity(self) -> int:
        return 3

    def submit(self, run: Run, attempt: int) -> None:
        assert attempt == self.attempts[run.key]
        self.attempts[run.key] += 1
        self.under_way.append((run, attempt))
        self.most = max(self.most, len(self.under_way))

    def next_done(self) -> Done:
        run, attempt = self.under_way.pop(self.rng.randrange(len(self.under_way)))
        if attempt < self.failures.get(run.key, 0):
            return Done(run, attempt, UserError("no disk") if run.key == "7" else ValueError("bad\nworker"))
        return Done(run, attempt, {"key": run.key})


@pytest.mark.parametrize("seed", range(5))
def test_each_run_gives_one_row_or_one_reason(seed: int) -> None:
    runs = [Run(str(k), "scene", "clean", k, "{}") for k in range(20)]
    rows: list[Row] = []
    pool = FakePool(seed, {"3": 1, "5": 2, "7": 9, "9": 9})
    unfinished = dispatch(runs, pool, rows.append, retries=2)
    assert Counter(row["key"] for row in rows) == Counter(str(k) for k in range(20) if k not in {7, 9})
    assert {(one.run.key, one.reason) for one in unfinished} == {("7", "no disk"), ("9", "ValueError: bad")}
    assert pool.most == 3
    assert (pool.attempts["0"], pool.attempts["3"], pool.attempts["5"], pool.attempts["7"]) == (1, 2, 3, 3)
