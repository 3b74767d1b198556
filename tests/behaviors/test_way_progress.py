"""Progress of any drive: nearer, or new ground; what turns to and fro makes none."""

from __future__ import annotations

import math

import pytest

from behaviors.way_progress import GROUND_M, NEARER_M, STALLED_S, WayProgress
from perception.percept import Pose

HERE = Pose(0.0, 0.0, 0.0)


def test_coming_nearer_is_progress_and_coming_back_is_none() -> None:
    progress = WayProgress().observe(HERE, 5.0, 0, 0.0, 1.0)
    for k in range(100):
        progress = progress.observe(HERE, 5.0 - 0.9 * NEARER_M * math.sin(k) ** 2, 0, 0.0, 1.0 + k)
    assert progress.stalled_s(100.0) == 99.0
    assert progress.observe(HERE, 5.0 - NEARER_M, 0, 0.0, 101.0).stalled_s(101.0) == 0.0


@pytest.mark.parametrize("radius_m", [0.0, 0.1, 0.99 * GROUND_M])
def test_driving_to_and_fro_is_no_new_ground(radius_m: float) -> None:
    progress = WayProgress().observe(HERE, None, 0, 0.0, 0.0)
    for k in range(1, 300):
        pose = Pose(radius_m * math.cos(k), radius_m * math.sin(k), k)
        progress = progress.observe(pose, None, 0, 0.0, 0.1 * k)
    assert progress.stalled_s(29.9) > STALLED_S


def test_a_robot_that_wanders_on_makes_progress() -> None:
    progress = WayProgress()
    for k in range(600):
        progress = progress.observe(Pose(0.005 * k, 0.0, 0.0), None, 0, 0.0, 0.1 * k)
        assert progress.stalled_s(0.1 * k) < STALLED_S


@pytest.mark.parametrize(("part", "requested_run_s", "remaining_m"), [(1, 0.0, 5.0), (0, 30.0, 5.0), (0, 0.0, None)])
def test_another_request_or_another_part_of_it_starts_anew(
    part: int, requested_run_s: float, remaining_m: float | None
) -> None:
    progress = WayProgress().observe(HERE, 5.0, 0, 0.0, 0.0).observe(HERE, remaining_m, part, requested_run_s, 31.0)
    assert progress.stalled_s(31.0) == 0.0
