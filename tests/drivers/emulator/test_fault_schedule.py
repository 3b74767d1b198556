"""The order in which scripted faults start and end, and bits flipped at a given rate."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.emulator.fault_schedule import FaultSchedule, flip_bits
from drivers.emulator.faults import Deaf, Fault, Mute, OdometryJump


def advance(schedule: FaultSchedule, now_us: int) -> list[tuple[bool, Fault]]:
    """Take what is due and mark it as the robot does."""
    due = list(schedule.due(now_us))
    for begins, fault in due:
        schedule.set_active(fault, on=begins)
    return due


def test_faults_start_and_end_in_the_order_of_their_times() -> None:
    late, early = Mute(kind="mute", at_s=1.0, duration_s=1.0), Deaf(kind="deaf", at_s=0.5, duration_s=1.0)
    schedule = FaultSchedule((late, early))
    assert schedule.next_us == 500_000
    assert advance(schedule, 499_999) == []
    assert advance(schedule, 500_000) == [(True, early)]
    assert (schedule.has(Deaf), schedule.has(Mute)) == (True, False)
    assert advance(schedule, 1_000_000) == [(True, late)]
    assert (schedule.all(Deaf), schedule.all(Mute)) == ([early], [late])
    assert advance(schedule, 5_000_000) == [(False, early), (False, late)]
    assert not schedule.has(Deaf)
    assert schedule.all(Mute) == []
    assert schedule.next_us is None


def test_a_fault_without_duration_ends_right_after_it_starts() -> None:
    jump = OdometryJump(kind="odometry_jump", at_s=0.1, dx_m=1.0, dy_m=0.0, dheading_rad=0.0)
    schedule = FaultSchedule((jump,))
    assert advance(schedule, 100_000) == [(True, jump), (False, jump)]
    assert not schedule.has(OdometryJump)


def test_of_two_equal_faults_one_may_end_before_the_other() -> None:
    short, long = (Mute(kind="mute", at_s=0.0, duration_s=d) for d in (1.0, 2.0))
    schedule = FaultSchedule((short, long))
    advance(schedule, 0)
    advance(schedule, 1_000_000)
    assert schedule.all(Mute) == [long]


@pytest.mark.parametrize("rate", [0.0, 0.01, 1.0])
def test_bits_flip_at_the_given_rate_and_the_draws_do_not_depend_on_it(rate: float) -> None:
    data, rng, other = bytes(5000), np.random.default_rng(1), np.random.default_rng(1)
    flipped = sum(byte.bit_count() for byte in flip_bits(data, rate, rng))
    # A binomial count; five of its standard deviations.
    assert abs(flipped - rate * 40_000) <= 5.0 * (40_000 * rate * (1.0 - rate)) ** 0.5
    flip_bits(data, 0.5, other)
    assert rng.random() == other.random()
    assert data == bytes(5000)
