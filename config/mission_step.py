"""The parts of a mission's step: the settings of the schemas that it can name, and its conditions."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import Field, model_validator

from config.strict import Point, Strict, TomlList

STEPS_MAX: Final = 64
"""Most steps of a mission, and most waypoints of a route."""
POINTS_MAX: Final = 256
"""Most corners of a path."""

NEXT: Final = "next"
DONE: Final = "done"
FAILED: Final = "failed"
HOLD: Final = "hold"
TARGETS: Final = (NEXT, DONE, FAILED, HOLD)
"""What a condition may name besides a step: the next one in the file, the two ends, or waiting for the operator."""

LABELS: Final = ("wall", "inside corner", "edge", "post", "barrel", "unknown")
"""Objects that are recognised without a model."""

Name: TypeAlias = Annotated[
    str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,39}$", description="Small letters, digits, - and _.")
]
"""Name of a mission or a step."""
Target: TypeAlias = Annotated[
    str, Field(max_length=40, description="The step that follows, or `next`, `done`, `failed`, `hold`.")
]
"""Where a condition leads."""
ObjectName: TypeAlias = Annotated[
    str, Field(min_length=1, max_length=100, description="Name of the object's model, or another label, as `post`.")
]
"""What an object is recognised as."""
Frame: TypeAlias = Annotated[
    Literal["odom", "map"],
    Field(
        description="`odom`: fixed in the robot's odometry. `map`: in the map (`run --map`, or correction of drift)."
    ),
]
"""The frame of places."""
Degrees: TypeAlias = Annotated[float, Field(ge=-360.0, le=360.0)]
Length: TypeAlias = Annotated[float, Field(gt=0.0, le=1000.0)]
Gain: TypeAlias = Annotated[
    float, Field(ge=0.0, le=100.0, description="Factor on the schema's vector; 1 asks for the base velocity.")
]


class Use(Strict):
    """A schema with its settings in a step: what each schema's class inherits. Its first key is `name`, a literal."""

    can_arrive: ClassVar[bool] = False
    """Whether it comes to an end by itself, so that a step may end when it is `reached`."""
    leads: ClassVar[bool] = True
    """Whether it leads somewhere by itself; the others only change where those lead."""
    name: str

    @property
    def arrives(self) -> bool:
        """Whether it comes to an end by itself with these settings."""
        return self.can_arrive


class MoveAheadUse(Use):
    """`move_ahead`: a vector along a direction; arrives after `distance_m`, if that is given."""

    name: Literal["move_ahead"]
    """Of the schema."""
    gain: Gain = 1.0
    direction_deg: Degrees = 0.0
    """Degrees counter-clockwise, from the robot's heading as the step begins or from the x axis of odometry."""
    relative_to: Literal["robot", "odom"] = "robot"
    """What the direction counts from."""
    distance_m: float | None = Field(default=None, gt=0.0, le=1000.0)
    """Distance along the direction from where the step begins, m."""

    @property
    def arrives(self) -> bool:
        """Whether a distance is given."""
        return self.distance_m is not None


class MoveToGoalUse(Use):
    """`move_to_goal`: a vector towards a place; arrives there, and turns to the final heading if one is given."""

    can_arrive: ClassVar[bool] = True
    name: Literal["move_to_goal"]
    """Of the schema."""
    gain: Gain = 1.0
    place: Name | None = None
    """Name of a place of the map, in place of coordinates and frame; its heading counts if the step gives none."""
    x_m: float | None = Field(default=None, ge=-10_000.0, le=10_000.0)
    y_m: float | None = Field(default=None, ge=-10_000.0, le=10_000.0)
    """The place, m."""
    frame: Frame = "odom"
    heading_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Heading at the goal, in its frame, degrees counter-clockwise from x."""

    @model_validator(mode="after")
    def _has_one_goal(self) -> MoveToGoalUse:
        given = [self.x_m is not None, self.y_m is not None]
        if self.place is None and not all(given):
            raise ValueError("move_to_goal needs a goal: give it x_m and y_m, or the name of a place")
        if self.place is not None and any(given):
            raise ValueError(f"the goal is the place {self.place}, which has its own x_m and y_m: leave them out")
        return self

    @property
    def point(self) -> tuple[float, float] | None:
        """The goal x, y, m; None where it is a named place."""
        return None if self.x_m is None or self.y_m is None else (self.x_m, self.y_m)


class TurnUse(Use):
    """`turn`: turns on the spot; arrives when the robot looks that way."""

    can_arrive: ClassVar[bool] = True
    name: Literal["turn"]
    """Of the schema."""
    heading_deg: Degrees
    """Degrees counter-clockwise, from the robot's heading as the step begins or from the x axis of the frame."""
    relative_to: Literal["robot", "odom", "map"] = "robot"
    """What the heading counts from."""


