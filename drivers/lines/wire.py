"""The lines of one robot: what a package for such a robot writes, beside its robot file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol, TypeAlias

from drivers.firing_pattern import FiringPattern
from drivers.messages import Flags, Pose, Twist


@dataclass(frozen=True, slots=True)
class Sample:
    """A line of the robot's odometry."""

    pose: Pose
    twist: Twist
    robot_s: float | None = None
    """By the robot's clock, s; None for a robot that gives no times."""
    flags: Flags = Flags.NONE


@dataclass(frozen=True, slots=True)
class Ranges:
    """A line of ranges that were measured together."""

    ranges_m: Mapping[int, float]
    """By the sensors' numbers, m; inf for no echo."""
    robot_s: float | None = None
    """As of a sample."""


Said: TypeAlias = Sample | Ranges
Asked: TypeAlias = Twist | FiringPattern


NOISE: Final = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""What reading a line may raise that is none."""


class Wire(Protocol):
    """Both ends' lines, each as bytes with its end. The functions are pure; for noise they raise one of `NOISE`."""

    name: str
    """What the robot is called."""
    deadman_s: float | None
    """Time without a velocity after which the base stops by itself, s; None if it never does."""
    period_s: float
    """Time from one sample of its odometry to the next, s."""

    def velocity(self, twist: Twist) -> bytes:
        """Return the line that asks for a velocity; of nothing, it stops the base."""

    def pattern(self, pattern: FiringPattern) -> bytes:
        """Return the line that sets the firing pattern; empty for a robot that fires by a pattern of its own."""

    def read(self, line: bytes) -> Said:
        """Return what a line of the robot says."""

    def heard(self, line: bytes) -> Asked:
        """Return what a line of this program asks of the emulated robot."""

    def say(self, said: Said) -> bytes:
        """Return the line in which the emulated robot says this."""


class LineReader:
    """Takes bytes in any pieces and returns whole lines; never raises, keeps at most one line."""

    LINE_MAX = 2000
    """Longest line, bytes; a longer one is noise."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the lines that `data` completes, without their ends."""
        *ended, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > self.LINE_MAX:
            self._rest = self._rest[-1:]
        return [line for line in ended if line.strip()]
