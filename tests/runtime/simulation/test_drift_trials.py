"""Rounds with drifting odometry: the path, the odometry, and what correction makes of them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from config.load import load_settings
from config.units import FOOT_M
from config.world import OdometryConfig
from drivers.messages import Pose
from runtime.simulation import drift_trials
from runtime.simulation.drift_trials import (
    LEVELS,
    STEP_FT,
    DriftOutcome,
    drive,
    drum_hall,
    odometry_along,
    oval,
    summarise_drives,
)

ROBOT_RADIUS_M = 0.381


def test_the_path_closes_in_even_steps_and_keeps_clear_of_the_drums() -> None:
    path = oval(3)
    assert (path[0].x, path[0].y) == pytest.approx((path[-1].x, path[-1].y), abs=1e-9)
    assert path[-1].theta - path[0].theta == pytest.approx(6.0 * math.pi)
    steps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in itertools.pairwise(path)]
    assert steps == pytest.approx([STEP_FT * FOOT_M] * len(steps), rel=0.02)
    for seed in range(5):
        for drum in drum_hall(seed).drum:
            assert min(math.dist((p.x, p.y), (drum.x_m, drum.y_m)) for p in path) > ROBOT_RADIUS_M + drum.radius_m


def test_odometry_without_errors_is_the_path() -> None:
    path = oval(1)
    reported = list(odometry_along(path, LEVELS[0], np.random.default_rng(0)))
    for true, pose in zip(path, reported, strict=True):
        assert (pose.x, pose.y, pose.theta) == pytest.approx((true.x, true.y, true.theta), abs=1e-9)


def test_odometry_has_the_scale_and_the_random_walk_it_is_given() -> None:
    path = [Pose(0.01 * k, 0.0, 0.0) for k in range(201)]
    ends = [
        list(odometry_along(path, OdometryConfig(scale=1.02, heading_rad_per_sqrt_m=0.05), np.random.default_rng(s)))[
            -1
        ]
        for s in range(200)
    ]
    assert np.mean([end.x for end in ends]) == pytest.approx(2.0 * 1.02, rel=0.005)
    assert np.std([end.theta for end in ends]) == pytest.approx(0.05 * math.sqrt(2.0), rel=0.15)


@pytest.mark.compiled
def test_one_round_with_correction_finds_the_drums_and_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drift_trials, "ROUNDS", 1)
    monkeypatch.setattr(drift_trials, "oval", lambda: oval(1))
    outcome = drive(load_settings("hallway"), LEVELS[2], 200, corrected=True)
    assert (outcome.missed, outcome.false) == (0, 0)
    assert np.mean(outcome.errors) < 0.08 * FOOT_M
    assert outcome.place < 0.15 * FOOT_M
    assert outcome.heading < math.radians(2.0)


def test_the_summary_averages_the_drives() -> None:
    outcomes = [
        DriftOutcome((0.01, 0.03), 0, 0, 0.1, 0.0, 2.0, 1.0, 0.003, 0.0),
        DriftOutcome((0.02,), 1, 1, 0.3, 0.0, 4.0, 2.0, -0.003, 0.0),
    ]
    row = summarise_drives(LEVELS[1], outcomes)
    assert (row["seeds"], row["drums"], row["missed"], row["false"]) == (2, 4, 1, 1)
    assert row["mean_error"] == pytest.approx(0.02)
    assert row["place"] == pytest.approx(0.2)
    assert (row["nees"], row["object_nees"]) == (3.0, 1.5)
    assert row["odometer_error"] == pytest.approx(0.003)


def test_without_correction_there_is_nothing_of_the_filter() -> None:
    row = summarise_drives(LEVELS[0], [DriftOutcome((), 8, 0, 0.0, 0.0)])
    assert not row["corrected"]
    assert row["mean_error"] is None
    assert row["nees"] is None
