"""What a schema of a mission's step is given in each cycle, and what it answers.

Schemas hold no state: what one keeps from cycle to cycle is its `Memory`, which is passed in and returned.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from behaviors.avoid_past import Trail
from behaviors.move_to_goal import Goal
from behaviors.response import Response
from config.behaviors import BehaviorsConfig
from config.mission_step import Frame
from config.places import PlacesConfig
from config.robot import BodyConfig
from perception.percept import Percept, Pose

ODOM_FRAME: Final = Pose(0.0, 0.0, 0.0)
NO_PLACES: Final = PlacesConfig()


@dataclass(frozen=True, slots=True)
class Memory:
    """What one schema of a step keeps from cycle to cycle; its file says which fields it uses, and for what."""

    index: int = 0
    x: float = 0.0
    y: float = 0.0
    number: int | None = None
    since_s: float = 0.0
    is_set: bool = False
    trail: Trail = ()
    """Where the robot has been, m."""


@dataclass(frozen=True, slots=True)
class Visited:
    """An object at which a step has arrived: its number, if it has one, and its place in odometry's frame, m."""

    number: int | None
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Scene:
    """What the schemas of a step see in one cycle."""

    percept: Percept
    body: BodyConfig
    behaviors: BehaviorsConfig
    start: Pose
    """The robot's pose as the step began, in odometry's frame."""
    step_s: float
    """How long the step has been driven, s."""
    cycle_s: float
    """Time since the cycle before, s."""
    map_frame: Pose | None = None
    """The map frame in odometry's; None while the robot's place in the map is not known."""
    visited: tuple[Visited, ...] = ()
    radii_m: Mapping[str, float] | None = None
    """Radius about an object's position that holds its outline, by model, m."""
    run_s: float = 0.0
    """Now, by the run's clock, s."""
    places: PlacesConfig = NO_PLACES
    """The named places of the map."""
    places_frame: Frame = "odom"
    """In which they lie."""
    way_rad: float | None = None
    """Where the schemas lead that lead somewhere, in odometry's frame; None for those schemas themselves."""

    def frame(self, name: Frame) -> Pose | None:
        """Return the pose of a frame in odometry's; None while it is not known."""
        return ODOM_FRAME if name == "odom" else self.map_frame


@dataclass(frozen=True, slots=True)
class Answer:
    """A schema's answer."""

    response: Response
    memory: Memory
    has_arrived: bool = False
    remaining_m: float | None = None
    """How far it still is to where the schema leads, m; None if it leads nowhere in particular."""
    turn_to_rad: float | None = None
    """The direction to which the robot is to turn on the spot, in odometry's frame; then no vector counts."""
    waits_for: str | None = None
    """Why the schema asks for no motion, for the operator."""
    own_echoes: NDArray[np.bool_] | None = None
    """Which obstacles of the percept the schema itself keeps its distance from, shape (n,): others avoid the rest."""
    visited: Visited | None = None
    """The object at which it has arrived."""
    goal: Goal | None = None
    """The place to which it drives, in odometry's frame: the robot goes there as to any goal."""
