"""What every emulated robot does alike: time passes from event to event, and a line leads to the host."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.body import Body
from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faults import Fault, OdometryError, Reboot, SuddenObject
from drivers.emulator.faulty_line import FaultyLine
from drivers.emulator.robot_device import GroundTruth
from drivers.emulator.scene import NOWHERE, compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Flags, Pose


class EventDevice(ABC):
    """An emulated robot whose protocol and events a family adds.

    Parameters
    ----------
    robot, world
        What the robot is, and what surrounds it.
    faults
        What goes wrong, and when.
    baud
        The line's speed.
    sonar_rng, drift_rng, line_rngs
        Random numbers of the echoes, of the odometry, and of the line.
    """

    def __init__(
        self,
        robot: RobotConfig,
        world: WorldConfig,
        faults: Sequence[Fault],
        baud: int,
        sonar_rng: np.random.Generator,
        drift_rng: np.random.Generator,
        line_rngs: Sequence[np.random.Generator],
    ) -> None:
        self._faults = schedule = FaultSchedule(faults)
        self._scene = scene = compile_scene(world, later=len(schedule.planned(SuddenObject)))
        start = Pose(world.start.x_m, world.start.y_m, math.radians(world.start.heading_deg))
        self._body = Body(robot.body, scene, start, world.odometry, drift_rng)
        self._true_sonar = Sonar(robot.ring, scene, world.acoustics, sonar_rng)
        self._line = FaultyLine(baud, schedule, *line_rngs)
        self._now_us = self._moved_us = 0
        """The present, and the time up to which the body has been moved."""
        self._next_event_us: int | None = None  # None once something may have changed it
        # Load the compiled kernels now, so that the first firing is not late.
        clearance(start.x, start.y, scene.circles, scene.segments)
        self._true_sonar.true_echoes(start, start.theta, np.zeros(len(robot.ring.mounts), dtype=np.bool_))

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
        """Return what the robot receives of bytes from the host, and plan anew; none while it restarts."""
        if not data or self._faults.has(Reboot) or not (data := self._line.heard(data)):
            return b""
        self._next_event_us = None
        return data

    def _set_active(self, fault: Fault, *, on: bool) -> None:
        """Start or end a fault as far as all robots do so alike."""
        self._line.collect(self._now_us)
        self._faults.set_active(fault, on=on)
        self._body.odometry_factor = math.prod(error.factor for error in self._faults.all(OdometryError))
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

    def _update_faults(self) -> None:
        """Start and end the faults whose time has come."""
        if self._faults.next_us is None:
            return
        for begins, fault in self._faults.due(self._now_us):
            self._set_active(fault, on=begins)
            if begins:
                self._start_fault(fault)
            elif isinstance(fault, Reboot) and not self._faults.has(Reboot):
                self._restart()

    @abstractmethod
    def _start_fault(self, fault: Fault) -> None:
        """Do what a fault does as it begins."""

    @abstractmethod
    def _restart(self) -> None:
        """Start as a robot does that has been off."""

    @abstractmethod
    def _handle_events(self) -> None:
        """Do what is due now."""
