"""Tests of threads that rest in cycles: they work between two, and rest before and in each."""

from __future__ import annotations

import asyncio
import sys

import pytest

from runtime.timing import cycle_gaps
from runtime.timing.cycle_gaps import MARGIN_S, SHARE_MIN, CycleGaps


@pytest.fixture(autouse=True)
def _traced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let threads look for cycles on each version of Python."""
    monkeypatch.setattr(cycle_gaps, "IS_TRACED", True)


class Clock:
    """A clock that is set."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def called() -> None:
    """Be called: each call is where a thread may rest."""


async def test_a_thread_works_between_cycles_and_rests_before_and_in_one() -> None:
    clock, steps = Clock(), []
    gaps = CycleGaps(clock, rest_max_s=60.0)

    def work(count: int) -> int:
        for k in range(count):
            called()
            steps.append(k)
            if k == 0:
                clock.now_s = 1.0 - MARGIN_S  # the gap ends while it works
        return count

    gaps.end(1.0)
    task = asyncio.create_task(gaps.to_thread(work, 3))
    while not steps:
        await asyncio.sleep(0.001)
    await asyncio.sleep(0.01)
    assert steps == [0], "a cycle is due"
    gaps.begin()
    await asyncio.sleep(0.01)
    assert steps == [0], "a cycle is under way"
    gaps.end(1.0)
    assert await task == 3
    assert steps == [0, 1, 2]


@pytest.mark.parametrize("gap_s", [0.2 * MARGIN_S, 0.9 * MARGIN_S])
async def test_a_thread_works_for_a_share_of_a_gap_that_is_shorter_than_the_margin(gap_s: float) -> None:
    clock, steps = Clock(), []
    gaps = CycleGaps(clock, rest_max_s=60.0)

    def work() -> None:
        for k in range(100):
            called()
            steps.append(k)
            clock.now_s += 0.01 * gap_s

    gaps.begin()
    task = asyncio.create_task(gaps.to_thread(work))
    for done in (50, 100):
        await asyncio.sleep(0.01)
        gaps.end(gap_s)
        while len(steps) < done:
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.01)
        assert len(steps) <= done + 1, "a call that begins at the end of a share is done"
        gaps.begin()
        assert SHARE_MIN * 100 == 50
    gaps.end(gap_s)
    await asyncio.wait_for(task, 30.0)


async def test_once_there_is_no_further_cycle_a_thread_works_to_its_end() -> None:
    gaps = CycleGaps(lambda: 0.0, rest_max_s=60.0)
    gaps.begin()
    steps = []

    def work() -> None:
        for k in range(100):
            called()
            steps.append(k)

    task = asyncio.create_task(gaps.to_thread(work))
    await asyncio.sleep(0.01)
    assert not steps
    gaps.close()
    await asyncio.wait_for(task, 30.0)


async def test_where_a_trace_function_slows_all_threads_none_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cycle_gaps, "IS_TRACED", False)
    assert await CycleGaps().to_thread(sys.gettrace) is None


async def test_a_thread_rests_no_longer_than_it_may_hold_a_lock_and_its_errors_arrive() -> None:
    gaps = CycleGaps(lambda: 0.0, rest_max_s=0.01)
    gaps.begin()

    def fail(number: int) -> None:
        called()
        raise LookupError(number)

    with pytest.raises(LookupError, match="7"):
        await asyncio.wait_for(gaps.to_thread(fail, 7), 30.0)
    assert await gaps.to_thread(sys.gettrace) is not None
    assert await asyncio.to_thread(sys.gettrace) is None, "the thread is as it was"


async def test_before_the_first_cycle_a_thread_works() -> None:
    assert await CycleGaps(lambda: 1e9).to_thread(len, "four") == 4
