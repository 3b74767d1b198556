"""Tests of the scheduler: it begins cycles with echoes, measures them, and names what makes them overrun."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

from config.load import load_settings
from runtime.timing.cycle_scheduler import CycleScheduler
from runtime.timing.run_clock import ScaledClock
from runtime.timing.timing_monitor import OUTSIDE
from runtime.timing.wake import LoopTimer
from tests.runtime.virtual_time import VirtualLoop

SETTINGS = load_settings("hallway")
PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz


@pytest.fixture
def loop(monkeypatch: pytest.MonkeyPatch) -> Iterator[VirtualLoop]:
    monkeypatch.setattr("runtime.timing.wake.best_timer", LoopTimer)
    made = VirtualLoop()
    yield made
    made.close()


def test_cycles_begin_at_their_period_and_with_an_echo_at_once(loop: VirtualLoop) -> None:
    scheduler = CycleScheduler(SETTINGS, loop.time)
    begins: list[tuple[float, float | None]] = []

    async def run() -> None:
        with scheduler.start(loop.time(), 0.45):
            while len(begins) < 8:
                now = await scheduler.wait()
                if now is None:
                    continue
                start = scheduler.begin(now)
                begins.append((now.run_s, start.echo_age_s))
                if len(begins) == 4:
                    loop.call_later(0.03, lambda: scheduler.on_echo(loop.time()))
                assert scheduler.end(loop.time()) > 0.0

    begin_s = loop.time()
    loop.run_until_complete(run())
    scheduler.close()
    times = [at_s - begin_s for at_s, _ in begins]
    assert times[:4] == pytest.approx([k * PERIOD_S for k in range(4)], abs=1e-6)
    assert times[4] == pytest.approx(times[3] + 0.03, abs=1e-6), "the echo began the cycle"
    assert [age for _, age in begins] == [None] * 4 + [pytest.approx(0.0)] + [None] * 3
    assert scheduler.stats.cycles >= 7
    assert (scheduler.stats.late, scheduler.overrun) == (0, None)


def test_after_the_last_cycle_no_thread_rests(loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is still being loaded when a short run ends is loaded at once: the end of the run waits for it."""
    scheduler = CycleScheduler(SETTINGS, loop.time)
    closed: list[str] = []
    monkeypatch.setattr(scheduler.gaps, "close", lambda: closed.append("gaps"))

    async def run() -> None:
        with scheduler.start(loop.time(), 0.45):
            if (now := await scheduler.wait()) is not None:
                scheduler.begin(now)
            assert not closed

    loop.run_until_complete(run())
    assert closed == ["gaps"]
    scheduler.close()


def test_overruns_in_a_row_are_a_reason_to_stop_that_names_the_cause(loop: VirtualLoop) -> None:
    scheduler = CycleScheduler(SETTINGS, loop.time, ("link receive",))
    receive = scheduler.timing_monitor.timed("link receive", lambda: loop.spend(2.0 * PERIOD_S))
    reasons: list[str | None] = []

    async def run() -> None:
        with scheduler.start(loop.time(), 0.45):
            while len(reasons) < SETTINGS.cycle.overruns_max + 2:
                now = await scheduler.wait()
                if now is not None:
                    scheduler.begin(now)
                    reasons.append(scheduler.overrun)
                    scheduler.end(loop.time())
                    receive()

    loop.run_until_complete(run())
    scheduler.close()
    assert reasons[: SETTINGS.cycle.overruns_max] == [None] * SETTINGS.cycle.overruns_max
    assert str(reasons[-1]).startswith(f"{SETTINGS.cycle.overruns_max + 1} cycles in a row left no time")
    # The callback spends no processor time here, so the system is blamed for the delay.
    assert f"mostly through {OUTSIDE}" in str(reasons[-1])


@pytest.mark.parametrize("is_paused", [False, True])
def test_no_echo_is_expected_directly_after_one_unless_time_is_paused(loop: VirtualLoop, is_paused: bool) -> None:
    clock = ScaledClock(loop.time)
    scheduler = CycleScheduler(SETTINGS, clock)

    async def run() -> float:
        with scheduler.start(loop.time(), 0.45):
            for _ in range(4):
                loop.call_later(0.9 * PERIOD_S, lambda: scheduler.on_echo(loop.time()))
                while (now := await scheduler.wait()) is None:
                    pass
                scheduler.begin(now)
                scheduler.end(loop.time())
        if is_paused:
            clock.pause(0.02)
        return scheduler.quiet_s(loop.time())

    quiet_s = loop.run_until_complete(run())
    scheduler.close()
    assert quiet_s == pytest.approx(0.0 if is_paused else 0.75 * PERIOD_S)


def test_a_wake_ends_the_wait_without_a_cycle(loop: VirtualLoop) -> None:
    scheduler = CycleScheduler(SETTINGS, loop.time)

    async def run() -> None:
        with scheduler.start(loop.time() + 10.0, 0.45):
            loop.call_later(1.0, scheduler.wake)
            assert await scheduler.wait() is None

    begin_s = loop.time()
    loop.run_until_complete(run())
    scheduler.close()
    assert loop.time() - begin_s == pytest.approx(1.0, abs=1e-6)


def test_a_scheduler_is_started_before_it_is_used(loop: VirtualLoop) -> None:
    scheduler = CycleScheduler(SETTINGS, loop.time)
    scheduler.on_echo(loop.time())  # one that comes early is ignored
    with pytest.raises(RuntimeError, match="before it was started"):
        loop.run_until_complete(asyncio.ensure_future(scheduler.wait(), loop=loop))
