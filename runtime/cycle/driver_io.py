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
    run_s: float,
    request: Request | None,
    *,
    echo_age_s: float | None = None,
    overrun: str | None = None,
    fault: str | None = None,
    edits: tuple[Edit, ...] = (),
    drive_request: DriveRequest | None = None,
    host_s: float | None = None,
) -> Inputs:
    """Return everything that a cycle which begins at `run_s` takes in.

    Parameters
    ----------
    driver : RobotDriver
        Holds what arrived since the cycle before.
    run_s, host_s : float
        The cycle's beginning by the run's clock and by the host's; virtual time has only the former.
    request, drive_request, edits
        What the operator asks for.
    echo_age_s : float, optional
        How long the oldest of the firings has waited.
    overrun, fault : str, optional
        Why the robot must not drive.
    """
    driver.tick(run_s)
    gap_max_s = gap_max(driver)
    state, trouble, heard = driver.state, driver.problem, driver.take_received()
    return Inputs(
        run_s,
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
        host_s=host_s,
    )


def gap_max(driver: RobotDriver) -> float:
    """Return the longest time between two commands that the base's deadman allows, s."""
    identity = driver.identity
    return GAP_MAX_S if identity is None else GAP_SHARE * identity.deadman_s
