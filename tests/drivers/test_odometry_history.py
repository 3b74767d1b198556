"""The odometry history: lookup between samples, gaps, order and capacity."""

from __future__ import annotations

import pytest

from drivers.messages import Flags, Odometry, Pose, Twist
from drivers.odometry_history import OdometryHistory


def sample(t_s: float, x: float = 0.0, yaw: float = 0.0) -> Odometry:
    return Odometry(t_s, Pose(x, 0.0, 0.0), yaw, Twist(0.0, 0.0), Flags.NONE, 0)


def test_history_looks_up_between_samples() -> None:
    history = OdometryHistory(4)
    assert history.at(0.0, 1.0) is None
    for k in range(6):
        history.add(sample(0.5 * k, x=float(k), yaw=10.0 * k))
    assert len(history) == 4
    assert history.at(2.5, 1.0) == (Pose(5.0, 0.0, 0.0), 50.0)
    assert history.at(2.0, 1.0) == (Pose(4.0, 0.0, 0.0), 40.0)
    pose, yaw = history.at(1.125, 1.0) or (Pose(0, 0, 0), 0.0)
    assert (pose.x, yaw) == pytest.approx((2.25, 22.5))
    assert history.at(1.0, 1.0) == (Pose(2.0, 0.0, 0.0), 20.0)
    assert history.at(0.99, 1.0) is None, "older than the history"
    assert history.at(2.51, 1.0) is None, "newer than the history"


def test_history_does_not_bridge_a_gap_nor_go_back() -> None:
    history = OdometryHistory(8)
    history.add(sample(1.0))
    history.add(sample(0.5, x=9.0))
    assert history.newest == sample(1.0)
    history.add(sample(2.0, x=1.0))
    assert history.at(1.5, 0.9) is None
    assert history.at(1.0, 0.9) == (Pose(0.0, 0.0, 0.0), 0.0)
    assert history.at(1.5, 1.0) is not None
    history.clear()
    assert history.newest is None
