"""Tests of the clock sampler: its clocks distinguish work from sleep, and the run's clock from the host's."""

from __future__ import annotations

import threading
import time

import pytest

from drivers.emulator.time_scale import TimeScale
from runtime.timing.clock_sampler import OTHERS_AGE_S, QUICK_S, ClockSampler
from runtime.timing.run_clock import ScaledClock


def test_a_paused_run_is_read_beside_the_host() -> None:
    clock = ScaledClock(lambda: 12.5)
    clock.time_scale = TimeScale(10.0, 10.0, 1.0, 11.0)
    sample = ClockSampler(clock).read()
    assert (sample.run_s, sample.host_s) == (11.0, 12.5)


def test_the_clock_sampler_distinguishes_work_from_sleep() -> None:
    sampler = ClockSampler()
    before = sampler.read()
    time.sleep(0.02)
    slept = sampler.read()
    assert slept.waits > before.waits
    assert slept.host_s - before.host_s >= 0.02
    assert slept.thread_s - before.thread_s < 0.5 * (slept.host_s - before.host_s)
    while (worked := sampler.read()).thread_s - slept.thread_s < 0.02:
        pass
    assert worked.host_s - slept.host_s >= 0.02


def test_the_thread_s_time_is_of_now_and_not_of_the_last_tick() -> None:
    sampler, sampled_s, worked_s = ClockSampler(), 0.0, 0.0
    for _ in range(50):
        outer_s = time.thread_time()
        begin = sampler.read()
        sum(range(20_000))  # a part of a tick
        sampled_s += sampler.read().thread_s - begin.thread_s
        worked_s += time.thread_time() - outer_s
    assert 0.5 * worked_s < sampled_s <= worked_s


def test_the_work_of_other_threads_is_read_once_in_a_millisecond() -> None:
    host_s = [5.0]
    sampler = ClockSampler(lambda: host_s[0])
    before = sampler.read()
    worker = threading.Thread(target=lambda: sum(range(1_000_000)))
    worker.start()
    worker.join()
    host_s[0] += 0.9 * OTHERS_AGE_S
    assert sampler.read().others_s == before.others_s
    host_s[0] += 0.2 * OTHERS_AGE_S
    assert sampler.read().others_s > before.others_s


def test_the_end_of_quick_work_is_read_from_the_run_s_clock_only() -> None:
    host_s = [5.0]
    sampler = ClockSampler(lambda: host_s[0])
    begin = sampler.read()
    host_s[0] += 0.9 * QUICK_S
    quick = sampler.read_after(begin)
    assert (quick.run_s, quick.host_s, quick.waits) == (host_s[0], host_s[0], begin.waits)
    assert quick.thread_s - begin.thread_s == pytest.approx(0.9 * QUICK_S)
    time.sleep(0.001)  # a wait, which only the clocks of the thread show
    host_s[0] += QUICK_S
    assert sampler.read_after(quick).waits > begin.waits
