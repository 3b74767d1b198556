"""Conversion between SI and the protocol's units: patterns, velocities, odometry and echo bytes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.robot import FiringConfig, RingConfig
from drivers.denning.frames import Drive, Echo, Odom
from drivers.denning.wire_units import echo_byte, identity_of, odometry_of, ranges_of, to_wire, wire_pattern
from drivers.firing_pattern import FiringError
from drivers.messages import Flags, Identity, Pose, Twist
from drivers.servo_views import ServoViews
from tests.drivers.driver_harness import CONFIG, IDENT, DriverHarness
from tests.drivers.ring import RING
from tests.drivers.vectors import OCTETS


def ring_of(firing: FiringConfig, count: int = 24, range_max_m: float = 7.7724) -> RingConfig:
    return RING.model_copy(update={"firing": firing, "count": count, "range_max_m": range_max_m})


@pytest.mark.parametrize(
    ("firing", "count", "range_max_m", "text"),
    [
        (FiringConfig(preset="single"), 25, 7.7, "25 sensors, and this robot's protocol supports at most 24"),
        (FiringConfig(sets=((0,), (1,)), rotations=13), 24, 7.7, "26 firings .* holds 24"),
        (FiringConfig(preset="octets", step_period_s=0.1), 24, 8.0, "listens for 0.1524 to 7.7724"),
        (FiringConfig(preset="octets", window_m=0.15), 24, 7.7, "listens for 0.1524 to 7.7724"),
    ],
)
def test_a_pattern_that_the_protocol_cannot_express_is_refused(
    firing: FiringConfig, count: int, range_max_m: float, text: str
) -> None:
    with pytest.raises(FiringError, match=text):
        wire_pattern(ring_of(firing, count, range_max_m))


def test_rounding_does_not_exceed_a_limit_on_the_wire() -> None:
    body = CONFIG.body.model_copy(update={"speed_max_m_s": 0.3057, "turn_max_rad_s": 40.0})
    harness = DriverHarness(CONFIG.model_copy(update={"body": body}))
    harness.open()
    harness.handshake()
    harness.robot.drive(Twist(0.3057, 39.0))
    (drive,) = harness.received()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (305, 32767)


def test_odometry_in_si(harness: DriverHarness) -> None:
    harness.odom(
        1_000_000,
        x_0p1mm=12345,
        y_0p1mm=-6789,
        heading_1em4rad=70000,
        ring_yaw_1em4rad=-100,
        v_mm_s=305,
        w_mrad_s=-250,
        flags=0b11001,
        last_drive_seq=9,
    )
    odometry = harness.robot.take_received().odometry
    assert odometry is not None
    assert odometry.robot_s == pytest.approx(1.0)
    assert (odometry.pose.x, odometry.pose.y, odometry.pose.theta) == pytest.approx((1.2345, -0.6789, 7.0))
    assert (odometry.ring_yaw, odometry.twist.v, odometry.twist.w) == pytest.approx((-0.01, 0.305, -0.25))
    assert odometry.flags == Flags.LATCHED | Flags.DEADMAN | Flags.BATTERY_LOW
    assert odometry.last_drive_seq == 9
    assert harness.robot.take_received().odometry is None


def test_a_step_is_rounded_up_and_a_window_down() -> None:
    firing = FiringConfig(preset="octets", step_period_s=0.0201, window_m=0.03048 * 50.9)
    assert wire_pattern(ring_of(firing)) == (21, 50, OCTETS)


def test_velocities_are_thousandths_within_the_limit() -> None:
    assert to_wire(0.3054, 0.6) == 305
    assert to_wire(-0.25, 1.0) == -250
    assert to_wire(1e308, 0.6) == 600
    assert to_wire(-1e308, 0.6) == -600
    assert to_wire(40.0, 40.0) == 32767


def test_an_identity_in_si() -> None:
    traits = (
        ("deadman", "500 ms"), ("period of odometry", "20 ms"), ("version of the protocol", "1"),
        ("steps of the ranges", "0.03048 m"), ("capabilities", "0"),
    )  # fmt: skip
    assert identity_of(IDENT) == Identity("denning", 24, 381 * 1e-3, 0.5, 0.02, 0xB001, traits)


def test_flags_that_are_not_known_are_dropped() -> None:
    odometry = odometry_of(Odom(0, 0, 10_000, 0, 0, 0, 0, 0, 0xE1, 7), 3_000_000)
    assert (odometry.robot_s, odometry.pose, odometry.twist) == (3.0, Pose(1.0, 0.0, 0.0), Twist(0.0, 0.0))
    assert (odometry.flags, odometry.last_drive_seq) == (Flags.LATCHED, 7)


def test_ranges_of_an_echo() -> None:
    ranges = ranges_of(
        Echo(0, 0, 0, 0b10111, (100, 255, 0, 50)), ServoViews(ring_of(FiringConfig(preset="single"), 4))
    )
    assert ranges[0] == pytest.approx(3.048)
    assert math.isinf(ranges[1])
    assert np.isnan(ranges[2:]).all(), "a fault, and a sensor that did not fire; bit 4 is beyond the ring"


def test_echo_bytes() -> None:
    assert [echo_byte(r) for r in (None, math.inf, 0.0, 0.1524, 1.0, 7.74, 99.0)] == [0, 255, 5, 5, 33, 254, 255]
