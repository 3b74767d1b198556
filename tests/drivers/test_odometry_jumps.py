"""Jumps of the odometry: what is one, how it is removed, and which frame the poses are in afterwards."""

from __future__ import annotations

import math

import pytest

from config.robot import BodyConfig
from drivers.messages import Flags, Odometry, Pose, Twist
from drivers.odometry_jumps import OdometryJumps

BODY = BodyConfig(radius_m=0.3, speed_max_m_s=0.5, turn_max_rad_s=1.0)


def sample(t: float, x: float, y: float = 0.0, theta: float = 0.0, v: float = 0.0) -> Odometry:
    return Odometry(t, Pose(x, y, theta), theta, Twist(v, 0.0), Flags.NONE, 0)


def steady(jumps: OdometryJumps, x: float = 0.0, count: int = 11) -> float:
    for k in range(count):
        _, note = jumps.remove(sample(0.1 * k, x))
        assert note is None
    return 0.1 * (count - 1)


def test_a_jump_is_removed_and_moves_the_origin() -> None:
    jumps = OdometryJumps(BODY)
    t = steady(jumps)
    here, note = jumps.remove(sample(t + 0.1, 2.0, 1.0, math.pi / 2))
    assert note is not None
    assert "the odometry jumped by 2.24 m and +90 degrees" in note
    assert here.pose == Pose(0.0, 0.0, 0.0)
    assert jumps.count == 1
    on, note = jumps.remove(sample(t + 0.2, 2.0, 1.03, math.pi / 2, v=0.3))
    assert note is None
    assert (on.pose.x, on.pose.y, on.pose.theta, on.ring_yaw) == pytest.approx((0.03, 0.0, 0.0, 0.0))
    back = jumps.origin.compose(on.pose)
    assert (back.x, back.y, back.theta) == pytest.approx((2.0, 1.03, math.pi / 2))


def test_motion_by_the_wheels_is_no_jump() -> None:
    jumps = OdometryJumps(BODY)
    for k in range(50):
        here, note = jumps.remove(sample(0.1 * k, 0.05 * k, v=0.5))
        assert note is None
        assert here.pose.x == pytest.approx(0.05 * k)


def test_a_base_that_moves_in_steps_moves_so_from_the_beginning() -> None:
    jumps = OdometryJumps(BODY)
    for k in range(20):
        assert jumps.remove(sample(0.1 * k, 0.3 * k))[1] is None
    assert jumps.count == 0


def test_a_reset_is_known_and_a_restart_forgets_all() -> None:
    jumps = OdometryJumps(BODY)
    assert not jumps.is_reset(sample(0.0, 9.0))
    t = steady(jumps, x=9.0)
    assert not jumps.is_reset(sample(t + 0.1, 7.0))
    assert jumps.is_reset(sample(t + 0.1, 0.0))
    jumps.remove(sample(t + 0.1, 0.0))
    assert jumps.origin.x == pytest.approx(-9.0)
    jumps.restart()
    assert jumps.origin == Pose(0.0, 0.0, 0.0)
    assert jumps.remove(sample(0.0, 1.0))[0].pose.x == 1.0
