"""A mission as a value: what stops, edits, routes and hostile recordings do to it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from behaviors.missions.mission import (
    HELD_BY_OPERATOR,
    HELD_BY_STOP,
    Mission,
    MissionEdit,
    Progress,
    after_stop,
    continued,
    edit_refusal,
    edited,
    goes_to,
    progress_problem,
    route,
)
from behaviors.schema_call import Memory, Visited
from perception.percept import Pose
from tests.behaviors.mission_robot import MissionRobot, mission

GOAL = {"name": "move_to_goal", "x_m": 3.0, "y_m": 0.0}
TWO = mission(
    {"schemas": [GOAL], "until": [{"when": "reached"}, {"when": "bumper", "go": "c"}]}, {"schemas": [GOAL]},
    {"schemas": [{"name": "wander"}], "until": [{"when": "time", "after_s": 1.0}]},
)  # fmt: skip
HOLD, RESUME, SKIP = (MissionEdit(action) for action in ("hold", "resume", "skip"))


def state(of: Mission) -> tuple[str, str, str | None]:
    return of.step.name, of.progress.status, of.progress.reason


def test_a_stop_holds_it_and_only_a_resume_goes_on() -> None:
    stopped = after_stop(TWO, bumper=False)
    assert state(stopped) == ("a", "held", HELD_BY_STOP)
    assert after_stop(stopped, bumper=True) == stopped, "the next stop changes nothing"
    assert state(edited(stopped, RESUME)) == ("a", "running", None)


def test_a_contact_leads_to_its_step_and_holds_it_there() -> None:
    assert state(after_stop(TWO, bumper=True)) == ("c", "held", HELD_BY_STOP)
    assert state(after_stop(goes_to(TWO, "b", ""), bumper=True)) == ("b", "held", HELD_BY_STOP)


def test_hold_skip_and_resume() -> None:
    held = edited(TWO, HOLD)
    assert state(held) == ("a", "held", HELD_BY_OPERATOR)
    assert state(edited(held, SKIP)) == ("b", "held", HELD_BY_OPERATOR), "a skipped step does not begin to drive"
    assert state(edited(TWO, SKIP)) == ("b", "running", None)
    last = edited(edited(edited(TWO, SKIP), SKIP), SKIP)
    assert state(last) == ("c", "done", "the mission test is done: the operator skipped the last step")


def test_what_cannot_be_edited_is_said() -> None:
    assert edit_refusal(TWO, HOLD) is None
    assert edit_refusal(None, SKIP) == "there is no mission to skip: start one, or set waypoints"
    assert edit_refusal(TWO, RESUME) == "the mission test is not held"
    ended = goes_to(TWO, "failed", "stuck in its step a")
    assert ended.progress.reason == "the mission test has failed: stuck in its step a"
    assert edit_refusal(ended, RESUME) == "the mission test has ended (failed): start it again"


def test_a_condition_may_wait_for_the_operator() -> None:
    waiting = goes_to(TWO, "hold", "reached")
    assert state(waiting) == (
        "b", "held", "the mission waits for the operator, as its step a says: resume it, or skip the step",
    )  # fmt: skip
    assert goes_to(goes_to(TWO, "c", ""), "hold", "time").progress.status == "done", "nothing follows the last step"


def test_a_route_goes_on_when_waypoints_are_added_behind_where_it_is() -> None:
    places = ((1.0, 0.0, None), (1.0, 1.0, 90.0), (0.0, 1.0, None))
    robot = MissionRobot(route(places[:2], "odom"))
    while robot.mission.progress.step == 0:
        robot.cycle()
    progress = robot.mission.progress
    longer = continued(robot.mission, route(places, "odom"))
    assert (longer.progress, len(longer.plan.step)) == (progress, 3)
    elsewhere = continued(robot.mission, route(((9.0, 9.0, None), *places[1:]), "odom"))
    assert elsewhere.progress == Progress(), "another beginning is another route"
    assert continued(TWO, route(places, "odom")).progress == Progress()
    robot.put(longer)
    robot.drive(60.0)
    assert (robot.status, robot.steps) == ("done", ["waypoint-1", "waypoint-2", "waypoint-3"])
    assert math.dist((robot.pose.x, robot.pose.y), places[2][:2]) < 0.15
    further = continued(robot.mission, route((*places, (0.5, 0.5, None)), "odom"))
    assert state(further) == ("waypoint-4", "running", None)
    assert continued(robot.mission, route(places, "odom")).progress == Progress(), "the same again begins anew"


def test_a_route_goes_on_from_a_present_waypoint_that_is_moved_or_removed() -> None:
    places = ((1.0, 0.0, None), (1.0, 1.0, 90.0), (0.0, 1.0, None))
    robot = MissionRobot(route(places, "odom"))
    while robot.mission.progress.step == 0:
        robot.cycle()
    for _ in range(20):
        robot.cycle()
    moved = continued(robot.mission, route((places[0], (1.5, 1.0, None), places[2]), "odom"))
    assert (state(moved), moved.progress.step_s) == (("waypoint-2", "running", None), 0.0), "towards the new place"
    held = continued(edited(robot.mission, HOLD), route((places[0], places[2]), "odom"))
    assert state(held)[:2] == ("waypoint-2", "held"), "a motion never begins by an edit of the route"
    assert progress_problem(held) is None
    over = continued(robot.mission, route(places[:1], "odom"))
    assert state(over)[1:] == ("done", "the mission route is done: the operator removed what was left")
    assert progress_problem(over) is None


@pytest.mark.parametrize(
    "progress",
    [
        Progress(step=3), Progress(step=-1), Progress(step_s=math.nan), Progress(way_m=math.inf),
        Progress(start=Pose(math.nan, 0.0, 0.0)), Progress(memories=(Memory(index=-1),)),
        Progress(memories=(Memory(x=1e300),)), Progress(seen_s=(math.inf,)), Progress(best_m=math.nan),
        Progress(start=Pose(0.0, 0.0, 0.0)), Progress(visited=(Visited(1, 0.0, math.nan),)),
        Progress(visited=(Visited(1, 0.0, 0.0),) * 1000), Progress(memories=(Memory(index=2**60),)),
    ],
)  # fmt: skip
def test_progress_that_no_mission_can_have_is_found(progress: Progress) -> None:
    assert progress_problem(TWO) is None
    assert "invalid mission" in str(progress_problem(replace(TWO, progress=progress)))


def test_all_progress_that_a_drive_makes_is_valid() -> None:
    robot = MissionRobot(TWO)
    for _ in range(300):
        robot.cycle()
        assert progress_problem(robot.mission) is None
