"""Tests of the clock sampler: its clocks distinguish work from sleep, and the run's clock from the host's."""

from __future__ import annotations

import time

from drivers.emulator.time_scale import TimeScale
from runtime.timing.clock_sampler import ClockSampler
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
    while sampler.read().thread_s - slept.thread_s < 0.02:
        pass
    worked = sampler.read()
    # The clocks are read one after another.
    assert worked.thread_s - slept.thread_s <= worked.process_s - slept.process_s + 0.01
