"""The Denning family as the registry sees it: a driver, and an emulated robot that answers it."""

from __future__ import annotations

from config.world import WorldConfig
from drivers.denning.family import make_device, make_driver
from drivers.driver import LineState
from tests.drivers.cable import ROBOT


def test_its_driver_and_its_emulated_robot_shake_hands() -> None:
    driver = make_driver(ROBOT)
    device = make_device(ROBOT, WorldConfig(), 3, faults=(), clock_start_us=10_000_000)
    driver.line_opened(0.0)
    for k in range(40):
        device.receive(driver.outgoing(writable=True))
        driver.receive(device.advance(0.01 * k), 0.01 * k)
    assert driver.state is LineState.READY
    assert driver.identity is not None
    assert driver.identity.sensors == len(ROBOT.ring.mounts)
    odometry = driver.take_received().odometry
    assert odometry is not None
    assert 10.3 < odometry.robot_s < 10.4, "its clock starts where it should"
