"""Tests of the pacer in virtual time: echoes begin cycles at once, periods are bounded, misses counted exactly."""

from __future__ import annotations

import itertools
import math
import random
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.timing.pacing import LOST_STEPS, CycleStart, Pacer

BEGIN, PERIOD = 10.0, 0.05
TINY = 1e-7


def on_time(pacer: Pacer, took_s: float = 0.001) -> CycleStart:
    """Begin a cycle at its deadline and end it."""
    run_s = pacer.deadline_s
    starts = pacer.begin(run_s)
    pacer.advance(run_s + took_s)
    return starts


# On its own.


def test_on_time_every_deadline_is_taken() -> None:
    pacer = Pacer(BEGIN, PERIOD)
    taken = []
    for _ in range(1000):
        taken.append(pacer.deadline_s)
        assert on_time(pacer) == CycleStart(taken[-1], 0.0, 0, None)
    assert taken == pytest.approx([BEGIN + k * PERIOD for k in range(1000)], abs=1e-9)
    assert (pacer.missed, pacer.is_locked, pacer.period_s) == (0, False, PERIOD)


@pytest.mark.parametrize(
    ("took_s", "ahead", "missed"), [(0.0, 1, 0), (0.049, 1, 0), (0.051, 2, 1), (0.26, 6, 5), (100.01, 2001, 2000)]
)
def test_an_overrun_is_counted_and_the_phase_kept(took_s: float, ahead: int, missed: int) -> None:
    pacer = Pacer(BEGIN, PERIOD)
    pacer.begin(BEGIN)
    assert pacer.advance(BEGIN + took_s) == pytest.approx(BEGIN + ahead * PERIOD, abs=1e-9)
    starts = pacer.begin(pacer.deadline_s)
    assert (starts.missed, pacer.missed, starts.late_s) == (missed, missed, 0.0)
    assert pacer.deadline_s == pytest.approx(BEGIN + (ahead + 1) * PERIOD, abs=1e-9)


@pytest.mark.parametrize(("late_s", "missed"), [(0.001, 0), (0.024, 0), (0.026, 1), (0.051, 1), (0.26, 5), (0.28, 6)])
def test_a_delayed_loop_is_late_by_the_delay_and_keeps_its_phase(late_s: float, missed: int) -> None:
    pacer = Pacer(BEGIN, PERIOD)
    on_time(pacer)
    starts = pacer.begin(BEGIN + PERIOD + late_s)
    assert starts.late_s == pytest.approx(late_s)
    assert starts.missed == missed
    assert pacer.deadline_s == pytest.approx(BEGIN + (missed + 2) * PERIOD)


@given(
    st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 3.0)), min_size=1, max_size=60),
    st.floats(0.001, 1.0),
    st.floats(0.0, 1e6),
)
def test_never_a_burst(delays_s: list[tuple[float, float]], period_s: float, begin_s: float) -> None:
    pacer = Pacer(begin_s, period_s)
    tiny = 1e-6 * period_s + 1e-9
    for k, (late_s, took_s) in enumerate(delays_s):
        start_s = pacer.deadline_s + late_s
        pacer.begin(start_s)
        after = pacer.advance(start_s + took_s)
        assert after > start_s + took_s - tiny, "a deadline that has passed is no next one"
        assert (
            start_s + 0.5 * period_s - tiny
            <= after
            <= max(start_s + 1.5 * period_s, start_s + took_s + period_s) + tiny
        )
        passed = (start_s - begin_s) / period_s
        if abs(passed - math.floor(passed) - 0.5) > 1e-3:
            assert k + pacer.missed == round(passed), "every period is taken or missed"


# With the ring.


