"""Tests of the run's clock: the host's, or one that pauses, steps and scales together with an emulator."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.emulator.time_scale import TimeScale
from runtime.timing.run_clock import LEASE_S, RunClock, ScaledClock, run_clock

PERIOD_S = 0.05


class Machine:
    """A host's clock that a test sets, an emulator that follows at once, and what was sent to it."""

    def __init__(self) -> None:
        self.host_s = 100.0
        self.sent: list[TimeScale] = []
        self.clock = ScaledClock(lambda: self.host_s, self.sent.append)
        self.changes = 0
        self.clock.on_change(self._count)

    def _count(self) -> None:
        self.changes += 1

    def pass_time(self, seconds: float, *, acknowledged: bool = True) -> None:
        self.host_s += seconds
        if acknowledged:
            self.clock.acknowledged(self.clock.time_scale.run_at(self.host_s))


def is_still(clock: ScaledClock) -> bool:
    return clock.is_still


def is_real_time(clock: ScaledClock) -> bool:
    return clock.is_real_time


def is_paused(clock: ScaledClock) -> bool:
    return clock.is_paused


def test_the_host_s_clock_is_the_run_s() -> None:
    clock = RunClock(lambda: 7.0)
    assert clock.is_real_time
    assert (clock(), clock.both(), clock.at(8.0), clock.expect(7.5)) == (7.0, (7.0, 7.0), 8.0, 0.5)
    assert run_clock(clock) is clock
    assert run_clock(lambda: 3.0)() == 3.0


def test_without_a_request_time_is_real_and_nothing_is_sent() -> None:
    machine = Machine()
    assert machine.clock() == 100.0
    assert machine.clock.expect(100.05) == pytest.approx(0.05)
    machine.clock.cycle_began()
    machine.clock.acknowledged(50.0)
    machine.clock.release()
    assert (machine.clock(), machine.sent) == (100.0, [])


def test_a_pause_stops_time_after_its_lead_and_begins_no_cycle() -> None:
    machine = Machine()
    clock = machine.clock
    clock.expect(100.05)
    assert is_real_time(clock)
    clock.pause(0.02)
    assert not is_real_time(clock)
    assert is_paused(clock)
    assert not is_still(clock), "the emulator has not acknowledged it"
    (sent,) = machine.sent
    assert sent == pytest.approx((0.0, 0.0, 1.0, 100.02))
    assert clock.expect(100.05) == math.inf
    machine.pass_time(5.0)
    assert clock() == pytest.approx(100.02)
    assert is_still(clock)
    clock.resume()
    assert not is_paused(clock)
    assert clock.time_scale.is_real_time
    machine.pass_time(0.01)
    assert clock() == pytest.approx(100.03)
    assert clock.expect(100.05) == pytest.approx(0.02)


def test_a_step_is_time_up_to_the_next_cycle_and_that_cycle() -> None:
    machine = Machine()
    clock = machine.clock
    clock.expect(100.05)
    clock.pause(0.0)
    machine.pass_time(1.0)
    clock.step()
    assert machine.sent[-1] == TimeScale(101.0, 100.0, 1.0, 100.05)
    machine.pass_time(1.0)
    assert clock.expect(100.05) <= 0.0, "due"
    clock.cycle_began()
    assert is_still(clock)
    assert clock.expect(100.1) == math.inf
    assert clock() == pytest.approx(100.05)


def test_scaled_time_waits_for_the_emulator_and_for_a_slow_cycle() -> None:
    machine = Machine()
    clock = machine.clock
    clock.expect(100.05)
    clock.factor = 10.0
    clock.resume()
    assert machine.sent[-1] == pytest.approx((100.0, 100.0, 10.0, 100.05 + LEASE_S))
    machine.pass_time(3.0, acknowledged=False)
    assert clock() == 100.0, "the emulator has not been heard"
    assert clock.expect(100.05) == math.inf
    machine.pass_time(0.0)
    assert clock() == pytest.approx(100.05 + LEASE_S), "no farther before the cycle has started"
    assert clock.expect(100.05) <= 0.0
    clock.cycle_began()
    clock.expect(100.10)
    assert machine.sent[-1].until_s == pytest.approx(100.10 + LEASE_S)
    assert machine.sent[-1].host_s == machine.host_s, "time went no farther meanwhile"


def test_an_emulator_that_got_the_pause_late_sets_the_time_of_the_pause() -> None:
    machine = Machine()
    machine.clock.pause(0.01)
    machine.host_s += 0.5
    machine.clock.acknowledged(100.04)
    assert machine.clock() == pytest.approx(100.04)
    assert is_still(machine.clock)


def test_a_release_is_real_time_without_the_emulator() -> None:
    machine = Machine()
    machine.clock.factor = 0.5
    machine.clock.pause(0.0)
    machine.host_s += 9.0
    machine.clock.release()
    machine.host_s += 1.0
    assert machine.clock() == pytest.approx(101.0)
    assert machine.clock.time_scale.until_s == math.inf


def test_changes_are_reported() -> None:
    machine = Machine()
    machine.clock.expect(100.05)
    acts = (
        lambda: machine.clock.pause(0.0), lambda: machine.clock.acknowledged(100.0), machine.clock.step,
        machine.clock.cycle_began, machine.clock.resume,
    )  # fmt: skip
    for count, act in enumerate(acts, 1):
        act()
        assert machine.changes == count


ACTS = st.sampled_from(["pause", "step", "resume", "fast", "slow", "normal", "cycle", "wait", "wait", "late"])


@given(st.lists(st.tuples(ACTS, st.floats(0.0, 0.3)), max_size=60))
def test_time_never_goes_back_nor_beyond_its_scale(acts: list[tuple[str, float]]) -> None:
    machine, due_s = Machine(), 100.05
    clock = machine.clock
    before_s = clock()
    for act, seconds in acts:
        if act == "pause":
            clock.pause(0.02)
        elif act == "step":
            clock.step()
        elif act in {"resume", "fast", "slow", "normal"}:
            clock.factor = {"fast": 4.0, "slow": 0.5, "normal": 1.0}.get(act, clock.factor)
            clock.resume()
        elif act == "cycle":
            if clock.expect(due_s) <= 0.0:
                clock.cycle_began()
                due_s = clock() + PERIOD_S
        else:
            machine.pass_time(seconds, acknowledged=act == "wait")
        now_s = clock()
        assert now_s >= before_s
        assert now_s <= clock.time_scale.until_s + 1e-9
        before_s = now_s