class WanderUse(Use):
    """`wander`: drives in a random direction in which the way is free, then in another; does not arrive."""

    name: Literal["wander"]
    """Of the schema."""
    gain: Gain = 1.0
    seed: int = Field(default=0, ge=0, le=2**31)
    """Of the random directions: the same seed in the same room gives the same drive."""
    persistence_s: float = Field(default=6.0, ge=0.5, le=600.0)
    """Longest time in one direction, s."""
    free_m: Length = 1.0
    """Free way beyond the rim that a new direction should have, m."""


class FollowWallUse(Use):
    """`follow_wall`: drives along a wall with one side to it; does not arrive."""

    name: Literal["follow_wall"]
    """Of the schema."""
    gain: Gain = 1.0
    side: Literal["left", "right"] = "left"
    """The robot's side on which the wall is kept."""
    distance_m: Length = 0.5
    """Distance kept from rim to wall, m. Gaps narrower than about twice this and the robot's radius are passed."""
    search_m: Length = 1.5
    """A wall farther than this from the rim is not followed: the robot drives ahead until it finds one, m."""


class StayOnPathUse(Use):
    """`stay_on_path`: follows a chain of straight lines; arrives at its end."""

    can_arrive: ClassVar[bool] = True
    name: Literal["stay_on_path"]
    """Of the schema."""
    gain: Gain = 1.0
    points_m: TomlList[Point] = Field(min_length=2, max_length=POINTS_MAX)
    """The path's corners in order, m."""
    frame: Frame = "odom"
    lookahead_m: Length = 0.6
    """The robot steers for a point this far ahead of it on the path, m."""

    @model_validator(mode="after")
    def _has_length(self) -> StayOnPathUse:
        for i, (a, b) in enumerate(zip(self.points_m, self.points_m[1:], strict=False)):
            if math.dist(a, b) < 1e-3:
                raise ValueError(f"points_m {i} and {i + 1} are the same place: leave one of them out")
        return self


class ApproachObjectUse(Use):
    """`approach_object`: drives to an object, stops before it and looks at it; arrives there (docking)."""

    can_arrive: ClassVar[bool] = True
    name: Literal["approach_object"]
    """Of the schema."""
    gain: Gain = 1.0
    object: ObjectName
    probability_min: float = Field(default=0.9, ge=0.0, le=1.0)
    """Least probability of the object."""
    choose: Literal["nearest", "unvisited"] = "nearest"
    """`unvisited`: the nearest one at which no step of this mission has arrived."""
    distance_m: float = Field(default=0.5, ge=0.0, le=100.0)
    """Distance from the robot's rim to the object's outline in which it stops, m."""
    side_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Side of the object on which it stops, degrees counter-clockwise from x of `frame`; by default the near side."""
    frame: Frame = "odom"


class SearchUse(Use):
    """`search`: covers an area line by line or in a growing square; arrives when it has covered all of it."""

    can_arrive: ClassVar[bool] = True
    name: Literal["search"]
    """Of the schema."""
    gain: Gain = 1.0
    pattern: Literal["spiral", "lawn_mower"] = "spiral"
    """`spiral`: in a square from the middle outwards; `lawn_mower`: to and fro ahead of the robot."""
    width_m: Length = 4.0
    """Width of the area, m. It lies about the robot for a spiral, otherwise to the left of it and ahead."""
    depth_m: Length = 4.0
    """Length of the area along the robot's heading as the step begins, m."""
    spacing_m: Annotated[float, Field(ge=0.2, le=100.0)] = 1.0
    """Distance between two lines, m: at most twice the distance from which the objects are recognised."""

    @model_validator(mode="after")
    def _has_few_lines(self) -> SearchUse:
        if max(self.width_m, self.depth_m) / self.spacing_m > POINTS_MAX:
            raise ValueError(f"spacing_m gives more than {POINTS_MAX} lines: make it larger")
        return self