class Ring:
    """A loop in virtual time: it reads echoes as they come, unless something holds it.

    With `is_held` it reads nothing while the pacer expects no echo.
    """

    def __init__(self, pacer: Pacer, echoes_s: list[float], *, is_held: bool = False) -> None:
        self.is_held = is_held
        self.pacer, self.echoes_s = pacer, deque(sorted(echoes_s))
        self.run_s = BEGIN
        self.starts: list[tuple[float, CycleStart]] = []
        self.came_s: list[float] = []
        """When the oldest echo of each cycle came, nan where none did."""
        self.waiting_s: list[float] = []

    def _read(self, busy_since_s: float | None) -> None:
        while self.echoes_s and self.echoes_s[0] <= self.run_s:
            self.waiting_s.append(self.echoes_s.popleft())
            self.pacer.on_echo(self.run_s, busy_since_s)

    def cycle(self, took_s: float = 0.001, held_s: float = 0.0) -> CycleStart:
        """Wait for a cycle, run it, and keep the loop busy for a while after it."""
        held_until_s = max(self.run_s, self.pacer.quiet_until_s) if self.is_held else self.run_s
        assert held_until_s <= max(self.run_s, self.pacer.deadline_s)
        if held_until_s > self.run_s:
            self.run_s = held_until_s
            self._read(None)
        while self.pacer.deadline_s > self.run_s:
            next_echo_s = self.echoes_s[0] if self.echoes_s else math.inf
            self.run_s = min(next_echo_s, self.pacer.deadline_s)
            self._read(None)
        starts = self.pacer.begin(self.run_s)
        self.starts.append((self.run_s, starts))
        self.came_s.append(min(self.waiting_s, default=math.nan))
        self.waiting_s.clear()
        since_s = self.run_s
        self.run_s += took_s
        self.pacer.advance(self.run_s)
        self.run_s += held_s
        self._read(since_s)
        return starts

    @property
    def gaps_s(self) -> list[float]:
        return [after - before for (before, _), (after, _) in itertools.pairwise(self.starts)]


def echoes(count: int, step_s: float, jitter_s: float = 0.0, begin_s: float = BEGIN + 0.0317) -> list[float]:
    chance = random.Random(5)
    return [begin_s + k * step_s + chance.uniform(0.0, jitter_s) for k in range(count)]


@pytest.mark.parametrize("is_held", [False, True], ids=["", "held"])
@pytest.mark.parametrize("jitter_s", [0.0, 0.002, 0.01])
@pytest.mark.parametrize("phase_s", [0.0, 0.001, 0.02, 0.025, 0.049])
def test_at_the_rings_own_rate_every_echo_begins_a_cycle_at_once(
    jitter_s: float, phase_s: float, is_held: bool
) -> None:
    ring = Ring(Pacer(BEGIN, PERIOD, PERIOD), echoes(400, PERIOD, jitter_s, BEGIN + phase_s), is_held=is_held)
    for _ in range(398):
        ring.cycle()
    locked = ring.starts[4:]
    assert all(starts.echo_age_s == 0.0 and starts.late_s == 0.0 for _, starts in locked)
    assert ring.pacer.is_locked
    assert ring.pacer.missed == 0
    assert max(ring.gaps_s[4:]) <= PERIOD + jitter_s + TINY
    assert min(ring.gaps_s[4:]) >= PERIOD - jitter_s - TINY


