"""What every emulated robot does alike: time passes from event to event, and a line leads to the host."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

from drivers.emulator.body import Body
from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faults import Fault, Reboot, SuddenObject
from drivers.emulator.faulty_line import FaultyLine
from drivers.emulator.robot_device import GroundTruth
from drivers.emulator.scene import NOWHERE
from drivers.messages import Flags


class EventDevice(ABC):
    """An emulated robot whose protocol and events a family adds.

    Parameters
    ----------
    body
        The base in its scene.
    faults
        What goes wrong, and when.
    line
        The robot's end of the line.
    """

    def __init__(self, body: Body, faults: FaultSchedule, line: FaultyLine) -> None:
        self._body, self._faults, self._line = body, faults, line
        self._now_us = self._moved_us = 0
        self._next_event_us: int | None = None  # None once something may have changed it

    @property
    def truth(self) -> GroundTruth:
        """The true state at the last event."""
        body = self._body
        return GroundTruth(
            self._moved_us * 1e-6, body.pose, body.ring_yaw, body.twist, self.flags, body.contacts, body.contact_m_s
        )

    @property
    @abstractmethod
    def flags(self) -> Flags:
        """The base's status."""

    @property
    def plugged(self) -> bool:
        """False while the line is unplugged."""
        return self._line.plugged

    @property
    def dropped(self) -> int:
        """Number of frames that did not fit into the transmitter's queue."""
        return self._line.dropped

    def advance(self, to_s: float) -> bytes:
        """Simulate up to `to_s` seconds after the start and return the bytes that have left the robot by then."""
        to_us = round(to_s * 1e6)
        while (at_us := self._next_us() if self._next_event_us is None else self._next_event_us) <= to_us:
            self._now_us, self._next_event_us = at_us, None
            self._move()
            self._update_faults()
            if not self._faults.has(Reboot):
                self._handle_events()
        self._now_us, self._next_event_us = max(self._now_us, to_us), at_us
        self._line.collect(self._now_us)
        return self._line.take()

    def _hear(self, data: bytes) -> bytes:
        """Return what the robot receives of bytes from the host; none while it restarts."""
        if not data or self._faults.has(Reboot) or not (data := self._line.heard(data)):
            return b""
        self._next_event_us = None
        return data

    def _set_active(self, fault: Fault, *, on: bool) -> None:
        """Start or end a fault as far as all robots do so alike."""
        self._line.collect(self._now_us)
        self._faults.set_active(fault, on=on)
        if isinstance(fault, SuddenObject):
            pose, way = self._body.pose, self._body.pose.theta + math.radians(fault.bearing_deg)
            away_m = self._body.radius_m + fault.distance_m + fault.radius_m
            there = (pose.x + away_m * math.cos(way), pose.y + away_m * math.sin(way), fault.radius_m)
            number = self._faults.planned(SuddenObject).index(fault)
            self._body.set_object(number, there if on else NOWHERE)

    @abstractmethod
    def _next_us(self) -> int:
        """Return the time of the next event, µs."""

    @abstractmethod
    def _move(self) -> None:
        """Move the body up to the present event."""

    @abstractmethod
    def _update_faults(self) -> None:
        """Start and end faults."""

    @abstractmethod
    def _handle_events(self) -> None:
        """Do what is due now."""
