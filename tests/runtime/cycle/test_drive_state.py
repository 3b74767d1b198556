"""The state of a drive: handed on whole, and without what another kind of drive needed."""

from __future__ import annotations

from dataclasses import fields

from behaviors.move_ahead import Leg
from behaviors.move_to_goal import Goal
from drivers.messages import Pose
from runtime.cycle.drive_requests import Legs
from runtime.cycle.drive_state import DriveState

TRAIL = ((1.0, 2.0),)


def test_what_the_next_kind_of_drive_does_not_need_is_dropped() -> None:
    leg = Leg.starting_at(Pose(0.0, 0.0, 0.0))
    before = DriveState(drive_request=Goal(1.0, 2.0), requested_run_s=3.0, trail=TRAIL)
    after = before.after(Legs(), leg)
    assert (after.drive_request, after.leg, after.trail) == (Legs(), leg, ())
    assert (after.requested_run_s, after.drive_memory) == (3.0, before.drive_memory)
    assert before.trail == TRAIL, "the state before is not changed"


def test_a_state_is_taken_over_whole() -> None:
    state, after = DriveState(), DriveState(drive_request=Goal(1.0, 2.0), requested_run_s=3.0, trail=TRAIL)
    state.take_over(after)
    assert all(getattr(state, one.name) == getattr(after, one.name) for one in fields(DriveState))
