"""What the runtime asks of any robot's driver: a sans-I/O object between the line's bytes and messages.

The runtime moves bytes between a line and a driver, and tells it the time; the driver never waits, reads a clock
or touches a port. So the same driver runs on a serial port, on the emulator's pty, and in virtual time in memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from config.errors import WRONG_CALL, UserError
from config.robot import RingConfig
from drivers.messages import Firing, Identity, LinkCounts, Odometry, Pose, Twist


class DriverError(UserError):
    """The robot file asks for a driver, or of a driver, what is not available: what happened and what would work."""

    exit_code = WRONG_CALL


class LineState(Enum):
    """How far the conversation with the robot has come."""

    CLOSED = "closed"
    """No line is open."""
    HANDSHAKE = "handshake"
    """The line is open; the robot has not yet identified itself and taken the firing pattern."""
    READY = "ready"
    """The robot answers, fires, and takes commands."""
    DOWN = "down"
    """The line is open and the robot does not answer; `RobotDriver.problem` says more."""


@dataclass(frozen=True, slots=True)
class Received:
    """Everything that arrived since it was last taken, in order."""

    firings: tuple[Firing, ...]
    odometry: Odometry | None
    """The newest one, None where none came."""
    rebooted: bool
    """The robot restarted: its clock and odometry began again at zero."""
    notes: tuple[str, ...] = ()
    """What an operator should know of it: what happened, likely cause, next action."""


class RobotDriver(Protocol):
    """A robot on the other end of a line. Times are the host's, in seconds, never decreasing."""

    @property
    def state(self) -> LineState:
        """How far the conversation has come."""

    @property
    def problem(self) -> str | None:
        """Why the state is DOWN or GREETING longer than it should be: what happened, likely cause, next action."""

    @property
    def identity(self) -> Identity | None:
        """What the robot said of itself, None until it has."""

    @property
    def counts(self) -> LinkCounts:
        """Frames over the line so far."""

    @property
    def odometry_origin(self) -> Pose:
        """The origin of the poses handed up, in the robot's own odometry: another one since that has leapt."""

    @property
    def firings_waiting(self) -> int:
        """Firings that `take` has ready."""

    def line_opened(self, run_s: float) -> None:
        """Begin (again) on a line just opened: greet the robot and set its firing pattern."""

    def line_closed(self) -> None:
        """Forget what was under way: the line is gone."""

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, any chunking."""

    def tick(self, run_s: float) -> None:
        """Let time pass: commands unanswered are sent again, silence becomes DOWN."""

    def drive(self, twist: Twist) -> None:
        """Ask for a velocity; replaces one that is not yet on the line."""

    def halt(self) -> None:
        """Stop at once and latch; goes before everything else, drops a DRIVE not yet on the line."""

    def release(self) -> None:
        """Clear the latch, so that DRIVE is obeyed again."""

    def set_firing(self, ring: RingConfig) -> None:
        """Fire the pattern of this ring from now on; nothing happens where it is the one under way."""

    def outgoing(self, *, writable: bool) -> bytes:
        """Return what should go on the line now; only HALT while the line is not `writable`."""

    def take_received(self) -> Received:
        """Return and forget what arrived since the last call."""
