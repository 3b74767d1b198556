"""A mission as the page shows it: its state machine, its places, and how far it has come."""

from __future__ import annotations

from typing import Any

import orjson

from behaviors.missions.mission import Mission
from config.mission import MissionConfig, StepConfig
from config.mission_step import Frame, MoveToGoalUse, StayOnPathUse
from runtime.console.frames.state_message import MissionRow, StepRow


class MissionRows:
    """The rows of the mission under way; its plan is encoded once, as every frame repeats it."""

    def __init__(self) -> None:
        self._plan: MissionConfig | None = None
        self._steps = orjson.Fragment(b"[]")

    def row(self, mission: Mission) -> MissionRow:
        """Return the mission in the form that frames have, m and s."""
        if mission.plan is not self._plan:
            self._plan = mission.plan
            self._steps = orjson.Fragment(orjson.dumps([_step(step) for step in mission.plan.step]))
        progress = mission.progress
        return {
            "kind": "mission",
            "name": mission.plan.name,
            "about": mission.plan.about,
            "status": progress.status,
            "reason": progress.reason,
            "step": progress.step,
            "step_s": round(progress.step_s, 1),
            "way_m": round(progress.way_m, 2),
            "steps": self._steps,
        }


def _step(step: StepConfig) -> StepRow:
    """Return a step: its schemas, where its conditions lead, and its places x, y and heading (m, degrees).

    A place of the map is given by its name.
    """
    places: list[tuple[float, float, float | None]] = []
    frame: Frame = "odom"
    place = None
    for use in step.schemas:
        if isinstance(use, MoveToGoalUse):
            places += [] if use.point is None else [(*use.point, use.heading_deg)]
            frame, place = use.frame, use.place
        elif isinstance(use, StayOnPathUse):
            places += [(x, y, None) for x, y in use.points_m]
            frame = use.frame
    return {
        "name": step.name,
        "schemas": [use.name for use in step.schemas],
        "until": [
            (" ".join((c.when, *_details(c.model_dump(exclude={"when", "go"}, exclude_defaults=True)))), c.go)
            for c in step.conditions
        ],
        "places": places,
        "place": place,
        "frame": frame,
    }


def _details(given: dict[str, Any]) -> list[str]:
    """Return what a condition is given, in words."""
    units = {"s": "s", "m": "m"}
    return [
        f"{value:g} {units[key[-1]]}" if key[-2:] in {"_s", "_m"} else key if value is True else f"{value}"
        for key, value in given.items()
    ]
