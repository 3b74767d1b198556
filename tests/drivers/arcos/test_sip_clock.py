"""Times of SIPs from their arrivals: jitter, a held-up process, lost SIPs, a period off its nominal value."""

from __future__ import annotations

import random

import pytest

from drivers.arcos.sip_clock import SipClock


def errors(measured: list[float], delays: list[float], *, lost: frozenset[int] = frozenset()) -> list[float]:
    """Return by how much the clock is off for each SIP measured at these times and delayed so; lost ones are None."""
    clock = SipClock(0.1)
    found, arrived_s = [], 0.0
    for k, (true_s, delay_s) in enumerate(zip(measured, delays, strict=True)):
        if k in lost:
            continue
        arrived_s = max(arrived_s, true_s + delay_s)
        found.append(clock.read(arrived_s, after_loss=k - 1 in lost) - true_s)
    return found


def test_random_delays_are_smoothed() -> None:
    rng = random.Random(1)
    off = errors([0.1 * k for k in range(500)], [rng.expovariate(1.0 / 0.005) for _ in range(500)])
    assert max(map(abs, off[20:])) < 0.012
    assert sum(abs(e) > 0.006 for e in off) < 10


def test_sips_that_arrive_together_keep_their_distance() -> None:
    delays = [0.0] * 30
    delays[10:14] = [0.35, 0.25, 0.15, 0.05]
    off = errors([0.1 * k for k in range(30)], delays)
    assert max(map(abs, off)) < 1e-9


@pytest.mark.parametrize("period_s", [0.0947, 0.0997, 0.1003, 0.1057])
def test_a_period_off_its_nominal_value_is_followed(period_s: float) -> None:
    off = errors([period_s * k for k in range(300)], [0.0] * 300)
    assert max(map(abs, off)) < 5.0 * abs(period_s - 0.1) + 1e-9


def test_after_a_corrupt_frame_the_clock_is_right_at_once() -> None:
    off = errors([0.1 * k for k in range(40)], [0.0] * 40, lost=frozenset({10, 20, 21}))
    assert max(map(abs, off)) < 1e-9


def test_a_sip_that_was_lost_without_a_trace_costs_half_a_second() -> None:
    clock = SipClock(0.1)
    off = [clock.read(0.1 * k, after_loss=False) - 0.1 * k for k in range(30) if k != 10]
    assert off[10:14] == pytest.approx([-0.1] * 4)
    assert off[14:] == pytest.approx([0.0] * 15)


def test_times_only_grow() -> None:
    clock, before = SipClock(0.1), 0.0
    for arrived_s in (1.0, 1.0, 1.0, 1.0001, 1.3, 1.3, 9.0, 9.0):
        now = clock.read(arrived_s, after_loss=False)
        assert now > before
        before = now
    clock.restart()
    assert clock.read(11.0, after_loss=False) == 11.0
