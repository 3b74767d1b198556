"""Tests of threads that rest in cycles: they work between two, and rest before and in each."""

from __future__ import annotations

import asyncio
import sys

import pytest

from runtime.timing.cycle_gaps import MARGIN_S, CycleGaps


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
