"""From a cycle's command to the robot's driver, the same on a serial line and in virtual time."""

from __future__ import annotations

from drivers.driver import RobotDriver
from drivers.messages import Twist
from perception.edits import Edit
from runtime.cycle.drive_requests import DriveRequest
from runtime.cycle.modes import GAP_MAX_S, GAP_SHARE, Request
from runtime.cycle.step import Command, Inputs, Order


def give(driver: RobotDriver, command: Command) -> None:
    """Hand `command` to the driver; None hands it nothing."""
    match command:
        case Twist():
            driver.drive(command)
        case Order.HALT:
            driver.halt()
        case Order.RELEASE:
            driver.release()


def gather(
    driver: RobotDriver,
    now_s: float,
    request: Request | None,
    *,
    echo_age_s: float | None = None,
    overrun: str | None = None,
    fault: str | None = None,
    edits: tuple[Edit, ...] = (),
    drive_request: DriveRequest | None = None,
) -> Inputs:
    """Return everything a cycle that begins at `now_s` is told."""
    driver.tick(now_s)
    gap_max_s = gap_max(driver)
    state, trouble, heard = driver.state, driver.trouble, driver.take()
    return Inputs(
        now_s,
        state,
        trouble,
        heard,
        request,
        gap_max_s,
        echo_age_s,
        overrun,
        fault,
        edits=edits,
        drive_request=drive_request,
    )


def gap_max(driver: RobotDriver) -> float:
    """Return the longest time between two commands that the base's deadman allows, s."""
    identity = driver.identity
    return GAP_MAX_S if identity is None else GAP_SHARE * identity.deadman_s
