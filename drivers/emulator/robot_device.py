"""The interface between an emulated robot of any family and the transports: a sans-I/O object with its protocol."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from drivers.emulator.latency_trace import FrameCounter
from drivers.messages import Flags, Pose, Twist


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """The true state of an emulated robot, which the robot itself does not know.

    Attributes
    ----------
    emulated_s
        Seconds since the emulator's start, through reboots.
    pose, ring_yaw
        In world coordinates, metres and radians; angles are unwrapped.
    twist
        The wheels' velocity.
    flags
        What the base reports.
    contacts, contact_m_s
        How often the rim has touched a surface, and the greatest speed at which it did.
    """

    emulated_s: float
    pose: Pose
    ring_yaw: float
    twist: Twist
    flags: Flags
    contacts: int
    contact_m_s: float = 0.0


class RobotDevice(Protocol):
    """The robot's end of a line, emulated. It never waits and reads no clock: `advance` is how its time passes."""

    @property
    def truth(self) -> GroundTruth:
        """The true state at the last event."""

    @property
    def plugged(self) -> bool:
        """False while the line is unplugged; the transport then closes the line."""

    def advance(self, to_s: float) -> bytes:
        """Simulate up to `to_s` seconds after the start and return the bytes that have left the robot by then."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the host, at the time to which the robot has advanced."""

    def frame_counter(self) -> FrameCounter:
        """Return a new counter of this protocol's echoes and drive commands, for a line that is in use already."""
