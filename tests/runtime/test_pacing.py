"""Pacing: never a burst, the phase is kept, and every deadline is either met or counted as missed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.pacing import Pacer

BEGIN, PERIOD = 10.0, 0.05


def test_on_time_every_deadline_is_taken() -> None:
    pacer = Pacer(BEGIN, PERIOD)
    assert pacer.deadline_s == BEGIN
    taken = [pacer.advance(pacer.deadline_s + 0.01) for _ in range(1000)]
    assert taken == pytest.approx([BEGIN + (k + 1) * PERIOD for k in range(1000)], abs=1e-9)
    assert pacer.missed == 0


@pytest.mark.parametrize(
    ("took_s", "ahead", "missed"), [(0.0, 1, 0), (0.049, 1, 0), (0.051, 2, 1), (0.26, 6, 5), (100.01, 2001, 2000)]
)
def test_an_overrun_is_counted_and_the_phase_kept(took_s: float, ahead: int, missed: int) -> None:
    pacer = Pacer(BEGIN, PERIOD)
    assert pacer.advance(BEGIN + took_s) == pytest.approx(BEGIN + ahead * PERIOD, abs=1e-9)
    assert pacer.missed == missed


def test_awake_before_the_deadline_it_does_not_run_the_same_deadline_twice() -> None:
    """A sleep may end a little early; the grid goes on all the same."""
    pacer = Pacer(BEGIN, PERIOD)
    first = pacer.advance(BEGIN + 0.01)
    second = pacer.advance(first - 0.001)
    assert second == pytest.approx(first + PERIOD)
    assert pacer.missed == 0


@given(
    st.lists(st.floats(0.0, 3.0), min_size=1, max_size=60),
    st.floats(0.001, 1.0),
    st.floats(0.0, 1e6),
)
def test_never_a_burst(durations_s: list[float], period_s: float, begin_s: float) -> None:
    pacer = Pacer(begin_s, period_s)
    now_s = begin_s
    tiny = 1e-6 * period_s + 1e-9
    for k, took_s in enumerate(durations_s, 1):
        before = pacer.deadline_s
        now_s = max(now_s, before) + took_s
        after = pacer.advance(now_s)
        assert after > now_s - tiny, "a deadline that has passed is no next one"
        assert after - now_s < period_s + tiny, "the next deadline is never farther off than a period"
        assert after >= before + period_s - tiny
        number = (after - begin_s) / period_s
        assert number == pytest.approx(round(number), abs=1e-3), "deadlines stay on their grid"
        assert k + pacer.missed == round(number), "every deadline is taken or missed"
