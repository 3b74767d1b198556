"""Echoes and odometry of a Denning in virtual time: each firing at the pose of its own moment, nothing piled up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from config.robot import FiringConfig
from drivers.denning.codec import encode
from drivers.denning.frames import (
    Echo,
    RobotFrame,
)
from drivers.messages import LinkCounts, Pose
from tests.drivers.driver_harness import CONFIG, IDENT, ODOM, PERIOD_US, DriverHarness
from tests.drivers.vectors import OCTETS


def test_a_firing_has_the_pose_of_its_own_moment(harness: DriverHarness) -> None:
    # A quarter of a circle of radius 0.1 m around (0, 0.1); the ring does something else.
    for t_us, x, y, heading in ((0, 0, 0, 0), (PERIOD_US, 1000, 1000, 15708)):
        harness.odom(t_us, x_0p1mm=x, y_0p1mm=y, heading_1em4rad=heading, ring_yaw_1em4rad=2000 + t_us // 100)
    harness.send(Echo(0, PERIOD_US // 2, 0, 0x800021, (30, 255, 0)))
    (firing,) = harness.robot.take_received().firings
    assert firing.robot_s == pytest.approx(0.01)
    assert (firing.pose.x, firing.pose.y, firing.pose.theta) == pytest.approx(
        (0.1 * math.sqrt(0.5), 0.1 - 0.1 * math.sqrt(0.5), math.pi / 4), abs=1e-4
    )
    assert firing.ring_yaw == pytest.approx(0.21)
    assert firing.ranges_m.shape == (24,)
    assert firing.ranges_m[0] == pytest.approx(0.9144)
    assert math.isinf(firing.ranges_m[5])
    assert np.isnan(np.delete(firing.ranges_m, [0, 5])).all()


def test_an_echo_waits_for_the_odometry_after_it(harness: DriverHarness) -> None:
    harness.odom(0)
    harness.send(Echo(0, 10_000, 0, 1, (10,)), Echo(0, 30_000, 1, 1, (20,)))
    assert harness.robot.take_received().firings == ()
    harness.odom(PERIOD_US, x_0p1mm=100)
    (first,) = harness.robot.take_received().firings
    assert first.pose.x == pytest.approx(0.005)
    harness.odom(2 * PERIOD_US, x_0p1mm=300)
    (second,) = harness.robot.take_received().firings
    assert second.pose.x == pytest.approx(0.02)
    assert harness.robot.stamper.late_echoes.count == 0


def test_one_chunk_or_byte_by_byte_is_the_same(harness: DriverHarness) -> None:
    frames: list[RobotFrame] = [
        replace(ODOM, t_us=0),
        Echo(0, 10_000, 0, 1, (10,)),
        replace(ODOM, t_us=PERIOD_US, x_0p1mm=7),
        Echo(0, 15_000, 1, 2, (11,)),
    ]
    data = b"".join(encode(replace(frame, seq=2 + k)) for k, frame in enumerate(frames))
    other = DriverHarness()
    other.open()
    other.handshake()
    harness.robot.receive(data, harness.now)
    for i in range(len(data)):
        other.robot.receive(data[i : i + 1], other.now)
    whole, single = harness.robot.take_received(), other.robot.take_received()
    assert [(f.robot_s, f.pose, f.ring_yaw) for f in whole.firings] == [
        (f.robot_s, f.pose, f.ring_yaw) for f in single.firings
    ]
    assert len(whole.firings) == 2
    assert whole.odometry == single.odometry
    assert harness.robot.counts == other.robot.counts == LinkCounts(frames=6)


def test_an_echo_without_odometry_around_it_is_dropped_and_counted(harness: DriverHarness) -> None:
    harness.odom(1_000_000)
    harness.send(Echo(0, 990_000, 0, 1, (10,)))
    assert harness.robot.stamper.late_echoes.count == 1, "older than the history"
    harness.send(Echo(0, 1_040_000, 0, 1, (10,)))
    harness.odom(1_100_000)
    assert harness.robot.stamper.late_echoes.count == 2, "between two samples too far apart"
    harness.send(Echo(0, 1_100_000, 0, 1, (10,)), Echo(0, 1_090_000, 0, 1, (10,)), Echo(0, 9_000_000, 0, 1, (10,)))
    assert harness.robot.stamper.late_echoes.count == 4, "before the one before it, and from a far future"
    assert [f.robot_s for f in harness.robot.take_received().firings] == pytest.approx([1.1])


@pytest.mark.promise("P8")
def test_late_doubled_and_out_of_window_echoes_go_no_further(measured: Callable[[str], None]) -> None:
    """Every echo once more, once late, and ranges beyond the window in between."""
    window = 50
    near = CONFIG.ring.model_copy(
        update={"firing": FiringConfig(preset="octets", window_m=window * 0.03048, step_period_s=0.02)}
    )
    harness = DriverHarness(CONFIG.model_copy(update={"ring": near}))
    harness.open()
    harness.handshake()
    good: list[Echo] = []
    t_us = 0
    harness.odom(t_us)
    for k in range(200):
        t_us += PERIOD_US
        mask = OCTETS[k % 3]
        tenths = tuple(window + 1 + k if (i + k) % 4 == 0 else 255 if i % 3 else window - i for i in range(8))
        echo = Echo(0, t_us - 5_000, k % 3, mask, tuple(min(t, 254) if t != 255 else 255 for t in tenths))
        harness.now += 0.02
        harness.odom(t_us)
        harness.send(echo, echo)
        if good:
            harness.send(good[-1])
        good.append(echo)
    received = harness.robot.take_received()
    firings = received.firings
    assert [f.robot_s for f in firings] == pytest.approx([1e-6 * echo.t_us for echo in good])
    for what in ("firings", "ranges"):
        assert any(f"{what} were dropped so far" in note for note in received.notes), "the operator hears of it"
    for firing in firings:
        heard = firing.ranges_m[np.isfinite(firing.ranges_m)]
        assert (heard <= window * 0.03048 + 1e-9).all()
        assert heard.size + np.isinf(firing.ranges_m).sum() == 6, "the others are kept"
    assert harness.robot.stamper.late_echoes.count == 200 + 199
    assert harness.robot.stamper.out_of_window.count == (200 + 200 + 199) * 2
    measured(
        f"200 firings, each echo twice and once late, a quarter of the ranges beyond the window: {len(firings)} "
        f"firings and 0 such ranges came through"
    )


def test_a_wider_window_counts_from_the_pattern_on_and_a_narrower_one_after_it(harness: DriverHarness) -> None:
    t_us = harness.run(0.4, t_us=0)
    far = Echo(0, t_us - 5_000, 0, OCTETS[0], tuple(range(200, 208)))
    narrow = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="octets", window_m=2.0)})
    harness.robot.set_firing(narrow)
    harness.send(far)
    assert np.isfinite(harness.robot.take_received().firings[-1].ranges_m).sum() == 8, "an echo of the pattern before"
    t_us = harness.run(0.4, t_us=t_us)
    harness.send(replace(far, t_us=t_us - 5_000))
    assert np.isnan(harness.robot.take_received().firings[-1].ranges_m).all()


@pytest.mark.promise("P9")
@pytest.mark.parametrize(("x", "heading"), [(3048, 0), (-3048, 0), (50_000, 0), (0, 5000), (3048, -20_000)])
def test_a_leap_of_the_odometry_is_taken_out_and_reported(harness: DriverHarness, x: int, heading: int) -> None:
    """Poses go on as the wheels say; the robot's own odometry is `frame` away."""
    t_us = harness.run(0.4, t_us=0)
    harness.robot.take_received()
    for _ in range(2):  # one that leaps very far is asked who it is, and answers
        t_us += PERIOD_US
        harness.pass_time(0.02)
        harness.odom(t_us, x_0p1mm=x, heading_1em4rad=heading, ring_yaw_1em4rad=heading)
        harness.answer()
        harness.answer()
    heard = harness.robot.take_received()
    assert heard.odometry is not None
    assert heard.odometry.pose == Pose(0.0, 0.0, 0.0)
    assert heard.odometry.ring_yaw == 0.0
    (note,) = heard.notes
    assert "jumped" in note
    assert "check wheels" in note
    frame = harness.robot.odometry_origin
    assert (frame.x, frame.y, frame.theta) == pytest.approx((x * 1e-4, 0.0, heading * 1e-4))
    assert not heard.rebooted


