"""Limits on a velocity that was decided on, whatever is driven: no-go lines and areas, and speed areas.

Zones lie in the map, where the run has one. While the robot does not know its place there, they cannot be kept. Then
the robot stands, or follows an operator's velocity slowly: the operator sees where it goes, and it may have to move
to find its place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from behaviors.missions.mission import Mission
from behaviors.move_to_goal import Goal
from behaviors.no_go import Zones, limited, no_go_at, speed_limit_m_s, with_no_go, zones_of
from behaviors.schema_registry import goal_of
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate
from config.mission_step import Frame
from config.places import PlacesConfig
from config.settings import Settings
from drivers.messages import Odometry, Pose, Twist
from perception.percept import Percept
from perception.pipeline import Perception
from runtime.cycle.drive_requests import DriveInput, DriveRequest, needs_map
from runtime.support.blind_sides import way_refusal

UNKNOWN_PLACE: Final = (
    "the no-go areas and speed limits cannot be kept, because the robot does not know its place in the map, so it "
    "stands: say where it is, teleoperate it slowly until it finds its place, or remove them"
)
UNKNOWN_PLACE_SLOW: Final = (
    "the no-go areas and speed limits are not kept, because the robot does not know its place in the map: it drives "
    "slowly until it knows; keep it out of them"
)
VOID: Final = (
    "the no-go areas and speed limits cannot be kept, because the robot's odometry has started anew and they lay in "
    "its frame: set or remove them again; until then it stands, or drives slowly by teleoperation"
)
CYCLES: Final = 2.0
"""A command is followed so many cycles after the one that it replaces, at most: one until it is sent, one until the
base has taken it."""


@dataclass(frozen=True, slots=True)
class ZoneLimits:
    """The zones in force, and where they lie."""

    zones: Zones
    frame: Pose | None
    """Their frame in odometry's; None while it is not known."""
    is_void: bool
    """Whether odometry has started anew since they were set in its frame."""

    def forbids(self, x: float, y: float, frame: Frame, zones_frame: Frame, radius_m: float) -> str | None:
        """Return which no-go zone a body of this radius (m) overlaps at a place of a frame, None if it does not.

        A place in another frame than that of the zones is not judged while theirs is not known.
        """
        if frame != zones_frame:
            if self.frame is None:
                return None
            place = self.frame.inverse().compose(Pose(x, y, 0.0))
            x, y = place.x, place.y
        return no_go_at(self.zones, x, y, radius_m)

    def seen(self, percept: Percept, drive_request: DriveRequest, radius_m: float) -> tuple[Percept, str | None]:
        """Return the percept with no-go lines as obstacles, and why the robot must stand, None if it may drive.

        `percept` is in odometry's frame; the body's radius in m.
        """
        if self.frame is not None:
            return with_no_go(percept, self.zones, self.frame, radius_m), None
        if isinstance(drive_request, Teleoperate):
            return percept, None
        return percept, VOID if self.is_void else UNKNOWN_PLACE

    def slowest_m_s(self, pose: Pose, radius_m: float) -> float:
        """Return the speed limit where a body of this radius (m) is, m/s; inf where none is in force.

        `pose` is in odometry's frame.
        """
        if self.frame is None:
            return math.inf
        here = self.frame.inverse().compose(pose)
        return speed_limit_m_s(self.zones, here.x, here.y, radius_m)

    def applied(
        self,
        asked: Twist,
        last: Twist,
        drive_request: DriveRequest,
        odometry: Odometry,
        age_s: float,
        settings: Settings,
    ) -> tuple[Twist, str | None]:
        """Return a velocity within the limits, and what the operator should know of them.

        Parameters
        ----------
        asked : Twist
            What was decided on.
        last : Twist
            The command of the cycle before.
        drive_request : DriveRequest
            What is driven.
        odometry : Odometry
            The newest.
        age_s : float
            Its age, s.
        settings : Settings
            The run's.
        """
        if self.frame is None:
            if drive_request == TELEOPERATION_ENDED:
                return asked, None
            slow = asked.at_most(settings.behaviors.arbiter.cautious_velocity_m_s)
            return slow, VOID if self.is_void else UNKNOWN_PLACE_SLOW
        here = self.frame.inverse().compose(odometry.pose)
        delay_s = CYCLES / settings.cycle.rate_hz + age_s
        twist, by = limited(asked, last, odometry.twist, here, self.zones, settings.body, delay_s)
        stands = by is not None and twist.v == 0.0 != asked.v
        return twist, f"{by} is in the way" if stands else None


def zone_limits(
    before: ZoneLimits | None, void: PlacesConfig | None, perception: Perception, settings: Settings
) -> ZoneLimits | None:
    """Return the limits of this cycle; None where the run has no zones.

    `before` are those of the cycle before; `void` are the places whose frame was lost when odometry started anew.
    """
    places = settings.places
    if not places.limits_drive:
        return None
    zones = before.zones if before is not None and before.zones.places is places else zones_of(places)
    if settings.places_frame == "map":
        return ZoneLimits(zones, perception.known_map_frame(), is_void=False)
    is_void = void is not None and void == places
    return ZoneLimits(zones, None if is_void else Pose(0.0, 0.0, 0.0), is_void)


def way_refused(
    asked: DriveInput, zones: ZoneLimits | None, odometry: Odometry | None, settings: Settings
) -> str | None:
    """Return why a goal or a mission leads where the robot must not or cannot drive; None if it does not.

    Without odometry, blind sides are not looked at.
    """
    blind = None
    if isinstance(asked, Mission):
        blind = way_refusal(settings, None)
    elif isinstance(asked, Goal) and odometry is not None and asked.frame == "odom":
        pose = odometry.pose
        blind = way_refusal(settings, math.atan2(asked.y - pose.y, asked.x - pose.x) - odometry.ring_yaw)
    return blind or goal_in_zone(asked, zones, settings)


def goal_in_zone(asked: DriveInput, zones: ZoneLimits | None, settings: Settings) -> str | None:
    """Return why a request cannot be carried out because a goal of it lies in a no-go area; None if none does.

    A mission's steps that say themselves where an unreachable goal leads are left to the drive.
    """
    if zones is None or zones.is_void:
        return None
    radius_m, frame = settings.body.radius_m, settings.places_frame
    if isinstance(asked, Goal):
        what = zones.forbids(asked.x, asked.y, asked.frame, frame, radius_m)
        return None if what is None else f"the goal lies in or beside {what}: set it elsewhere, or change the area"
    for step in asked.plan.step if isinstance(asked, Mission) else ():
        place = None if step.goal is None else goal_of(step.goal, settings.places, frame)
        if place is None or any(condition.when in {"unreachable", "stuck"} for condition in step.conditions):
            continue
        what = zones.forbids(place.x, place.y, place.frame, frame, radius_m)
        if what is not None:
            return (
                f"the goal of step {step.name} lies in or beside {what}: set it elsewhere, change the area, or give "
                "the step a condition `unreachable`"
            )
    return None


def zone_of_goal(goal: Goal, zones: ZoneLimits | None, settings: Settings) -> str | None:
    """Return the no-go zone in which a goal of odometry's frame lies, None if in none."""
    if zones is None:
        return None
    return zones.forbids(goal.x, goal.y, "odom", settings.places_frame, settings.body.radius_m)


def wants_map(drive_request: DriveRequest, settings: Settings) -> bool:
    """Return whether what is driven depends on the robot's place in the map."""
    if needs_map(drive_request):
        return True
    by_name = isinstance(drive_request, Mission) and bool(drive_request.plan.places())
    return by_name and settings.places_frame == "map"