@pytest.mark.parametrize("is_held", [False, True], ids=["", "held"])
@pytest.mark.parametrize(
    ("step_s", "period_s"),
    [(0.025, 0.05), (0.02, 0.05), (0.033, 0.05), (0.05, 0.05), (0.06, 0.05), (0.07, 0.05), (0.1, 0.05),
     (0.17, 0.05), (0.5, 0.05), (0.05, 0.2), (0.001, 0.05)],
)  # fmt: skip
def test_any_step_is_followed_at_a_rate_near_the_configured_one(
    step_s: float, period_s: float, is_held: bool
) -> None:
    count = math.ceil(20.0 / step_s)
    ring = Ring(Pacer(BEGIN, period_s, step_s), echoes(count, step_s, 0.02 * step_s), is_held=is_held)
    while ring.run_s < BEGIN + 19.0:
        ring.cycle(took_s=0.0001)
    locked_s = ring.pacer.period_s
    assert ring.pacer.is_locked
    assert 2 / 3 * period_s - TINY <= locked_s <= 1.5 * period_s + TINY
    rate = len(ring.starts) / (ring.run_s - BEGIN)
    assert rate == pytest.approx(1.0 / locked_s, rel=0.05)
    starts = [b for at_s, b in ring.starts if at_s > BEGIN + 2.0]
    slot_s = min(step_s, locked_s)
    assert max(ring.gaps_s) <= max(period_s, locked_s + 0.75 * slot_s) + TINY
    assert min(ring.gaps_s[1:]) >= locked_s - 0.5 * slot_s - TINY
    if step_s >= period_s:
        ages = [b.echo_age_s for b in starts if b.echo_age_s is not None]
        assert len(ages) > 10
        assert max(ages) == 0.0, "no echo waits"
    assert ring.pacer.missed == 0


def test_no_echo_is_expected_until_a_quarter_step_before_it_is_due() -> None:
    all_of_them = echoes(60, PERIOD)
    ring = Ring(Pacer(BEGIN, PERIOD, PERIOD), all_of_them[:20] + all_of_them[21:])
    assert ring.pacer.quiet_until_s == -math.inf, "no echo has come yet"
    for _ in range(58):
        ring.cycle()
        (at_s, start), quiet_s = ring.starts[-1], ring.pacer.quiet_until_s
        if start.echo_age_s is None:
            assert quiet_s == -math.inf, "the echo may still come"
        elif len(ring.starts) > 3:
            assert quiet_s == pytest.approx(at_s + 0.75 * PERIOD)


def test_the_first_of_several_echoes_of_a_cycle_is_not_read_late() -> None:
    ring = Ring(Pacer(BEGIN, PERIOD, 0.02), echoes(100, 0.02))
    for _ in range(20):
        ring.cycle()
    assert ring.pacer.quiet_until_s == pytest.approx(ring.starts[-1][0] + 0.75 * 0.02)


@pytest.mark.parametrize("late_s", [0.005, 0.02, 0.024])
def test_an_echo_read_late_delays_no_cycle_for_long_where_the_line_is_held(late_s: float) -> None:
    """The next echo is then expected late as well; a quarter of a step of this is made up in each cycle."""
    ring = Ring(Pacer(BEGIN, PERIOD, PERIOD), echoes(100, PERIOD), is_held=True)
    for _ in range(20):
        ring.cycle()
    ring.cycle(held_s=PERIOD - 0.001 + late_s)
    waited_s = []
    for _ in range(4):
        ring.cycle()
        waited_s.append(ring.starts[-1][0] - ring.came_s[-1])
    assert waited_s[0] == pytest.approx(late_s)
    assert waited_s[1] <= max(0.0, late_s - 0.25 * PERIOD) + TINY
    assert waited_s[2:] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_echoes_that_stop_and_resume() -> None:
    """Cycles return to their own period within two steps, and follow the first new echo at once."""
    first, pause_s = echoes(100, PERIOD, 0.001), 2.013
    ring = Ring(Pacer(BEGIN, PERIOD, PERIOD), first + [t + 100 * PERIOD + pause_s for t in first])
    while ring.run_s < first[-1] + 1.9:
        ring.cycle()
    assert not ring.pacer.is_locked
    silent = [at_s for at_s, _ in ring.starts if at_s > first[-1] + (LOST_STEPS + 1) * PERIOD]
    assert len(silent) > 30
    assert [b - a for a, b in itertools.pairwise(silent)] == pytest.approx([PERIOD] * (len(silent) - 1))
    while ring.echoes_s:
        ring.cycle()
    again = [b for at_s, b in ring.starts if at_s > first[0] + 100 * PERIOD + pause_s + 3 * PERIOD]
    assert len(again) > 90
    assert all(b.echo_age_s == 0.0 for b in again)
    assert max(ring.gaps_s) <= 1.75 * PERIOD + TINY, "the deadman is fed all the while"
    assert ring.pacer.missed == 0


