"""Drives to a goal behind a box canyon, in virtual time: who escapes, who turns before it, and on which way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean
from typing import Final, TypedDict

from behaviors.move_to_goal import Goal
from config.settings import GoalConfig, Settings
from drivers.emulator.robot_device import GroundTruth
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.canyon_reception import IN_TIME_M, back_heard_m
from runtime.simulation.canyon_worlds import CanyonWorld
from runtime.simulation.closed_loop import simulate

TIME_MAX_S: Final = 300.0
STILL_S: Final = 45.0
"""Time after which a robot that gets nowhere is given up: within `STILL_M` of one place."""
STILL_M: Final = 0.3
ARRIVED_M: Final = 0.5
"""Greatest distance of the robot from the goal at the end, in truth; odometry errs by 1 %."""
LEFT_M: Final = 0.3
"""The robot has left the canyon again when it is this far before the mouth."""
ROOM_M: Final = 0.16
"""The shortest way keeps this between the robot's rim and the walls."""
DEEP_M: Final = 1.5
"""A robot should turn before a canyon deeper than this."""


@dataclass(frozen=True, slots=True)
class CanyonOutcome:
    """The end of one drive (m, s)."""

    depth_m: float
    width_m: float
    """Of the canyon."""
    arrived: bool
    """Whether the robot stood at its goal."""
    entries: int
    """How often its centre passed the mouth inwards."""
    deepest_m: float
    """How far it was behind the mouth at most; negative if it never was."""
    contacts: int
    """How often its rim touched a wall."""
    way_m: float
    shortest_m: float
    time_s: float
    """What it drove, the shortest way, and the time it took."""
    reported_m: float | None = None
    """Where the robot was along the axis when the canyon was first reported, negative before the mouth; None if it
    never was."""
    heard_m: float | None = None
    """How far before the mouth the back is first heard on the straight way; None if it is not."""


class CanyonRow(TypedDict):
    """The drives of one set of schemas."""

    schemas: str
    reflection: str
    worlds: int
    escaped: int
    deep: int
    """Canyons deeper than `DEEP_M`."""
    turned: int
    """Deep canyons before which the robot turned."""
    heard: int
    """Deep canyons whose back is heard in time to turn."""
    turned_heard: int
    """Those of `heard` before which the robot turned."""
    entered_again: int
    contacts: int
    way: float | None
    """Over the shortest, the mean of those that escaped."""
    time_s: float | None
    reported: int
    reported_outside: int
    """Canyons that were reported, and those while the robot was outside."""


class _Watch:
    """What one drive comes to."""

    def __init__(self, place: CanyonWorld) -> None:
        self.place = place
        self._inside = False
        self.entries = self.contacts = 0
        self.deepest_m, self.way_m, self.time_s = -math.inf, 0.0, 0.0
        self.reported_m: float | None = None
        self.x, self.y = place.start.x, place.start.y
        self._rest = (self.x, self.y, 0.0)

    def see(self, record: CycleRecord, truth: GroundTruth) -> None:
        """Take the true place after a cycle."""
        x, y = truth.pose.x, truth.pose.y
        self.way_m += math.hypot(x - self.x, y - self.y)
        self.x, self.y, self.time_s = x, y, record.inputs.run_s
        along, across = self.place.local(x, y)
        is_between = abs(across) < 0.5 * self.place.width_m
        if is_between and along < self.place.depth_m:
            self.deepest_m = max(self.deepest_m, along)
        if not self._inside and is_between and 0.0 < along < self.place.depth_m:
            self._inside, self.entries = True, self.entries + 1
        elif self._inside and along < -LEFT_M:
            self._inside = False
        self.contacts = truth.contacts
        if math.hypot(x - self._rest[0], y - self._rest[1]) > STILL_M:
            self._rest = (x, y, self.time_s)

    def is_over(self, state: State) -> bool:
        """Return whether the drive has come to an end."""
        if self.reported_m is None and state.perception.canyons():
            self.reported_m = self.place.local(self.x, self.y)[0]
        is_reached = isinstance(state.drive_request, Goal) and state.drive_request.reached
        return is_reached or state.mode.mode is Mode.SAFE_STOP or self.time_s - self._rest[2] > STILL_S


def drive(settings: Settings, place: CanyonWorld, seed: int) -> CanyonOutcome:
    """Drive to the goal once; `seed` is that of the noise."""
    x, y = place.goal_in_odometry()
    settings = settings.model_copy(update={"goal": GoalConfig(x_m=x, y_m=y), "world": place.world})
    watch = _Watch(place)
    simulate(settings, place.world, seed, TIME_MAX_S, watch.see, is_over=watch.is_over)
    return CanyonOutcome(
        place.depth_m,
        place.width_m,
        math.dist((watch.x, watch.y), place.goal) < ARRIVED_M,
        watch.entries,
        watch.deepest_m,
        watch.contacts,
        watch.way_m,
        place.shortest_m(settings.body.radius_m + ROOM_M),
        watch.time_s,
        watch.reported_m,
        back_heard_m(settings, place),
    )


def summarise(schemas: str, reflection: str, outcomes: Sequence[CanyonOutcome]) -> CanyonRow:
    """Return the row of some drives."""
    escaped = [one for one in outcomes if one.arrived]
    deep = [one for one in outcomes if one.depth_m > DEEP_M]
    heard = [one for one in deep if one.heard_m is not None and one.heard_m >= IN_TIME_M]
    reported = [one.reported_m for one in outcomes if one.reported_m is not None]
    return {
        "schemas": schemas,
        "reflection": reflection,
        "worlds": len(outcomes),
        "escaped": len(escaped),
        "deep": len(deep),
        "turned": sum(one.entries == 0 for one in deep),
        "heard": len(heard),
        "turned_heard": sum(one.entries == 0 for one in heard),
        "entered_again": sum(one.entries > 1 for one in outcomes),
        "contacts": sum(one.contacts for one in outcomes),
        "way": mean(one.way_m / one.shortest_m for one in escaped) if escaped else None,
        "time_s": mean(one.time_s for one in escaped) if escaped else None,
        "reported": len(reported),
        "reported_outside": sum(along < 0.0 for along in reported),
    }
