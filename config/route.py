"""A route: a mission that drives to waypoints in turn, and the TOML file of one."""

from __future__ import annotations

from typing import Final, TypeAlias

import tomli_w

from config.mission import MissionConfig, StepConfig
from config.mission_step import Frame, MoveToGoalUse

Waypoint: TypeAlias = tuple[float, float, float | None]
"""A place x, y, m, and the final heading there, degrees counter-clockwise from x of the frame; None for any."""

ABOUT: Final = "The waypoints that the operator set."


def route_config(waypoints: tuple[Waypoint, ...], frame: Frame, name: str) -> MissionConfig:
    """Return the mission of driving to places in turn.

    All of them, one at least, are in the same frame; `name` is that of the mission.

    Raises
    ------
    ValidationError
        The name or a waypoint is none that a mission can have.
    """
    steps = tuple(
        StepConfig(
            name=f"waypoint-{number}",
            schemas=(MoveToGoalUse(name="move_to_goal", x_m=x, y_m=y, frame=frame, heading_deg=heading),),
        )
        for number, (x, y, heading) in enumerate(waypoints, 1)
    )
    return MissionConfig(name=name, about=ABOUT, step=steps)


def waypoints_of(mission: MissionConfig) -> tuple[tuple[Waypoint, ...], Frame] | None:
    """Return the waypoints of a mission and their frame; None if it is more than a route."""
    uses = [use for step in mission.step for use in step.schemas if isinstance(use, MoveToGoalUse)]
    frames = {use.frame for use in uses}
    waypoints = tuple((*use.point, use.heading_deg) for use in uses if use.point is not None)
    if len(waypoints) != len(mission.step) or len(frames) != 1:
        return None
    frame = frames.pop()
    steps = tuple(step.model_copy(update={"name": f"waypoint-{n}"}) for n, step in enumerate(mission.step, 1))
    is_route = not mission.endless and steps == route_config(waypoints, frame, mission.name).step
    return (waypoints, frame) if is_route else None


def mission_text(mission: MissionConfig, head: str) -> str:
    """Return a mission as the text of its file, after a line of comment; `check` accepts it."""
    return f"# {head}\n{tomli_w.dumps(mission.model_dump(mode='json', exclude_defaults=True, exclude_none=True))}"
