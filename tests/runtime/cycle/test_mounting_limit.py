"""Until the motion has shown how the ring is mounted, the robot is slow beside what may stand ahead."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose, Twist
from perception.ring_faults.monitor import RingMonitor
from perception.ring_faults.mounting import DOUBTED_NAT
from runtime.cycle.mounting_limit import ARM_DOUBTED, DOUBTED, MOUNTED, limit_by_mounting
from runtime.cycle.unheard_limit import CREEP_M_S

SETTINGS = load_settings("room", robot="denning")
COUNT = len(SETTINGS.ring.mounts)
CLEAR_M = SETTINGS.behaviors.arbiter.clearance_m
"""As the ring of this robot is its rim, also the range at which it must be slow."""
FAST = Twist(0.3, 0.5)


def heard(bearing_deg: float, range_m: float) -> RingMonitor:
    """Return the monitor of a ring that has heard one echo."""
    axes = [math.degrees(mount.angle_rad) - bearing_deg for mount in SETTINGS.ring.mounts]
    ranges, monitor = np.full(COUNT, math.inf), RingMonitor(SETTINGS.ring)
    ranges[int(np.argmin([abs(math.remainder(axis, 360.0)) for axis in axes]))] = range_m
    monitor.observe(Firing(0.0, Pose(1.0, 0.0, 0.0), 0.0, ranges))
    return monitor


def limited(monitor: RingMonitor, twist: Twist = FAST) -> tuple[Twist, str | None]:
    return limit_by_mounting(twist, None, Pose(1.0, 0.0, 0.0), monitor, SETTINGS)


@pytest.mark.parametrize("bearing_deg", [90.0, 180.0, -90.0])
def test_what_may_be_ahead_limits_the_speed_and_not_the_turn(bearing_deg: float) -> None:
    assert limited(heard(bearing_deg, 0.5 * CLEAR_M)) == (Twist(CREEP_M_S, FAST.w), MOUNTED)
    slow, why = limited(heard(bearing_deg, CLEAR_M + 0.05))
    assert CREEP_M_S < slow.v < FAST.v
    assert why == MOUNTED
    assert limited(heard(bearing_deg, CLEAR_M + 0.5)) == (FAST, None)


def test_on_the_way_back_what_may_be_behind_counts() -> None:
    back = Twist(-0.3, 0.0)
    assert limited(heard(0.0, 0.5 * CLEAR_M), back) == (Twist(-CREEP_M_S, 0.0), MOUNTED)
    assert limited(heard(180.0, 0.5 * CLEAR_M), back) == (back, None)


def test_a_ring_that_has_heard_nothing_limits_nothing() -> None:
    assert limited(heard(90.0, math.inf)) == (FAST, None)


def test_a_ring_that_seems_turned_drives_slowly_everywhere_and_one_that_does_not_as_usual() -> None:
    """Each sensor hears a surface of its own, square to it."""
    for turned, expected in ((0.0, (FAST, None)), (0.5 * math.pi, (Twist(CREEP_M_S, FAST.w), DOUBTED))):
        monitor, pose = RingMonitor(SETTINGS.ring), Pose(0.0, 0.0, 0.0)
        for k in range(40):
            pose = Pose(0.02 * k, 0.0, 0.0)
            axes = np.array([mount.angle_rad + turned for mount in SETTINGS.ring.mounts])
            ranges = 3.0 + 0.02 * np.arange(COUNT) - pose.x * np.cos(axes)
            monitor.observe(Firing(0.05 * k, pose, 0.0, ranges))
            if monitor.is_doubted:
                break
        assert limit_by_mounting(FAST, None, pose, monitor, SETTINGS) == expected


def test_a_reason_that_was_given_before_stays() -> None:
    assert limit_by_mounting(FAST, "why", Pose(1.0, 0.0, 0.0), heard(90.0, math.inf), SETTINGS) == (FAST, "why")


def test_a_sensor_on_a_servo_whose_arm_may_be_turned_limits_the_speed() -> None:
    settings = load_settings("room", robot="servo1")
    monitor, ranges = RingMonitor(settings.ring), np.full(len(settings.ring.mounts), math.nan)
    behind = int(np.argmax(np.abs([mount.angle_rad for mount in settings.ring.mounts])))
    ranges[behind] = 0.3
    monitor.observe(Firing(0.0, Pose(1.0, 0.0, 0.0), 0.0, ranges))
    twist, why = limit_by_mounting(FAST, None, Pose(1.0, 0.0, 0.0), monitor, settings)
    assert (twist.w, why) == (FAST.w, MOUNTED)
    assert twist.v < FAST.v
    monitor._ring["turned_nat"][0, 1] = DOUBTED_NAT
    _, why = limit_by_mounting(FAST, None, Pose(1.0, 0.0, 0.0), monitor, settings)
    assert why == ARM_DOUBTED
