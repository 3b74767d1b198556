"""Progress along legs: what turns to and fro before a wall makes none."""

from __future__ import annotations

import math

import pytest

from behaviors.memory.way_progress import GROUND_M, STALLED_S, WayProgress, due_m

DUE_M = due_m(0.3)


def test_the_way_due_is_what_a_slow_base_can_gain() -> None:
    assert DUE_M == GROUND_M
    assert due_m(0.02) == pytest.approx(0.1)


def test_coming_nearer_is_progress_and_coming_back_is_none() -> None:
    progress = WayProgress()
    assert progress.stalled_s(99.0) == 0.0
    for k in range(100):
        progress = progress.observe(5.0 - 0.9 * DUE_M * math.sin(k) ** 2, DUE_M, 0.0, 1.0 + k, outbound=True)
    assert progress.stalled_s(100.0) == 99.0
    assert progress.best_m is not None
    assert progress.observe(progress.best_m - DUE_M, DUE_M, 0.0, 101.0, outbound=True).stalled_s(101.0) == 0.0


def test_a_rush_before_a_creep_does_not_count_for_it() -> None:
    """0.45 m in 2 s, then a centimetre a second: over any 20 s from there on it is less than what is due."""
    progress, stalled_from_s = WayProgress(), math.inf
    for k in range(600):
        run_s = 0.1 * k
        left_m = -min(run_s, 2.0) * 0.225 - 0.01 * max(0.0, run_s - 2.0)
        progress = progress.observe(left_m, DUE_M, 0.0, run_s, outbound=True)
        if progress.stalled_s(run_s) >= STALLED_S:
            stalled_from_s = min(stalled_from_s, run_s)
    assert stalled_from_s < 2.0 + STALLED_S


@pytest.mark.parametrize(("speed_m_s", "is_stalled"), [(0.2, False), (0.03, False), (0.02, True), (0.006, True)])
def test_a_robot_that_creeps_makes_no_progress(speed_m_s: float, is_stalled: bool) -> None:
    """Judged over the whole time: a decimetre now and then is none."""
    progress, longest_s = WayProgress(), 0.0
    for k in range(1200):
        run_s = 0.1 * k
        progress = progress.observe(-speed_m_s * run_s, DUE_M, 0.0, run_s, outbound=True)
        longest_s = max(longest_s, progress.stalled_s(run_s))
    assert (longest_s >= STALLED_S) is is_stalled


@pytest.mark.parametrize(("outbound", "part", "requested_run_s"), [(False, 0, 0.0), (True, 1, 0.0), (True, 0, 30.0)])
def test_another_request_part_or_way_back_starts_anew(outbound: bool, part: int, requested_run_s: float) -> None:
    progress = WayProgress().observe(5.0, DUE_M, 0.0, 0.0, outbound=True)
    assert progress.stalled_s(31.0) == 31.0
    anew = progress.observe(5.0, DUE_M, requested_run_s, 31.0, outbound=outbound, part=part)
    assert anew.stalled_s(31.0) == 0.0
