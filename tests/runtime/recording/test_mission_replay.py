"""A run with a mission is recorded and replayed to the bit: its edits, its keyframes, and the stop that holds it."""

from __future__ import annotations

from pathlib import Path

import pytest

from behaviors.missions.mission import Mission, MissionEdit, route
from config.load import load_settings
from runtime.cycle.drive_requests import DriveInput
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.step import State
from tests.recorded import record, verify_file

SETS = ["perception.method=paper", "recording.keyframe_period_s=1.0"]
PLACES = ((0.5, 0.5, None), (0.0, 1.0, 90.0), (1.0, 1.0, None))


@pytest.mark.compiled
def test_a_mission_is_replayed_to_the_bit_with_its_edits(tmp_path: Path) -> None:
    seen: list[tuple[str, str, int]] = []

    def operator(cycle: int, state: State) -> OperatorInput:
        """Arm, hold, resume, stop, arm again, resume, skip; then a route that changes under way."""
        edits: dict[int, DriveInput] = {
            90: MissionEdit("hold"), 100: MissionEdit("resume"), 150: MissionEdit("resume"), 160: MissionEdit("skip"),
            170: route(PLACES[:2], "odom"), 180: route((PLACES[0], PLACES[2]), "odom"), 190: MissionEdit("skip"),
        }  # fmt: skip
        requests = {30: Request.ARM, 120: Request.HALT, 130: Request.ARM}
        if isinstance(mission := state.drive_request, Mission):
            seen.append((mission.plan.name, mission.progress.status, mission.progress.step))
        return OperatorInput(requests.get(cycle), edits.get(cycle))

    path = tmp_path / "mission.mcap"
    record(load_settings("room", SETS, mission="stay-on-path"), path, 11.0, operator=operator)
    assert set(seen) >= {
        ("stay-on-path", "running", 0), ("stay-on-path", "held", 0), ("stay-on-path", "done", 0),
        ("route", "running", 0), ("route", "running", 1),
    }  # fmt: skip
    found = verify_file(path)
    assert (found.cycles, found.differences) == (220, 0), found.first_difference
    assert found.keyframes >= 9
    middle = verify_file(path, since_s=6.0)
    assert middle.differences == 0, middle.first_difference
