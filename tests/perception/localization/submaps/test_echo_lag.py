"""Ranges that lag behind odometry, or odometry behind ranges: found from the echoes, and never imagined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.localization.submaps.echo_lag import LAG_REFUTED, EchoLag, lag_of
from perception.snapshot import put_back, snapshot_of
from tests.perception.localization.rooms import RING
from tests.perception.localization.submaps.test_submap_graph import driven

STEP_S = 0.15
"""Between two firings 0.1 m apart."""


@cache
def drive(rounds: int, seed: int) -> Sequence[Firing]:
    """Return the firings of a drive, whose odometry's scales are as wrong as real ones."""
    return driven(0.03, -0.02, rounds=rounds, seed=seed)[0]


def lagging(lag_s: float, seed: int = 1, rounds: int = 2) -> list[Firing]:
    """Return a drive whose ranges lag behind their poses."""
    firings = drive(rounds, seed)
    times = STEP_S * np.arange(len(firings))
    poses = np.array([(one.pose.x, one.pose.y, one.pose.theta) for one in firings])
    at = np.column_stack([np.interp(times + lag_s, times, np.unwrap(column)) for column in poses.T])
    return [
        replace(one, robot_s=time_s, pose=Pose(*pose), ring_yaw=pose[2])
        for one, time_s, pose in zip(firings, times.tolist(), at.tolist(), strict=True)
    ]


@pytest.mark.compiled
@pytest.mark.parametrize("lag_s", [pytest.param(-0.3, marks=pytest.mark.soak), 0.1])
def test_the_lag_is_found(lag_s: float) -> None:
    found = lag_of(lagging(lag_s), RING)
    assert found.lag_s == pytest.approx(lag_s, abs=0.03)
    assert found.is_refuted


@pytest.mark.compiled
def test_no_lag_is_not_refuted() -> None:
    lag, firings = EchoLag(RING), lagging(0.0)
    for firing in firings:
        assert lag.follow(firing) is firing
        while lag.can_refine:
            lag.refine()
    assert lag.found().gain < 0.5 * LAG_REFUTED
    assert abs(lag.found().lag_s) < 0.03


@pytest.mark.compiled
def test_a_lag_that_the_robot_file_says_is_not_refuted() -> None:
    found = lag_of(lagging(0.2), RING.model_copy(update={"echo_lag_s": 0.2}))
    assert found.lag_s == pytest.approx(0.2, abs=0.03)
    assert not found.is_refuted


@pytest.mark.compiled
def test_a_snapshot_in_the_middle_of_a_comparison_goes_on_to_the_bit() -> None:
    lag, firings = EchoLag(RING), iter(lagging(0.2, rounds=1))
    while not lag.can_refine:
        lag.follow(next(firings))
    for _ in range(7):
        lag.refine()
    other = EchoLag(RING)
    put_back(other, snapshot_of(lag))
    other.drop_caches()
    for firing in firings:
        for one in (lag, other):
            one.follow(firing)
            for _ in range(3):
                if one.can_refine:
                    one.refine()
    assert lag.found() == other.found()
    assert lag.found().sigma_s < 1.0


def turning(rate: float) -> list[Firing]:
    """Return firings of a robot that turns on the spot, and hears nothing."""
    ranges = np.full(len(RING.mounts), np.inf)
    return [Firing(0.1 * k, Pose(1.0, 2.0, rate * 0.1 * k), rate * 0.1 * k, ranges) for k in range(20)]


@pytest.mark.parametrize("lag_s", [0.15, 0.05, -0.15])
def test_a_firing_is_entered_at_the_pose_from_which_it_was_heard(lag_s: float) -> None:
    lag = EchoLag(RING.model_copy(update={"echo_lag_s": lag_s}))
    *_, last = (lag.follow(firing) for firing in turning(1.0))
    assert last.robot_s == pytest.approx(1.9)
    assert (last.pose.x, last.pose.y) == pytest.approx((1.0, 2.0))
    assert last.ring_yaw == pytest.approx(1.9 - lag_s)
    assert last.pose.theta == pytest.approx(1.9 - lag_s)


@pytest.mark.covered
def test_a_robot_that_stands_does_not_fill_the_window() -> None:
    lag = EchoLag(RING)
    for k in range(3000):
        lag.follow(Firing(0.05 * k, Pose(0.0, 0.0, 0.0), 0.0, np.full(len(RING.mounts), 1.0)))
    assert not lag.can_refine
    assert lag.found().sigma_s == np.inf


def test_a_long_way_in_which_nothing_fires_ends_no_window() -> None:
    lag = EchoLag(RING)
    for k in range(1500):
        lag.follow(Firing(0.05 * k, Pose(0.01 * k, 0.0, 0.0), 0.0, np.full(len(RING.mounts), np.nan)))
    assert not lag.can_refine
