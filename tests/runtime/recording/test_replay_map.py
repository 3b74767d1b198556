"""A map that is loaded during a run: the robot finds its place there, and the replay is the run, to the bit."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.load import load_world, with_room
from perception.edits import PlaceRobot
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import State
from runtime.recording.channels import CYCLE
from runtime.recording.reader import open_recording
from runtime.recording.replayer import Replayer
from runtime.recording.verification import verify_recording
from tests.recorded import hall, record

LOADED, PLACED = 20, 60
"""Cycles in which the map is loaded, and in which the operator says where the robot is."""


@pytest.mark.compiled
def test_a_map_loaded_in_a_run_leads_to_a_place_and_is_replayed_to_the_bit(tmp_path: Path) -> None:
    before = hall("perception.method=paper")
    world = load_world("hallway")
    path, start = tmp_path / "run.mcap", world.start

    def operator(cycle: int, state: State) -> OperatorInput:
        request = Request.ARM if state.mode.mode is Mode.READY else None
        if cycle != PLACED or state.odometry is None:
            return OperatorInput(request)
        at = state.odometry.pose
        return OperatorInput(request, edits=(PlaceRobot(start.x_m + at.x, start.y_m + at.y, at.theta),))

    record(before, path, 8.0, reloads={LOADED: with_room(before, world, "map")}, operator=operator)
    found: list[str | None] = []
    with open_recording(path) as recording:
        for since_s in (0.0, 5.0):
            result = verify_recording(recording, since_s=since_s)
            assert result.first_difference is None, str(result.first_difference)
            assert result.cycles >= 20 * (8.0 - since_s)
        replayer = Replayer(recording)
        for step in replayer:
            if step.message.topic == CYCLE and replayer.state is not None:
                here = replayer.state.perception.localized()
                found.append(None if here is None else here.status)
    assert found[LOADED - 5] is None
    assert found[LOADED + 5] == "localizing", "as after a start with --map"
    assert found[-1] == "tracking"
