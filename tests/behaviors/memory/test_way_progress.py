"""Progress along legs: what turns to and fro before a wall makes none."""

from __future__ import annotations

import math

import pytest

from behaviors.memory.way_progress import NEARER_M, STALLED_S, WayProgress


def test_coming_nearer_is_progress_and_coming_back_is_none() -> None:
    progress = WayProgress()
    assert progress.stalled_s(99.0) == 0.0
    for k in range(100):
        progress = progress.observe(5.0 - 0.9 * NEARER_M * math.sin(k) ** 2, 0.0, 1.0 + k, outbound=True)
    assert progress.stalled_s(100.0) == 99.0
    assert progress.observe(5.0 - NEARER_M, 0.0, 101.0, outbound=True).stalled_s(101.0) == 0.0


def test_a_robot_that_drives_on_makes_progress() -> None:
    progress = WayProgress()
    for k in range(600):
        progress = progress.observe(-0.02 * k, 0.0, 0.1 * k, outbound=True)
        assert progress.stalled_s(0.1 * k) < STALLED_S


@pytest.mark.parametrize(("outbound", "requested_run_s"), [(False, 0.0), (True, 30.0)])
def test_another_request_or_the_way_back_starts_anew(outbound: bool, requested_run_s: float) -> None:
    progress = WayProgress().observe(5.0, 0.0, 0.0, outbound=True)
    assert progress.stalled_s(31.0) == 31.0
    assert progress.observe(5.0, requested_run_s, 31.0, outbound=outbound).stalled_s(31.0) == 0.0
