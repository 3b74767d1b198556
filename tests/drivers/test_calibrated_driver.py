"""A driver around another one, whose robot's odometry and ranges are wrong by known scales."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.load import load_robot
from config.robot import BodyConfig, CalibrationConfig
from config.world import OdometryConfig, WorldConfig
from drivers.calibrated_driver import CalibratedDriver
from drivers.driver import LineState, Received
from drivers.emulator.body import Body
from drivers.emulator.scene import compile_scene
from drivers.messages import CrossPaths, Firing, Flags, Odometry, Pose, Twist
from drivers.registry import make_device, make_driver

SCALES = CalibrationConfig(distance_scale=1.05, turn_scale=0.96, range_scale=1.02)


class Scripted:
    """A driver that gives what was put into it."""

    state = LineState.READY

    def __init__(self) -> None:
        self.next = Received((), None, rebooted=False)
        self.driven: list[Twist] = []

    def take_received(self) -> Received:
        return self.next

    def drive(self, twist: Twist) -> None:
        self.driven.append(twist)


STILL = Twist(0.0, 0.0)


def sample(pose: Pose, twist: Twist = STILL) -> Odometry:
    return Odometry(1.0, pose, pose.theta + 0.1, twist, Flags.NONE, 0)


def calibrated(*, synchro: bool = False) -> tuple[Scripted, CalibratedDriver]:
    scripted = Scripted()
    return scripted, CalibratedDriver(scripted, SCALES, synchro=synchro)  # type: ignore[arg-type]  # only what is used


@pytest.mark.parametrize("synchro", [False, True])
def test_the_corrected_path_is_the_true_one(synchro: bool) -> None:
    """The emulated base errs by the same scales; poses come 50 times a second, firings between them."""
    body = Body(
        BodyConfig(radius_m=0.2, speed_max_m_s=1.0, turn_max_rad_s=2.0, synchro=synchro),
        compile_scene(WorldConfig()),
        Pose(0.0, 0.0, 0.0),
        OdometryConfig(scale=1.05, turn_scale=0.96),
        np.random.default_rng(0),
    )
    scripted, driver = calibrated(synchro=synchro)
    scripted.next = Received((), replace(sample(body.odometry_pose), ring_yaw=0.0), rebooted=False)
    driver.take_received()
    for k in range(500):
        body.step(0.01, Twist(0.4, 1.0 if k % 100 < 60 else -0.7))
        ranges = np.array([1.02, math.inf, math.nan])
        heard = CrossPaths(np.array([0]), np.array([2]), np.array([2.04]))
        firing = Firing(0.01 * k, body.odometry_pose, body.odometry_ring_yaw, ranges, heard)
        body.step(0.01, Twist(0.4, 1.0))
        odometry = replace(sample(body.odometry_pose), ring_yaw=body.odometry_ring_yaw)
        scripted.next = Received((firing,), odometry, rebooted=False)
        true, received = body.pose, driver.take_received()
        assert received.odometry is not None
        found = received.odometry
        assert math.hypot(found.pose.x - true.x, found.pose.y - true.y) < 2e-3
        assert found.pose.theta == pytest.approx(true.theta, abs=1e-9)
        assert found.ring_yaw == pytest.approx(body.ring_yaw, abs=1e-9)
        near = received.firings[0]
        assert near.cross_paths is not None
        assert near.cross_paths.half_paths_m[0] == pytest.approx(2.0)
        assert math.hypot(near.pose.x - true.x, near.pose.y - true.y) < 0.01
        np.testing.assert_allclose(near.ranges_m, [1.0, math.inf, math.nan])


def test_velocities_are_true_ones() -> None:
    scripted, driver = calibrated()
    driver.drive(Twist(0.2, 0.5))
    assert scripted.driven == [Twist(0.2 * 1.05, 0.5 * 0.96)]
    scripted.next = Received((), sample(Pose(0.0, 0.0, 0.0), Twist(0.21, 0.48)), rebooted=False)
    odometry = driver.take_received().odometry
    assert odometry is not None
    assert (odometry.twist.v, odometry.twist.w) == pytest.approx((0.2, 0.5))


def test_after_a_restart_the_path_begins_where_the_odometry_does() -> None:
    scripted, driver = calibrated()
    for pose, rebooted in ((Pose(0.0, 0.0, 0.0), False), (Pose(1.05, 0.0, 0.0), False), (Pose(0.0, 0.0, 0.0), True)):
        scripted.next = Received((), sample(pose), rebooted=rebooted)
        odometry = driver.take_received().odometry
    assert odometry is not None
    assert odometry.pose == Pose(0.0, 0.0, 0.0)


def test_all_else_is_the_drivers() -> None:
    scripted, driver = calibrated()
    assert driver.state is LineState.READY
    scripted.next = Received((), None, rebooted=False, notes=("a note",))
    assert driver.take_received() == scripted.next


def test_the_registry_wraps_a_calibrated_robot_and_emulates_its_errors() -> None:
    config = load_robot("denning")
    assert not isinstance(make_driver(config), CalibratedDriver)
    config = config.model_copy(update={"calibration": SCALES})
    assert isinstance(make_driver(config), CalibratedDriver)
    assert make_device(config, WorldConfig(), 1) is not None
