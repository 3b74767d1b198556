"""Places that are set during a run limit it from the next cycle on, and the replay is the run, to the bit."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from behaviors.missions.mission import Mission
from behaviors.teleoperation import Teleoperate
from config.load import with_mission
from config.mission import MissionConfig, StepConfig
from config.mission_step import MoveToGoalUse
from config.places import NoGoAreaConfig, PlaceConfig, PlacesConfig, SpeedAreaConfig
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import State
from runtime.recording.reader import open_recording
from runtime.recording.verification import verify_recording
from tests.recorded import hall, record

SET, REMOVED = 50, 160
"""Cycles in which the areas are set, and in which they are gone again."""


@pytest.mark.compiled
def test_places_of_a_run_are_replayed_to_the_bit(tmp_path: Path) -> None:
    before = hall("perception.method=paper", "recording.keyframe_period_s=2.0")
    corners = ((1.8, -3.0), (2.6, -3.0), (2.6, 3.0), (1.8, 3.0))
    slow = ((-1.0, -3.0), (0.9, -3.0), (0.9, 3.0), (-1.0, 3.0))
    places = PlacesConfig(
        place=(PlaceConfig(name="charger", x_m=0.6, y_m=0.0, heading_deg=90.0),),
        no_go_area=(NoGoAreaConfig(vertices_m=corners),),
        speed_area=(SpeedAreaConfig(vertices_m=slow, speed_max_m_s=0.1),),
    )
    marked = before.model_copy(update={"places": places})
    goal = MoveToGoalUse(name="move_to_goal", place="charger")
    mission = MissionConfig(name="home", step=(StepConfig(name="go", schemas=(goal,)),))
    with_mission(marked, mission)
    path, farthest_m = tmp_path / "run.mcap", [-math.inf]

    def operator(cycle: int, state: State) -> OperatorInput:
        request = Request.ARM if state.mode.mode is Mode.READY else None
        if SET < cycle < REMOVED and state.odometry is not None:
            farthest_m[0] = max(farthest_m[0], state.odometry.pose.x)
        if cycle == SET + 60:
            return OperatorInput(request, drive_request=Mission(mission))
        return OperatorInput(request, drive_request=Teleoperate(0.4, 0.0) if cycle < SET + 60 else None)

    record(before, path, 10.0, reloads={SET: marked, REMOVED: before}, operator=operator)
    assert 0.9 < farthest_m[0] <= 1.8 - before.body.radius_m
    with open_recording(path) as recording:
        for since_s in (0.0, 4.0, 9.0):
            result = verify_recording(recording, since_s=since_s)
            assert result.first_difference is None, str(result.first_difference)
