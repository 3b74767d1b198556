"""What a drive hands from one cycle to the next, as a whole, whatever is driven."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Final, NamedTuple

from behaviors.avoid_past import Trail
from behaviors.move_ahead import Leg
from config.bounded import Seconds
from config.mission import StepConfig
from config.settings import Settings
from drivers.messages import Pose
from runtime.cycle.drive_requests import DriveRequest, GoalPlace, Legs, ValidRequest
from runtime.cycle.goal_drive import GoalDrive
from runtime.cycle.stalled_drives import DriveMemory
from runtime.cycle.velocity_limits import ZoneLimits


@dataclass(frozen=True, slots=True)
class StepSettings:
    """The run's settings with the gains and times of a mission's step, and the two that they were made from."""

    step: StepConfig
    run: Settings
    settings: Settings


class Moment(NamedTuple):
    """When a cycle decides, and where the map and its zones are then."""

    run_s: float
    """Now, by the run's clock."""
    cycle_s: float = 0.0
    """Time since the cycle before, s."""
    map_frame: Pose | None = None
    """The map frame in odometry's, while a drive needs it and the robot's place there is known."""
    zones: ZoneLimits | None = None
    """A goal in a no-go zone is given up at once."""


@dataclass(slots=True, kw_only=True)
class DriveState:
    """What a drive carries over to the next cycle."""

    drive_request: ValidRequest = field(default_factory=Legs)
    """What is driven in DRIVE: a goal may have been reached, a velocity may have expired."""
    requested_run_s: Seconds = 0.0
    """When the operator requested that, by the run's clock."""
    leg: Leg | None = None
    """How far the current leg has come; None before it begins."""
    goal_place: GoalPlace | None = None
    """Where the goal lies in odometry's frame; None without a goal, or while its place is not known."""
    goal_drive: GoalDrive | None = None
    """The drive to a goal so far; None without a goal, or before its first cycle in DRIVE."""
    trail: Trail = ()
    """Where the robot has been since the drive request, if avoid-past is in use."""
    step_settings: StepSettings | None = None
    """Of the mission's step; None without one. They follow from mission and settings and are not recorded."""
    drive_memory: DriveMemory = field(default_factory=DriveMemory)
    """What the last cycle in DRIVE left, whatever is driven."""

    def after(
        self,
        drive_request: DriveRequest,
        leg: Leg,
        *,
        goal_drive: GoalDrive | None = None,
        trail: Trail = (),
        step_settings: StepSettings | None = None,
    ) -> DriveState:
        """Return the state after a cycle: what this kind of drive does not need is dropped."""
        return DriveState(
            drive_request=drive_request,
            requested_run_s=self.requested_run_s,
            leg=leg,
            goal_place=self.goal_place,
            goal_drive=goal_drive,
            trail=trail,
            step_settings=step_settings,
            drive_memory=self.drive_memory,
        )

    def take_over(self, after: DriveState) -> None:
        """Go on from the state that a cycle left."""
        for name in CARRIED_OVER:
            setattr(self, name, getattr(after, name))


CARRIED_OVER: Final = tuple(one.name for one in fields(DriveState))
