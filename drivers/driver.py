"""The protocol that every robot's driver fulfils: a sans-I/O object between the bytes of a line and messages.

The runtime moves bytes between a line and a driver, and gives the driver the time. A driver never waits, reads a
clock or opens a port. So the same driver runs on a serial port, on the emulator's pty, and in virtual time in memory.
`drivers.registry` describes how a package adds a driver.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Protocol

from config.bounded import CONSISTENT
from config.errors import WRONG_CALL, UserError
from config.robot import RingConfig
from drivers.messages import Firing, Flags, Identity, LinkCounts, Odometry, Pose, RecordedFlags, Twist


class DriverError(UserError):
    """The robot file names a driver or a feature that is not available; the text says what is."""

    exit_code = WRONG_CALL


class DriverPackageError(DriverError):
    """The driver that the robot file names is known, and its package cannot be imported here."""

    is_of_file = False


class LineState(Enum):
    """The state of the connection with the robot."""

    CLOSED = "closed"
    """No line is open."""
    HANDSHAKE = "handshake"
    """The line is open; the robot has not yet identified itself and accepted the firing pattern."""
    READY = "ready"
    """The robot answers, fires, and obeys commands."""
    DOWN = "down"
    """The line is open and the robot does not answer as it should; `RobotDriver.problem` says why."""


@dataclass(frozen=True, slots=True)
class Received:
    """What a driver received since the last call of `take_received`."""

    firings: tuple[Annotated[Firing, CONSISTENT], ...]
    """Oldest first; their times only grow, unless the robot restarted."""
    odometry: Odometry | None
    """The newest sample, None if there was none."""
    rebooted: bool
    """The robot restarted: its clock and odometry began again at zero. Nothing here is from before the restart."""
    notes: tuple[str, ...] = ()
    """Messages for the operator, one line each: what happened, likely cause, next action."""
    flags: RecordedFlags = Flags.NONE
    """Every flag that any sample of the odometry had, not only the newest: a contact may last for one sample."""


class RobotDriver(Protocol):
    """The host's end of the line to one robot.

    The runtime calls `line_opened` once the line is open and `line_closed` once it is lost. In between it calls
    `receive` when bytes arrive, `tick` at least once a cycle, and `outgoing` after anything that may have given the
    driver something to send. A run may open several lines one after the other; it has one driver.

    All times are readings of the run's clock, `run_s`, in seconds. They never decrease, and do not advance while
    an emulated run is paused. No method blocks, and none raises because of what the robot sends.
    """

    @property
    def state(self) -> LineState:
        """The state of the connection. Only READY lets the robot be driven."""

    @property
    def problem(self) -> str | None:
        """What is wrong, in one line: what happened, likely cause, next action. None if nothing is.

        There must be one in state DOWN. In other states it is a warning and does not stop the robot.
        """

    @property
    def identity(self) -> Identity | None:
        """The robot's description of itself; the last one known while it is connecting again, None before the first.

        Its `deadman_s` is how long two drive commands may be apart. A driver refuses a robot whose deadman is not
        within `link.deadman_min_s` and `link.deadman_max_s`: it goes DOWN, with the reason.
        """

    @property
    def battery_v(self) -> float | None:
        """The battery's voltage as last reported, V; None if the robot has not reported one, or never does."""

    @property
    def counts(self) -> LinkCounts:
        """Frames received so far, over all lines."""

    @property
    def odometry_origin(self) -> Pose:
        """The origin of the poses in `Received`, given in the robot's own odometry.

        It is the identity for a driver that passes the robot's odometry on as it is. A driver that takes out jumps of
        the odometry moves the origin instead, so that its poses stay continuous.
        """

    @property
    def line_baud(self) -> int | None:
        """The speed that the line must have for the next bytes, bits per second; None = `link.baud`.

        A line without a speed, as a socket, ignores it.
        """

    @property
    def firings_waiting(self) -> int:
        """Number of firings that `take_received` would return."""

    def line_opened(self, run_s: float) -> None:
        """Start the handshake on a line that has just been opened: identify the robot, set its firing pattern."""

    def line_closed(self) -> None:
        """Forget commands in progress: the line is lost. Keep a halt that was not acknowledged for the next line."""

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, split anywhere; never raises, whatever they are."""

    def tick(self, run_s: float) -> None:
        """Let time pass: send unanswered commands again, and go DOWN if the robot is silent for too long."""

    def drive(self, twist: Twist) -> None:
        """Request a velocity; it replaces one that has not been sent yet, and is dropped unless the state is READY.

        Raises
        ------
        ValueError
            The velocity is not finite.
        """

    def halt(self) -> None:
        """Stop the robot at once and latch it, so that it ignores drive commands until `release`.

        A halt is sent before everything else, discards a drive command that has not been sent, and is repeated until
        the robot acknowledges it.
        """

    def release(self) -> None:
        """Clear the latch, so that drive commands are obeyed again; without effect unless the state is READY."""

    def set_firing(self, ring: RingConfig) -> None:
        """Change the firing pattern to that of `ring`; does nothing if it is the current one.

        Raises
        ------
        drivers.firing_pattern.FiringError
            The robot or its protocol cannot carry out the pattern; the current one stays.
        """

    def end_session(self) -> None:
        """End the session at the end of a run: what `outgoing` then returns is the last to be sent."""

    def outgoing(self, *, writable: bool) -> bytes:
        """Return the bytes to send now, and consider them sent.

        A run asks in each cycle, and again 10 ms after it got some.

        Where the line still holds earlier bytes (not `writable`) only a halt may be returned, so that no drive
        command is sent late.
        """

    def take_received(self) -> Received:
        """Return what was received since the last call, and remove it."""
