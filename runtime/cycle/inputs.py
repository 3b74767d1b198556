"""The inputs of one cycle: all that arrived from the robot, the operator and the process since the last one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from config.bounded import Seconds
from drivers.driver import LineState, Received, RobotDriver
from perception.edits import Edit
from runtime.cycle.drive_requests import DriveInput
from runtime.cycle.line_messages import ROBOT_LINE, LineMessages

GAP_SHARE: Final = 0.9
"""Largest time between two commands as a share of the base's deadman, which stops a base that waits longer."""

GAP_MAX_S: Final = GAP_SHARE * 0.5
"""That time, s, for the protocol's usual deadman of 0.5 s, until the robot reports its own."""

GAP_LIMIT_S: Final = 0.5
"""Largest time between two commands, s, however long a deadman the robot reports: in a longer gap it drives more than
a hand's breadth on data that are out of date."""


class Request(Enum):
    """A change of mode that an operator asks for."""

    ARM = "arm"
    HALT = "halt"
    DISARM = "disarm"
    """From DRIVE back to READY: the robot stops, without the base's latch, and waits to be armed."""


def always_valid() -> bool:
    """Return True: a request that no sender or stop can void, as from a signal or a key of the terminal."""
    return True


@dataclass(frozen=True, slots=True)
class Inputs:
    """The inputs of the cycle that begins at `run_s` of the run's clock."""

    run_s: Seconds
    line: LineState
    line_problem: str | None
    """Why the line is not READY, where the driver knows."""
    received: Received
    """Echoes and odometry that arrived."""
    request: Request | None = None
    gap_max_s: Seconds = GAP_MAX_S
    """Largest time between two commands that the base's deadman allows."""
    echo_age_s: Seconds | None = None
    """How long the oldest of the firings has waited for this cycle; None without a firing and in virtual time."""
    overrun: str | None = None
    """Why the cycle can no longer keep its period; None while it can."""
    fault: str | None = None
    """Which part of the program has failed; None while all work."""
    drive_request: DriveInput | None = None
    """The new drive request, or a change of the mission in force; None keeps the one in force."""
    edits: tuple[Edit, ...] = ()
    """The operator's edits of the map, in this order."""
    host_s: Seconds | None = None
    """The same moment by the host's clock; None in virtual time. For the record only: no decision depends on it."""
    preparing: str | None = None
    """How far the preparation of recognition is; None from the cycle on in which recognition begins."""


@dataclass(frozen=True, slots=True)
class OperatorInput:
    """What an operator requests in a cycle."""

    request: Request | None = None
    drive_request: DriveInput | None = None
    edits: tuple[Edit, ...] = ()


def gather_inputs(
    driver: RobotDriver,
    run_s: float,
    operator: OperatorInput,
    *,
    echo_age_s: float | None = None,
    overrun: str | None = None,
    fault: str | None = None,
    host_s: float | None = None,
    preparing: str | None = None,
    line_messages: LineMessages = ROBOT_LINE,
) -> Inputs:
    """Return the inputs of a cycle, among them everything that the driver has received.

    Parameters
    ----------
    driver : RobotDriver
        Gives up what it has received since the last cycle.
    run_s, host_s : float
        The cycle's beginning by the run's clock and by the host's; virtual time has only the former.
    operator : OperatorInput
        What the operator requests.
    echo_age_s : float, optional
        How long the oldest of the firings has waited.
    overrun, fault : str, optional
        Why the robot must not drive.
    preparing : str, optional
        How far the preparation of recognition is.
    line_messages : LineMessages
        Words the driver's messages for what is at the other end of the line.
    """
    driver.tick(run_s)
    gap_max_s = command_gap_max_s(driver)
    line, received = driver.state, driver.take_received()
    line_problem = line_messages.problem(line, driver.problem)
    if received.notes:
        received = replace(received, notes=tuple(map(line_messages.message, received.notes)))
    return Inputs(
        run_s,
        line,
        line_problem,
        received,
        operator.request,
        gap_max_s,
        echo_age_s,
        overrun,
        fault,
        operator.drive_request,
        operator.edits,
        host_s,
        preparing,
    )


def command_gap_max_s(driver: RobotDriver) -> float:
    """Return the longest time between two commands that this program and the base's deadman allow, s."""
    identity = driver.identity
    return GAP_MAX_S if identity is None else min(GAP_SHARE * identity.deadman_s, GAP_LIMIT_S)
