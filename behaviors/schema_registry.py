"""The functions of the schemas that a mission's step can name.

A further schema is a file of its own, its settings in `config.mission_step`, a line in
`config.schema_use.SchemaUse`, and a line here. One that an
installed package adds needs none of these: its settings have a method `answer`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, Protocol, TypeAlias

from behaviors.approach_object import approach_object
from behaviors.avoid_past import avoid_past
from behaviors.follow_wall import follow_wall
from behaviors.memory.goal_place import GoalPlace, goal_place
from behaviors.move_ahead import SCHEMA as AHEAD
from behaviors.move_to_goal import SCHEMA as TO_GOAL
from behaviors.move_to_goal import Goal, move_to_goal
from behaviors.noise import noise
from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene
from behaviors.search import search
from behaviors.stay_on_path import stay_on_path
from behaviors.swirl import swirl
from behaviors.turn import UNKNOWN_FRAME, is_aligned, turn
from behaviors.wander import wander
from config.mission_step import (
    AvoidPastUse,
    FollowValleyUse,
    Frame,
    LeaveCanyonUse,
    MoveAheadUse,
    MoveToGoalUse,
    NoiseUse,
    SwirlUse,
    Use,
)
from config.places import PlacesConfig, no_such_place

Schema: TypeAlias = Callable[[Scene, Memory, Any], Answer]
"""A schema: what it sees, what it has kept, and its settings in the step, of the type that has its name."""


class PluggedUse(Protocol):
    """The settings of a schema that an installed package adds (`config.plugins.SCHEMAS`)."""

    def answer(self, scene: Scene, memory: Memory) -> Answer:
        """Return the schema's vector, and what it keeps for the next cycle; pure."""


def ahead_in_step(scene: Scene, memory: Memory, use: MoveAheadUse) -> Answer:
    """Return the vector along a direction, and whether the step's distance along it is behind the robot.

    Parameters
    ----------
    scene, memory
        The pose now and as the step began; the memory is not used.
    use
        Direction, distance and gain.
    """
    turned = scene.start.theta if use.relative_to == "robot" else 0.0
    direction = turned + math.radians(use.direction_deg)
    ux, uy = math.cos(direction), math.sin(direction)
    along = (scene.percept.pose.x - scene.start.x) * ux + (scene.percept.pose.y - scene.start.y) * uy
    rest_m = None if use.distance_m is None else max(0.0, use.distance_m - along)
    gain = 0.0 if rest_m == 0.0 else use.gain
    return Answer(Response(AHEAD, gain * ux, gain * uy), memory, has_arrived=rest_m == 0.0, remaining_m=rest_m)


def to_goal_in_step(scene: Scene, memory: Memory, use: MoveToGoalUse) -> Answer:
    """Return the vector to a place, and then the turn to its final heading.

    Parameters
    ----------
    scene
        Pose and map frame; a place in the map moves smoothly as that is corrected.
    memory
        `x`, `y`: where the place lies in odometry's frame as the robot drives to it; `index` is 1 once it was there.
    use
        The place, its frame, the final heading and the gain.
    """
    still, before = Response(TO_GOAL, 0.0, 0.0), GoalPlace(memory.x, memory.y) if memory.is_set else None
    asked = goal_of(use, scene.places, scene.places_frame)
    if asked is None:
        return Answer(still, Memory(memory.index), waits_for=no_such_place(use.place or "", scene.places))
    frame, goal = scene.frame(asked.frame), replace(asked, reached=memory.index == 1)
    place = goal_place(goal, before, frame, scene.cycle_s)
    if frame is None or place is None:
        return Answer(still, Memory(memory.index), waits_for=UNKNOWN_FRAME)
    there = Goal(place.x, place.y, reached=goal.reached)
    response, there = move_to_goal(scene.percept, there, scene.behaviors.move_to_goal)
    is_there = goal.reached or (there.reached and place.is_exact)
    memory = Memory(int(is_there), place.x, place.y, is_set=True)
    remaining_m = math.hypot(place.x - scene.percept.pose.x, place.y - scene.percept.pose.y)
    if not is_there:
        vector = Response(TO_GOAL, use.gain * response.x, use.gain * response.y)
        return Answer(vector, memory, remaining_m=remaining_m, goal=Goal(place.x, place.y))
    if goal.heading is None:
        return Answer(still, memory, has_arrived=True, remaining_m=0.0)
    direction = frame.theta + goal.heading
    return Answer(still, memory, is_aligned(scene.percept.pose, direction), 0.0, direction)


