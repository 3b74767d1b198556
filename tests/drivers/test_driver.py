"""What every shipped driver does before its robot has answered, and the errors and states of the protocol."""

from __future__ import annotations

import math

import pytest

from config.errors import WRONG_CALL
from config.robot import DriverConfig
from drivers import registry
from drivers.driver import DriverError, LineState, Received, RobotDriver
from drivers.messages import LinkCounts, Pose, Twist
from tests.drivers.driver_harness import CONFIG


@pytest.fixture(params=sorted(registry.SHIPPED))
def driver(request: pytest.FixtureRequest) -> RobotDriver:
    config = CONFIG.model_copy(update={"robot": DriverConfig(driver=request.param)})
    return registry.make_driver(config)


def test_a_new_driver_is_closed_and_silent(driver: RobotDriver) -> None:
    assert driver.state is LineState.CLOSED
    assert driver.outgoing(writable=True) == b""
    assert (driver.identity, driver.problem, driver.counts) == (None, None, LinkCounts())
    assert driver.odometry_origin == Pose(0.0, 0.0, 0.0)
    assert driver.firings_waiting == 0
    assert driver.take_received() == Received((), None, rebooted=False)


def test_an_open_line_starts_the_handshake_and_survives_any_bytes(driver: RobotDriver) -> None:
    states = [driver.state]
    driver.line_opened(0.0)
    states.append(driver.state)
    assert driver.outgoing(writable=True)
    driver.receive(bytes(range(256)), 0.01)
    driver.drive(Twist(0.1, 0.0))
    assert driver.take_received().odometry is None
    driver.line_closed()
    assert [*states, driver.state] == [LineState.CLOSED, LineState.HANDSHAKE, LineState.CLOSED]


def test_a_halt_is_kept_for_the_next_line_and_a_drive_is_not(driver: RobotDriver) -> None:
    driver.line_opened(0.0)
    greeting = driver.outgoing(writable=True)
    driver.line_closed()
    driver.drive(Twist(0.1, 0.0))
    driver.halt()
    driver.line_opened(1.0)
    with_halt = driver.outgoing(writable=True)
    assert len(with_halt) > len(greeting)


@pytest.mark.parametrize("twist", [Twist(math.nan, 0.0), Twist(0.0, math.inf)])
def test_a_velocity_that_is_not_finite_is_refused(driver: RobotDriver, twist: Twist) -> None:
    with pytest.raises(ValueError, match="finite"):
        driver.drive(twist)


def test_a_missing_driver_is_an_error_of_the_call() -> None:
    assert DriverError("no such driver").exit_code == WRONG_CALL