class FollowValleyUse(Use):
    """`follow_valley`: the free valley nearest to where the step's other schemas lead (VFH+)."""

    leads: ClassVar[bool] = False
    name: Literal["follow_valley"]
    """Of the schema."""
    gain: Gain = 1.0
    """With `move_to_goal`, which is driven so in any case, 0 drives straight to the goal."""


class LeaveCanyonUse(Use):
    """`leave_canyon`: beside `move_to_goal`, which is driven with it in any case: its gain in this step."""

    leads: ClassVar[bool] = False
    name: Literal["leave_canyon"]
    """Of the schema."""
    gain: Gain = 1.0
    """0 does not go round dead ends."""


class AvoidPastUse(Use):
    """`avoid_past`: away from where the robot has been in this step; its distances are those of the run's table."""

    leads: ClassVar[bool] = False
    name: Literal["avoid_past"]
    """Of the schema."""
    gain: Gain = 1.0


class NoiseUse(Use):
    """`noise`: a random direction, kept for a while; persistence and seed are those of the run's table."""

    leads: ClassVar[bool] = False
    name: Literal["noise"]
    """Of the schema."""
    gain: Gain = 1.0


class SwirlUse(Use):
    """`swirl`: round obstacles, on the side of the way on which the step's other schemas lead."""

    leads: ClassVar[bool] = False
    name: Literal["swirl"]
    """Of the schema."""
    gain: Gain = 1.0


class ReachedCondition(Strict):
    """`reached`: the step's schema has arrived."""

    when: Literal["reached"]
    """The condition."""
    go: Target = NEXT


class SeenCondition(Strict):
    """`seen`: an object is recognised."""

    when: Literal["seen"]
    """The condition."""
    go: Target = NEXT
    object: ObjectName
    probability_min: float = Field(default=0.9, ge=0.0, le=1.0)
    """Least probability of the object."""
    within_m: float | None = Field(default=None, gt=0.0, le=1000.0)
    """Largest distance from the robot's centre to the object's, m."""
    unvisited: bool = False
    """Only an object counts at which no step of this mission has arrived."""


class UnseenCondition(Strict):
    """`unseen`: no such object has been recognised for some time."""

    when: Literal["unseen"]
    """The condition."""
    go: Target = NEXT
    object: ObjectName
    probability_min: float = Field(default=0.9, ge=0.0, le=1.0)
    """Least probability of the object."""
    unvisited: bool = False
    """Only an object counts at which no step of this mission has arrived."""
    after_s: float = Field(default=2.0, ge=0.0, le=1e5)
    """For so long none has been, s."""


class TimeCondition(Strict):
    """`time`: the step has been driven for some time; time in which the robot may not drive does not count."""

    when: Literal["time"]
    """The condition."""
    go: Target = NEXT
    after_s: float = Field(gt=0.0, le=1e5)
    """That time, s."""


class WayCondition(Strict):
    """`way`: the robot has come some way in this step."""

    when: Literal["way"]
    """The condition."""
    go: Target = NEXT
    after_m: float = Field(gt=0.0, le=1e5)
    """That way, m."""


class BumperCondition(Strict):
    """`bumper`: a contact stopped the robot. It goes on there once it is armed again and the mission resumed."""

    when: Literal["bumper"]
    """The condition."""
    go: Target = NEXT


class LostCondition(Strict):
    """`lost`: the robot has not known its place in the map for some time."""

    when: Literal["lost"]
    """The condition."""
    go: Target = NEXT
    after_s: float = Field(default=2.0, ge=0.0, le=1e5)
    """That time, s."""


class StuckCondition(Strict):
    """`stuck`: the step has come no nearer to its end for `stuck_after_s`; without this the mission is held.

    A robot on the way to a goal may go round and is stuck if it has hardly moved for so long.
    """

    when: Literal["stuck"]
    """The condition."""
    go: Target = NEXT


class UnreachableCondition(Strict):
    """`unreachable`: the step's goal cannot be reached; without this it is stuck.

    Something stands on the goal, or the robot drives and comes no nearer to it for `unreachable_after_s`.
    """

    when: Literal["unreachable"]
    """The condition."""
    go: Target = NEXT


Condition: TypeAlias = Annotated[
    ReachedCondition
    | SeenCondition
    | UnseenCondition
    | TimeCondition
    | WayCondition
    | BumperCondition
    | LostCondition
    | StuckCondition
    | UnreachableCondition,
    Field(discriminator="when"),
]
"""A condition and where it leads."""
