"""A run with a mission is recorded and replayed to the bit: its edits, its keyframes, and the stop that holds it."""

from __future__ import annotations

from pathlib import Path

from behaviors.missions.mission import Mission, MissionEdit, route
from config.load import load_settings
from runtime.cycle.inputs import Request
from runtime.cycle.step import State
from runtime.recording.reader import open_recording
from runtime.simulation.closed_loop import OperatorInput
from tests.recorded import record, verified

SETTINGS = load_settings(
    "room", ["perception.method=paper", "recording.keyframe_period_s=1.0"], mission="stay-on-path"
)


def operator(cycle: int, _state: State) -> OperatorInput:
    """Arm, hold, resume, stop, arm again, resume, then a route and a skip."""
    edits = {
        90: MissionEdit("hold"), 100: MissionEdit("resume"), 150: MissionEdit("resume"), 170: MissionEdit("skip"),
        180: route(((0.5, 0.5, None), (0.0, 1.0, 90.0)), "odom"), 190: route(((0.5, 0.5, None), (1.0, 1.0, None)), "odom"),
        200: MissionEdit("skip"),
    }  # fmt: skip
    requests = {40: Request.ARM, 120: Request.HALT, 130: Request.ARM}
    return OperatorInput(requests.get(cycle), edits.get(cycle))


def test_a_mission_is_replayed_to_the_bit_with_its_edits(tmp_path: Path) -> None:
    path = tmp_path / "mission.mcap"
    states: list[Mission] = []
    record(path, SETTINGS, 12.0, operator=operator, on_drive_request=states.append)
    found = verified(path)
    assert found.differences == 0
    assert found.keyframes >= 8
    assert open_recording is not None
