"""What every driver keeps of its session with a robot: the line's state, the requested velocity, what came."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Final, Generic, TypeVar

from drivers.driver import LineState, Received
from drivers.heard_bytes import HeardBytes
from drivers.messages import Firing, Flags, Identity, LinkCounts, Odometry, Pose, Twist
from drivers.odometry_gaps import OdometryGaps
from drivers.stamper import Stamper

FIRINGS_MAX: Final = 1024
"""Firings kept if they are not taken; the oldest are dropped. At 20 firings a second this is almost a minute."""


S = TypeVar("S", bound=Stamper)


class Session(ABC, Generic[S]):
    """The part of a `drivers.driver.RobotDriver` that does not depend on the protocol; drivers are subclasses."""

    def __init__(self, stamper: S, silence_max_s: float = math.inf) -> None:
        self.stamper = stamper
        self._odometry_gaps = OdometryGaps(silence_max_s)
        self._state = LineState.CLOSED
        self._problem: str | Callable[[], str] | None = None
        """What is wrong; a function where that follows what is received."""
        self._identity: Identity | None = None
        self._earlier_counts = LinkCounts()
        """Frames of the lines before this one."""
        self._run_s = 0.0
        """The run's time of the last call that had one."""
        self._drive: Twist | None = None
        """The requested velocity, until it is sent; None without one."""
        self._firings: deque[Firing] = deque(maxlen=FIRINGS_MAX)
        """What `take_received` returns next …"""
        self._odometry: Odometry | None = None
        self._flags, self._rebooted = Flags.NONE, False
        self._noted = set[str]()
        """Messages of `_note_once` so far."""
        self.heard = HeardBytes()
        """The bytes of the line in place of the robot's frames."""
        self.is_other_robot = False
        """Whether what the robot says of itself is not what its file describes, so that another file may be its
        own."""

    @property
    def state(self) -> LineState:
        """The state of the connection; DOWN while odometry comes too rarely to keep it up."""
        return LineState.DOWN if self._rare is not None else self._state

    @property
    def problem(self) -> str | None:
        """What is wrong, in one line; None if nothing is."""
        if self._rare is not None:
            return self._rare
        return self._problem() if callable(self._problem) else self._problem

    @property
    def _rare(self) -> str | None:
        return None if self._state is LineState.CLOSED else self._odometry_gaps.problem(self._run_s)

    @property
    def identity(self) -> Identity | None:
        """The robot's description of itself; the last one known during a new handshake."""
        return self._identity

    @property
    def battery_v(self) -> float | None:
        """The battery's voltage as last reported, V; None if the robot reports none."""
        return None

    @property
    def counts(self) -> LinkCounts:
        """Frames received so far, over all lines."""
        earlier, now = self._earlier_counts, self._line_counts
        return LinkCounts(earlier.frames + now.frames, earlier.bad + now.bad, earlier.lost + now.lost)

    @property
    def line_baud(self) -> int | None:
        """The speed that the line must have now; None for that of the robot file."""
        return None

    @property
    def odometry_origin(self) -> Pose:
        """The origin of the poses passed on, in the robot's own odometry; it moves when that jumps."""
        return self.stamper.origin

    @property
    def firings_waiting(self) -> int:
        """Number of firings that `take_received` would return."""
        return len(self._firings)

    def drive(self, twist: Twist) -> None:
        """Request a velocity, in place of one that has not been sent; it is clamped to the limits when it is sent.

        It is dropped unless the robot may be driven then.

        Raises
        ------
        ValueError
            The velocity is not finite.
        """
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            raise ValueError(f"cannot drive at {twist}: a velocity must be finite; something divided by zero")
        self._drive = twist

    def line_opened(self, run_s: float) -> None:
        """Forget what came on an earlier line; a driver begins its handshake after that."""
        self.line_closed()
        self._odometry_gaps.begin()
        self.heard.clear()
        self.is_other_robot = False
        self._run_s = run_s

    @abstractmethod
    def line_closed(self) -> None:
        """Forget commands in progress, but those that must reach the robot on the next line."""

    def take_received(self) -> Received:
        """Return what was received since the last call, and remove it."""
        self._odometry_gaps.look(self._run_s, came=self._odometry is not None)
        received = Received(tuple(self._firings), self._odometry, self._rebooted, self.stamper.notes(), self._flags)
        self._firings.clear()
        self._odometry, self._flags, self._rebooted = None, Flags.NONE, False
        return received

    @property
    @abstractmethod
    def _line_counts(self) -> LinkCounts:
        """Frames received on the present line."""

    def _note_once(self, text: str) -> None:
        """Add a message for the operator, unless it has been added in this run."""
        if text not in self._noted:
            self._noted.add(text)
            self.stamper.note(text)

    def _forget_received(self) -> None:
        """Discard what was received, as the robot has restarted since."""
        self._firings.clear()
        self._odometry, self._flags, self._rebooted = None, Flags.NONE, True
