"""Time scales: the message that carries one, and the times that follow from it."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from drivers.emulator.time_scale import FACTOR_MAX, FACTOR_MIN, MESSAGE_MAX, REAL_TIME, TimeScale, parse_time_scale

TIMES = st.floats(-1e6, 1e9)
SCALES = st.builds(TimeScale, TIMES, TIMES, st.floats(FACTOR_MIN, FACTOR_MAX), st.one_of(TIMES, st.just(math.inf)))


@given(SCALES, st.integers(0, 10**6))
def test_a_message_carries_a_time_scale_exactly_to_the_bit(scale: TimeScale, number: int) -> None:
    line = scale.encode(number)
    assert len(line) <= MESSAGE_MAX
    assert parse_time_scale(line) == (number, scale)


@given(st.floats(0.0, 1e9))
def test_real_time_equals_the_hosts_time_to_the_bit(host_s: float) -> None:
    assert REAL_TIME.run_at(host_s) == host_s


@given(SCALES, st.lists(TIMES, min_size=2))
def test_time_never_decreases_and_never_passes_its_end(scale: TimeScale, moments: list[float]) -> None:
    shown = [scale.run_at(host_s) for host_s in sorted(moments)]
    assert shown == sorted(shown)
    assert max(shown) <= scale.until_s


def test_host_time_of_a_run_time() -> None:
    scale = TimeScale(10.0, 100.0, 4.0, 102.0)
    assert scale.host_at(102.0) == 10.5
    assert scale.run_at(10.5) == 102.0
    assert scale.run_at(99.0) == 102.0
    assert scale.host_at(102.1) == math.inf
