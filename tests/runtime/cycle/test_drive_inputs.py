"""Waiting drive requests: the newest drive, then the changes of the mission that it may be."""

from __future__ import annotations

from behaviors.missions.mission import MissionEdit
from behaviors.move_to_goal import Goal
from runtime.cycle.drive_inputs import WAITING_MAX, DriveInputs
from runtime.cycle.drive_requests import Legs
from runtime.cycle.inputs import always_valid


def test_a_drive_replaces_what_waits_and_changes_follow_one_by_one() -> None:
    waiting = DriveInputs()
    assert waiting.take() is None
    for asked in (Legs(), MissionEdit("hold"), Goal(1.0, 0.0), MissionEdit("resume"), MissionEdit("skip")):
        waiting.put(asked, always_valid)
    assert [waiting.take() for _ in range(4)] == [Goal(1.0, 0.0), MissionEdit("resume"), MissionEdit("skip"), None]


def test_what_is_no_longer_valid_is_dropped_and_too_many_are_not_kept() -> None:
    waiting = DriveInputs()
    waiting.put(Goal(1.0, 0.0), lambda: False)
    waiting.put(MissionEdit("hold"), always_valid)
    assert waiting.take() == MissionEdit("hold")
    assert [waiting.put(MissionEdit("skip"), always_valid) for _ in range(20)].count(True) == WAITING_MAX
    assert sum(waiting.take() is not None for _ in range(20)) == WAITING_MAX