def goal_of(use: MoveToGoalUse, places: PlacesConfig, places_frame: Frame) -> Goal | None:
    """Return the goal of a step in its frame; None if it names a place that there is not."""
    heading_deg = use.heading_deg
    if use.point is not None:
        (x, y), frame = use.point, use.frame
    else:
        place = places.named(use.place or "")
        if place is None:
            return None
        x, y, frame = place.x_m, place.y_m, places_frame
        heading_deg = place.heading_deg if heading_deg is None else heading_deg
    return Goal(x, y, frame=frame, heading=None if heading_deg is None else math.radians(heading_deg))


def steering_in_step(scene: Scene, memory: Memory, use: FollowValleyUse | LeaveCanyonUse) -> Answer:
    """Return a vector of zero: `runtime.cycle.goal_drive` lets the schema turn that of the others.

    The response is needed all the same: the arbiter stops a robot of which a schema does not respond.

    Parameters
    ----------
    scene
        Not used.
    memory
        Handed back.
    use
        The schema.
    """
    del scene
    return Answer(Response(use.name, 0.0, 0.0), memory)


def avoid_past_in_step(scene: Scene, memory: Memory, use: AvoidPastUse) -> Answer:
    """Return the vector away from where the robot has been in this step.

    Parameters
    ----------
    scene
        The pose.
    memory
        `trail`: where the robot has been.
    use
        The gain.
    """
    config = scene.behaviors.avoid_past.model_copy(update={"avoid_past_gain": use.gain})
    response, trail = avoid_past(scene.percept, memory.trail, config)
    return Answer(response, Memory(trail=trail))


def noise_in_step(scene: Scene, memory: Memory, use: NoiseUse) -> Answer:
    """Return a random vector.

    Parameters
    ----------
    scene
        The time.
    memory
        Not used.
    use
        The gain.
    """
    config = scene.behaviors.noise.model_copy(update={"noise_gain": use.gain})
    return Answer(noise(scene.run_s, config), memory)


def swirl_in_step(scene: Scene, memory: Memory, use: SwirlUse) -> Answer:
    """Return the vector round obstacles.

    Parameters
    ----------
    scene
        Obstacles, and where the other schemas lead.
    memory
        Not used.
    use
        The gain.
    """
    config = scene.behaviors.swirl.model_copy(update={"swirl_gain": use.gain})
    way_rad = scene.percept.pose.theta if scene.way_rad is None else scene.way_rad
    return Answer(swirl(scene.percept, way_rad, scene.body.radius_m, config), memory)


SCHEMAS: Final[Mapping[str, Schema]] = MappingProxyType(
    {
        "move_ahead": ahead_in_step,
        "move_to_goal": to_goal_in_step,
        "turn": turn,
        "wander": wander,
        "follow_wall": follow_wall,
        "stay_on_path": stay_on_path,
        "approach_object": approach_object,
        "search": search,
        "follow_valley": steering_in_step,
        "leave_canyon": steering_in_step,
        "avoid_past": avoid_past_in_step,
        "noise": noise_in_step,
        "swirl": swirl_in_step,
    }
)
"""Every schema by its name in a step."""


def schema_of(use: Use) -> Schema:
    """Return the function of a schema in a step.

    Parameters
    ----------
    use
        The schema with its settings; one of an installed package brings its function with it.
    """
    shipped = SCHEMAS.get(use.name)
    return _own_answer if shipped is None else shipped


def _own_answer(scene: Scene, memory: Memory, use: PluggedUse) -> Answer:
    return use.answer(scene, memory)
