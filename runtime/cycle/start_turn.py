"""The turn on the spot before the first drive, in which each sensor looks where the others look.

Sensors that are wired by hand are exchanged, mounted backwards, or deaf, and a robot that drives straight ahead
learns that too late. In a turn it learns it at once (`perception.ring_faults.wiring`). A round body needs no room.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from behaviors.teleoperation import Teleoperate
from config.bounded import Coordinate
from config.settings import Settings
from drivers.firing_pattern import firing_pattern
from drivers.messages import Pose, Twist
from runtime.cycle.drive_requests import STANDSTILL, DriveRequest

TURNS: Final = "the robot turns once on the spot before its first drive, to see that its sensors agree"
LOOKS_APART: Final = 1.1
"""How far a sensor turns from one of its looks to the next, in beam half angles: almost twice in each direction, and
within 5 s for a ring of eight that fires two at a time."""


@dataclass(frozen=True, slots=True)
class StartTurn:
    """How far the robot has turned; immutable, as keyframes hold it."""

    is_over: bool = False
    turned_rad: Coordinate = 0.0
    yaw_rad: Coordinate | None = None
    """Direction of the robot in the cycle before, rad; None before the first one."""

    def apply(
        self,
        twist: Twist,
        why: str | None,
        pose: Pose,
        request: DriveRequest,
        settings: Settings,
        judge: Callable[[], bool],
    ) -> tuple[StartTurn, Twist, str | None]:
        """Return the turn after a cycle, the velocity, and why it is another one than was decided.

        Parameters
        ----------
        twist, why
            What was decided on, and why it is slow, if it is. The turn begins once the robot is to move.
        pose
            The robot's by its odometry.
        request
            What is driven; an operator at the stick turns as they like.
        settings
            The base, the ring and its pattern.
        judge
            Called at the turn's end, to test what the sensors heard in it; returns whether they agree. If not, the
            robot stops, and turns again once it is re-armed.
        """
        body = settings.body
        if self.is_over or not body.turns_at_start or body.synchro or isinstance(request, Teleoperate):
            return self, twist, why
        if self.yaw_rad is None and twist == STANDSTILL:
            return self, twist, why
        step_rad = 0.0 if self.yaw_rad is None else abs(math.remainder(pose.theta - self.yaw_rad, math.tau))
        turned = replace(self, turned_rad=self.turned_rad + step_rad, yaw_rad=pose.theta)
        if turned.turned_rad >= math.tau:
            return StartTurn(is_over=judge()), STANDSTILL, TURNS
        half_angle = math.radians(settings.ring.beam_half_angle_deg)
        rate = min(body.turn_max_rad_s, LOOKS_APART * half_angle / firing_pattern(settings.ring).cycle_s)
        return turned, Twist(0.0, rate), why or TURNS
