"""Sonar lists to firings: their times from nothing but the lists, partial updates, simulators, odd content."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from drivers.arcos.frames import SonarReading
from drivers.arcos.sonar import SonarRing, SonarTimes
from drivers.messages import Floats

SIXTEEN = tuple(range(16))


def ring(discs: tuple[int, ...] = SIXTEEN, factor: float = 1.0) -> SonarRing:
    made = SonarRing(discs, factor)
    made.set_cycle(0.04, 5.0)
    return made


def readings(*pairs: tuple[int, int]) -> tuple[SonarReading, ...]:
    return tuple(SonarReading(number, raw) for number, raw in pairs)


def fired(ranges: Floats) -> dict[int, float]:
    return {int(k): float(ranges[k]) for k in np.flatnonzero(~np.isnan(ranges))}


@pytest.mark.parametrize("jitter_s", [0.0, 0.003])
@pytest.mark.parametrize(("cycle_s", "first_s", "later_s"), [(0.04, 0.011, 0.011), (0.041, 0.02, 0.003)])
@pytest.mark.parametrize("phase_s", [0.001, 0.013, 0.028, 0.039])
def test_times_are_found_from_the_number_of_ranges_alone(
    phase_s: float, cycle_s: float, first_s: float, later_s: float, jitter_s: float
) -> None:
    rng = random.Random(3)
    times, done, off = SonarTimes(cycle_s), -2, []
    for sip in range(1, 200):
        sip_s = 0.1 * sip
        ended = math.floor((sip_s - phase_s) / cycle_s + 1e-9)
        found_s = times.last_end_s(sip_s + rng.uniform(-jitter_s, jitter_s), ended - done)
        off.append(found_s - (phase_s + cycle_s * ended))
        done = ended
    assert max(map(abs, off)) <= 0.021 + jitter_s
    assert max(map(abs, off[3:])) <= first_s + jitter_s
    assert max(map(abs, off[20:])) <= later_s + jitter_s


def test_a_lost_sip_only_begins_the_estimate_anew() -> None:
    times = SonarTimes(0.04)
    assert times.last_end_s(1.0, 2) == pytest.approx(0.98)
    assert times.last_end_s(1.3, 2) == pytest.approx(1.28)


def test_arrays_fire_in_parallel_and_a_range_is_known_at_the_end_of_its_cycle() -> None:
    found = ring().firings(readings((0, 1000), (8, 2000), (1, 5000), (9, 0)), 10.0, 0.1)
    assert [t for t, _ in found] == pytest.approx([9.9, 9.94])
    assert fired(found[0][1]) == {0: 1.0, 8: 2.0}
    assert fired(found[1][1]) == {1: math.inf}, "0 is a fault, 5000 that nothing was heard"


def test_lists_are_in_the_order_of_firing_however_the_arrays_follow_each_other() -> None:
    one_by_one = ring().firings(readings((0, 100), (1, 200), (8, 300), (9, 400)), 10.0, 0.1)
    in_turn = ring().firings(readings((0, 100), (8, 300), (1, 200), (9, 400)), 10.0, 0.1)
    assert [fired(ranges) for _, ranges in one_by_one] == [fired(ranges) for _, ranges in in_turn]


def test_an_array_with_fewer_ranges_fired_last() -> None:
    found = ring().firings(readings((0, 100), (1, 200), (9, 400)), 10.0, 0.1)
    assert [fired(ranges) for _, ranges in found] == [{0: 0.1}, {1: 0.2, 9: 0.4}]


def test_a_simulator_lists_all_discs_as_of_now() -> None:
    found = ring().firings(readings(*((k, 100 + k) for k in range(16))), 10.0, 0.1)
    assert len(found) == 1
    assert found[0][0] == 10.0
    assert fired(found[0][1]) == {k: pytest.approx(0.1 + 1e-3 * k) for k in range(16)}


def test_a_second_range_of_a_disc_at_the_same_time_is_ignored() -> None:
    found = ring().firings(readings(*((k, 100 + k) for k in range(16)), (0, 999)), 10.0, 0.1)
    assert found[-1][1][0] == 0.1 or fired(found[0][1])[0] == 0.1


def test_discs_have_numbers_of_their_own_and_unknown_ones_are_skipped() -> None:
    made = ring((0, 2, 8), 0.268)
    found = made.firings(readings((7, 3731), (8, 3731)), 10.0, 0.1)
    assert [fired(ranges) for _, ranges in found] == [{2: pytest.approx(1.0, abs=1e-3)}]
    assert made.firings(readings((31, 100), (200, 100)), 10.1, 0.1) == []
    assert made.firings((), 10.2, 0.1) == []


def test_a_range_beyond_the_window_is_no_echo() -> None:
    made = SonarRing(SIXTEEN, 1.0)
    made.set_cycle(0.02, 3.0)
    ((_, ranges),) = made.firings(readings((3, 3001)), 10.0, 0.1)
    assert ranges[3] == math.inf


def test_times_only_grow() -> None:
    rng, made, before = random.Random(5), ring(), 0.0
    for sip in range(100):
        count = rng.randrange(5)
        for fired_s, _ in made.firings(readings(*((k % 8, 100) for k in range(count))), 1.0 + 0.1 * sip, 0.1):
            assert fired_s > before
            before = fired_s
    made.restart()
    assert made.firings(readings((0, 100)), 0.5, 0.1)[0][0] == pytest.approx(0.44)