def test_the_wait_for_a_lost_echo_is_a_quarter_step_and_keeps_the_phase() -> None:
    all_of_them = echoes(60, PERIOD)
    ring = Ring(Pacer(BEGIN, PERIOD, PERIOD), all_of_them[:20] + all_of_them[21:])
    for _ in range(58):
        ring.cycle()
    (lost,) = (k for k, (_, b) in enumerate(ring.starts) if k > 3 and b.echo_age_s is None)
    assert ring.starts[lost][0] == pytest.approx(all_of_them[20] + 0.25 * PERIOD)
    at_s, after = ring.starts[lost + 1]
    assert at_s == pytest.approx(all_of_them[21])
    assert (after.late_s, after.missed, after.echo_age_s) == (0.0, 0, 0.0)


def test_the_wait_ends_where_the_deadman_needs_a_command() -> None:
    period_s = 0.4
    ring = Ring(Pacer(BEGIN, period_s, period_s, 0.225), echoes(3, period_s))
    for _ in range(20):
        ring.cycle()
    assert max(ring.gaps_s) <= 1.5 * period_s + TINY
    assert max(ring.gaps_s[5:]) == pytest.approx(period_s)


@pytest.mark.parametrize(
    ("held_s", "late_s", "missed"), [(0.03, 0.0, 0), (0.06, 0.011, 0), (0.11, 0.061, 1), (0.31, 0.261, 5)]
)
def test_a_busy_loop_makes_an_echo_late_from_its_expected_arrival(held_s: float, late_s: float, missed: int) -> None:
    ring = Ring(Pacer(BEGIN, PERIOD, PERIOD), echoes(100, PERIOD))
    for _ in range(20):
        ring.cycle()
    ring.cycle(held_s=held_s)
    starts = ring.cycle()
    assert starts.late_s == pytest.approx(late_s, abs=1e-6)
    assert starts.missed == missed
    assert ring.pacer.missed == missed
    for _ in range(5):
        ring.cycle()
    assert ring.starts[-1][1].echo_age_s == 0.0
    assert min(ring.gaps_s[3:]) >= 0.5 * PERIOD - TINY, "no burst"


@given(
    st.lists(st.tuples(st.floats(0.0, 0.2), st.sampled_from([0.0, 0.0, 0.0, 0.04, 0.3])), min_size=5, max_size=80),
    st.sampled_from([0.02, 0.05, 0.06, 0.1, 0.13]),
    st.floats(0.0, 0.05),
    st.integers(0, 2**32),
)
def test_never_a_burst_and_never_starved_for_any_echoes(
    cycles: list[tuple[float, float]], step_s: float, jitter_s: float, seed: int
) -> None:
    chance = random.Random(seed)
    ring = Ring(
        Pacer(BEGIN, PERIOD, step_s), [t for t in echoes(500, step_s, jitter_s) if chance.random() < 0.8]
    )  # fmt: skip
    locked_s = max(PERIOD, Pacer(BEGIN, PERIOD, step_s)._locked_s)
    free_s = BEGIN
    for took_s, held_s in cycles:
        starts = ring.cycle(took_s, held_s)
        at_s = ring.starts[-1][0]
        assert starts.late_s >= 0.0
        assert at_s - free_s <= locked_s + 0.75 * min(step_s, locked_s) + TINY
        came_s = ring.came_s[-1]
        assert (starts.echo_age_s is None) == math.isnan(came_s)
        if came_s > free_s + TINY:
            assert starts.echo_age_s == pytest.approx(at_s - came_s, abs=1e-6), "the loop was not busy"
        free_s = ring.run_s
    least_s = min(Pacer(BEGIN, PERIOD, step_s)._locked_s, PERIOD) * 0.5
    assert all(gap_s >= least_s - TINY for gap_s in ring.gaps_s[1:])
