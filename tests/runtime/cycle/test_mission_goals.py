"""A mission's goals are driven as other goals: the look-ahead's quanta, the memory of space, what a stop forgets."""

from __future__ import annotations

from typing import Any

import pytest

from behaviors.missions.mission import Mission, MissionEdit, route
from behaviors.move_to_goal import Goal
from config.mission import MissionConfig
from drivers.messages import Flags, Pose
from runtime.cycle.drive_requests import needs_space
from runtime.cycle.driving import of_step
from runtime.cycle.step import STANDSTILL
from tests.runtime.cycle.requested_robot import RequestedRobot, driving, hold_reason


def mission(*schemas: dict[str, Any], **step: Any) -> Mission:
    steps = [{"name": "one", "schemas": list(schemas), **step}]
    return Mission(MissionConfig.model_validate({"name": "test", "step": steps}))


FAR = {"name": "move_to_goal", "x_m": 5.5, "y_m": 0.0}
A_TIME = {"until": [{"when": "time", "after_s": 60.0}]}


def commands(script: RequestedRobot, asked: Mission | Goal) -> list[str]:
    """Return the commands of some cycles."""
    return [repr(script.request_drive(asked if k == 0 else None).command) for k in range(15)]


def search_began_run_s(script: RequestedRobot) -> float | None:
    """Return when the look-ahead of the drive to a goal began; None without one."""
    return None if script.state.goal_drive is None else script.state.goal_drive.searched_run_s


def test_a_goal_of_a_mission_is_driven_as_any_goal() -> None:
    alone, script = driving(), driving()
    alone.quanta = script.quanta = 5
    assert commands(alone, Goal(5.5, 0.0)) == commands(script, mission(FAR))
    assert alone.state.goal_drive is not None
    assert repr(script.state.goal_drive) == repr(alone.state.goal_drive)
    assert script.state.goal_drive is not None
    assert script.state.goal_drive.search.way


@pytest.mark.parametrize(
    ("schemas", "expected"),
    [
        ([FAR], True), ([{"name": "move_ahead"}], False), ([{"name": "move_ahead"}, {"name": "follow_valley"}], True),
        ([{"name": "wander"}, {"name": "noise"}], False),
    ],
)  # fmt: skip
def test_the_memory_of_space_is_asked_only_where_a_step_uses_it(schemas: list[Any], *, expected: bool) -> None:
    script = driving()
    asked = mission(*schemas, **A_TIME)
    assert needs_space(asked) is expected
    script.request_drive(asked)
    assert script.state.percept is not None
    assert (script.state.percept.steady is not None) is expected
    assert (script.state.goal_drive is not None) is expected


def test_a_stop_and_a_hold_forget_the_drive_and_later_waypoints_do_not() -> None:
    script = driving()
    script.request_drive(route(((5.5, 0.0, None),), "odom"))
    script.request_drive(None)
    searched_run_s = search_began_run_s(script)
    assert searched_run_s is not None
    script.request_drive(route(((5.5, 0.0, None), (0.0, 1.0, None)), "odom"))
    assert search_began_run_s(script) == searched_run_s, "it is the same drive"
    script.drive_request = MissionEdit("hold")
    script.cycle()
    assert search_began_run_s(script) is None
    script.drive_request = MissionEdit("resume")
    script.cycle()
    assert search_began_run_s(script) is not None
    script.request_drive(None, flags=Flags.BUMPER | Flags.LATCHED)
    assert search_began_run_s(script) is None


def test_a_goal_that_is_given_up_leads_on_once_and_the_robot_stands_with_the_reason() -> None:
    script = driving()
    until = [{"when": "reached"}, {"when": "unreachable", "go": "failed"}, {"when": "stuck", "go": "hold"}]
    script.request_drive(mission(FAR, stuck_after_s=2.0, until=until))
    for k in range(45):
        record = script.move_to(Pose(0.2 * (k % 2), 0.0, 0.0))
    assert record.command == STANDSTILL
    assert "the mission test is done: stuck in its step one" in hold_reason(script)
    assert script.state.goal_drive is None


def test_settings_of_a_step_are_made_once_for_each_step_and_anew_for_other_settings() -> None:
    script = driving()
    asked = mission(FAR, stuck_after_s=7.0, avoid_gain=0.5)
    script.request_drive(asked)
    made = script.state.step_settings
    assert made is not None
    behaviors = made.settings.behaviors
    assert (behaviors.move_to_goal.stuck_after_s, behaviors.avoid_static_obstacle.avoid_obstacle_gain) == (7.0, 0.5)
    script.request_drive(None)
    assert script.state.step_settings is made
    for other in (of_step(made.step.model_copy(), made.run, made), of_step(made.step, made.run.model_copy(), made)):
        assert other is not made
        assert other.settings == made.settings
    script.request_drive(Goal(5.5, 0.0))
    assert script.state.step_settings is None
