"""Hands runs to a pool of workers, a few ahead of them, and tries those again that ended without a result."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

from config.errors import UserError
from config.files import one_line
from runtime.batch.runs import Run
from runtime.batch.worker import Row


class Done(NamedTuple):
    """A run that has ended on a worker: with its row, or with an error if it raised one or its workers died."""

    run: Run
    attempt: int
    result: Row | BaseException


class Pool(Protocol):
    """Workers that make runs, several at a time."""

    def capacity(self) -> int:
        """Return how many runs should be under way, so that no worker waits for one; at least 1."""
        ...

    def submit(self, run: Run, attempt: int) -> None:
        """Begin a run; `attempt` counts from 0."""
        ...

    def next_done(self) -> Done:
        """Wait for the next run that ends, and return it with what came of it; there must be one under way."""
        ...


class Unfinished(NamedTuple):
    """A run that was given up."""

    run: Run
    reason: str


def dispatch(runs: Iterable[Run], pool: Pool, on_row: Callable[[Row], None], retries: int) -> list[Unfinished]:
    """Make the runs and return those without a result.

    `on_row` gets each row as soon as it is there. A run without one is tried again `retries` times at most.
    """
    waiting = deque((run, 0) for run in runs)
    unfinished: list[Unfinished] = []
    under_way = 0
    while waiting or under_way:
        while waiting and under_way < pool.capacity():
            pool.submit(*waiting.popleft())
            under_way += 1
        run, attempt, result = pool.next_done()
        under_way -= 1
        if not isinstance(result, BaseException):
            on_row(result)
        elif attempt < retries:
            waiting.append((run, attempt + 1))
        else:
            what = str(result) if isinstance(result, UserError) else f"{type(result).__name__}: {result}"
            unfinished.append(Unfinished(run, one_line(what.splitlines()[0] if what else "")))
    return unfinished
