"""Tests of the stall sampler: it names what blocks the loop, and nothing while the loop sleeps."""

from __future__ import annotations

import asyncio
import signal
import threading
import time

from runtime.timing.stall_sampler import StallSampler, readable
from tests.hil.machine import TIMEOUT_S


def hold(sampler: StallSampler) -> None:
    # Set in here: the function that runs when the timer fires is sampled, which on a busy machine may be at once.
    sampler.sample_after(0.01)
    end_s = time.monotonic() + TIMEOUT_S
    while sampler.sample is None and time.monotonic() < end_s:
        pass


async def test_the_stall_sampler_names_the_callback_that_blocks_the_loop() -> None:
    sampler = StallSampler()
    with sampler.active():
        asyncio.get_running_loop().call_soon(hold, sampler)
        async with asyncio.timeout(TIMEOUT_S):
            while sampler.sample is None:
                await asyncio.sleep(0.001)
        assert sampler.sample in {("hold", "hold"), ("hold", "StallSampler.sample_after")}
        sampler.sample_after(600.0)
        assert sampler.sample is None


async def test_the_stall_sampler_finds_nothing_while_the_loop_sleeps() -> None:
    sampler, taken = StallSampler(), list[None]()
    take_sample = sampler._take_sample

    def counted(number: int, frame: object) -> None:
        taken.append(None)
        take_sample(number, frame)  # type: ignore[arg-type]

    sampler._take_sample = counted  # type: ignore[method-assign, assignment]
    with sampler.active():
        sampler.sample_after(0.005)
        async with asyncio.timeout(TIMEOUT_S):
            while not taken:
                await asyncio.sleep(0.2)
    assert sampler.sample is None or sampler.sample.callback.startswith("test_the_stall_sampler_finds_nothing")


def test_nothing_is_sampled_outside_the_main_thread_or_where_the_signal_is_in_use() -> None:
    found: list[object] = []

    def sample() -> None:
        sampler = StallSampler()
        with sampler.active():
            sampler.sample_after(0.0)
            found.append((signal.getsignal(signal.SIGALRM), signal.getitimer(signal.ITIMER_REAL)[0]))

    thread = threading.Thread(target=sample)
    thread.start()
    thread.join()
    previous = signal.signal(signal.SIGALRM, signal.SIG_IGN)
    try:
        sample()
    finally:
        signal.signal(signal.SIGALRM, previous)
    assert found == [(signal.SIG_DFL, 0.0), (signal.SIG_IGN, 0.0)]


def test_inner_functions_have_readable_names() -> None:
    assert readable("run_robot.<locals>.whole") == "whole in run_robot"
    assert readable("Console._on_leave") == "Console._on_leave"
