"""Tests of sleeping until a deadline or a wake: never early, nothing lost, pending input processed."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import math
import os
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from runtime.timing.run_clock import RunClock
from runtime.timing.wake import LoopTimer, Timer, TimerFd, Waker, best_timer

MakeTimer = Callable[[Callable[[], None]], Timer]
FAR_S = 60.0


def open_files() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


@pytest.fixture(params=[TimerFd, LoopTimer])
async def waker(request: pytest.FixtureRequest) -> AsyncIterator[Waker]:
    made = Waker(make_timer=request.param)
    yield made
    made.close()


async def test_a_sleep_never_ends_before_the_deadline(waker: Waker) -> None:
    for _ in range(20):
        deadline_s = time.monotonic() + 0.0015
        assert not await waker.until(deadline_s)
        # The loop's own timer may be early by its clock's resolution.
        assert time.monotonic() >= deadline_s - 1e-6


async def test_a_wake_ends_the_sleep(waker: Waker) -> None:
    begin_s = time.monotonic()
    asyncio.get_running_loop().call_later(0.005, waker.wake)
    assert await waker.until(begin_s + FAR_S)
    assert time.monotonic() < begin_s + 0.5 * FAR_S


async def test_a_wake_outside_a_sleep_ends_the_next_sleep_only(waker: Waker) -> None:
    waker.wake()
    waker.wake()
    assert await waker.until(time.monotonic() + FAR_S)
    assert not await waker.until(time.monotonic() + 0.002)


async def test_the_timer_of_a_sleep_that_was_ended_early_does_not_end_the_next_one(waker: Waker) -> None:
    # At once, and well before the timer fires: were the machine suspended in between, both would end the first sleep.
    asyncio.get_running_loop().call_soon(waker.wake)
    assert await waker.until(time.monotonic() + 0.1)
    deadline_s = time.monotonic() + 0.15
    assert not await waker.until(deadline_s)
    assert time.monotonic() >= deadline_s - 1e-6


async def test_the_timer_of_a_sleep_that_was_ended_early_does_not_end_one_without_a_deadline() -> None:
    """The clock is paused meanwhile: the sleep lasts until the next wake."""

    class Paused(RunClock):
        def expect(self, due_s: float) -> float:
            return due_s

    for make_timer in (TimerFd, LoopTimer):
        waker, loop = Waker(Paused(), make_timer), asyncio.get_running_loop()
        loop.call_soon(waker.wake)
        assert await waker.until(0.05)
        loop.call_later(0.15, waker.wake)
        assert await waker.until(math.inf)
        assert not await waker.until(0.001)
        waker.close()


async def test_pending_input_is_processed_at_a_deadline_long_past(waker: Waker) -> None:
    """After an overrun the cycle must not begin with stale inputs while new ones wait in the kernel."""
    read, write = os.pipe()
    loop = asyncio.get_running_loop()
    heard: list[bytes] = []
    loop.add_reader(read, lambda: heard.append(os.read(read, 16)))
    try:
        os.write(write, b"echo")
        assert not await waker.until(time.monotonic() - 1.0)
        assert heard == [b"echo"]
    finally:
        loop.remove_reader(read)
        os.close(read)
        os.close(write)


async def test_input_that_arrives_at_the_deadline_is_processed(waker: Waker) -> None:
    read, write = os.pipe()
    os.set_blocking(read, False)
    loop = asyncio.get_running_loop()
    heard: list[bytes] = []
    loop.add_reader(read, lambda: heard.append(os.read(read, 16)))
    try:
        began_s = deadline_s = 0.0

        def overrun() -> None:
            nonlocal began_s
            began_s = time.monotonic()
            os.write(write, b"echo")
            while time.monotonic() < deadline_s + 0.005:
                pass

        # The machine was suspended for too long in between to test the case: try again.
        while began_s >= deadline_s:
            with contextlib.suppress(BlockingIOError):
                os.read(read, 16)
            heard.clear()
            deadline_s = time.monotonic() + 0.02
            loop.call_soon(overrun)
            await waker.until(deadline_s)
        assert heard == [b"echo"]
    finally:
        loop.remove_reader(read)
        os.close(read)
        os.close(write)


async def test_a_cancelled_sleep_leaves_a_waker_that_works(waker: Waker) -> None:
    task = asyncio.create_task(waker.until(time.monotonic() + FAR_S))
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    waker.wake()
    assert await waker.until(time.monotonic() + FAR_S)


async def test_the_timer_is_released() -> None:
    gc.collect()  # or files that earlier tests have left go meanwhile
    before = open_files()
    for _ in range(3):
        waker = Waker()
        assert not await waker.until(time.monotonic() + 0.001)
        waker.close()
    assert open_files() == before


async def test_a_system_without_timerfd_gets_the_loops_timer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.timing.wake.ctypes.CDLL", lambda *_a, **_k: object())
    assert isinstance(best_timer(lambda: None), LoopTimer)


async def test_deadlines_are_those_of_the_given_clock() -> None:
    waker = Waker(lambda: time.monotonic() + 1000.0)
    begin_s = time.monotonic()
    try:
        assert not await waker.until(begin_s + 1000.01)
    finally:
        waker.close()
    assert begin_s + 0.01 - 1e-6 <= time.monotonic() < begin_s + FAR_S