def test_odometry_in_coarse_steps_is_not_taken_for_a_jump(harness: DriverHarness) -> None:
    """One whose odometry comes in steps, or that is faster than its file says, does not leap: it moves so."""
    t_us = 0
    for k in range(100):
        t_us += PERIOD_US
        harness.pass_time(0.02)
        harness.odom(t_us, x_0p1mm=2000 * (k // 3))
    heard = harness.robot.take_received()
    assert heard.odometry is not None
    assert heard.odometry.pose.x == pytest.approx(6.6)
    assert heard.notes == ()


def test_the_number_of_echoes_that_wait_for_odometry_is_bounded(harness: DriverHarness) -> None:
    harness.odom(0)
    for k in range(200):
        harness.send(Echo(0, 1000 + k, 0, 1, (10,)))
    assert harness.robot.stamper.late_echoes.count == 200 - 64
    harness.odom(PERIOD_US)
    assert len(harness.robot.take_received().firings) == 64


def test_echoes_of_sensors_beyond_the_ring_are_ignored() -> None:
    ring = CONFIG.ring.model_copy(update={"count": 16})
    harness = DriverHarness(CONFIG.model_copy(update={"ring": ring}))
    harness.ident = replace(IDENT, sensors=16)
    harness.open()
    harness.handshake()
    harness.odom(0)
    harness.send(Echo(0, 0, 0, 0x810000 | 1, (10, 11, 12)))
    (firing,) = harness.robot.take_received().firings
    assert firing.ranges_m.shape == (16,)
    assert np.nansum(firing.ranges_m) == pytest.approx(0.3048)


def test_the_number_of_firings_that_wait_is_bounded(harness: DriverHarness) -> None:
    for k in range(1100):
        harness.odom(k * PERIOD_US)
        harness.send(Echo(0, k * PERIOD_US, 0, 1, (10,)))
        harness.now += 0.02
    firings = harness.robot.take_received().firings
    assert len(firings) == 1024
    assert firings[-1].robot_s == pytest.approx(1099 * 0.02)
