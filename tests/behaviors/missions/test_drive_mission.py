"""Missions drive step by step: each condition, what is said while the robot stands, and that being stuck ends."""

from __future__ import annotations

import math
from typing import Any

import pytest

from behaviors.missions.mission import MissionEdit, edited
from perception.percept import Pose
from tests.behaviors.hall import World
from tests.behaviors.mission_robot import MissionRobot, driven, drum, length_m, mission

AHEAD = {"name": "move_ahead"}
END = {"until": [{"when": "time", "after_s": 0.1, "go": "done"}]}


def until(**condition: object) -> dict[str, Any]:
    return {"schemas": [AHEAD], "until": [condition]}


def test_time_and_way_are_those_of_the_step() -> None:
    robot = driven(until(when="time", after_s=2.0), until(when="way", after_m=1.0), END, seconds=20.0)
    assert (robot.status, robot.steps) == ("done", ["a", "b", "c"])
    changes = [i for i, pose in enumerate(robot.path) if pose.x > 0.0]
    assert length_m(robot.path) == pytest.approx(0.3 * 2.0 - 0.09 + 1.0, abs=0.08)
    assert changes


def test_an_object_is_seen_from_a_probability_and_a_distance_on() -> None:
    seen = {"when": "seen", "object": "drum", "probability_min": 0.8, "within_m": 2.0}
    robot = MissionRobot(mission(until(**seen), END), objects=(drum(1, 3.0, 1.0, 0.7), drum(2, 5.0, -1.0)))
    robot.drive(60.0)
    assert robot.status == "done"
    at = next(pose for pose, name in zip(robot.path, _names(robot), strict=True) if name == "b")
    assert math.dist((at.x, at.y), (5.0, -1.0)) == pytest.approx(2.0, abs=0.05), "the first is not probable enough"


def _names(robot: MissionRobot) -> list[str]:
    """Return the step of each pose: the second one begins where its progress does."""
    x = robot.mission.progress.start
    assert x is not None
    return ["b" if pose.x >= x.x - 0.02 else "a" for pose in robot.path]


def test_unseen_counts_the_time_without() -> None:
    robot = MissionRobot(mission(until(when="unseen", object="drum", after_s=1.0)), objects=(drum(1, 3.0, 1.0),))
    robot.drive(4.0)
    assert robot.status == "running"
    robot.objects = ()
    since_s = robot.run_s
    robot.drive(9.0)
    assert robot.status == "done"
    assert robot.run_s - since_s == pytest.approx(1.0, abs=0.11)


def test_lost_counts_the_time_without_a_place_in_the_map() -> None:
    robot = MissionRobot(mission(until(when="lost", after_s=1.0, go="failed")), map_frame=Pose(0.0, 0.0, 0.0))
    robot.drive(3.0)
    assert robot.status == "running"
    robot.map_frame = None
    robot.drive(3.0)
    assert (robot.status, robot.reason) == ("failed", "the mission test has failed: lost in its step a")


def test_the_first_condition_that_holds_leads_on() -> None:
    both = [{"when": "time", "after_s": 1.0, "go": "c"}, {"when": "time", "after_s": 1.0, "go": "b"}]
    step = {"schemas": [AHEAD], "until": [*both, {"when": "stuck", "go": "b"}]}
    robot = driven(step, END, END, seconds=5.0)
    assert robot.steps == ["a", "c"]


def test_a_step_without_schemas_waits_and_says_for_what() -> None:
    robot = MissionRobot(mission({"until": [{"when": "time", "after_s": 3.0}, {"when": "seen", "object": "drum"}]}))
    for _ in range(21):
        robot.cycle()
    assert robot.reason == "step a waits for: time, 2 s more, drum seen"
    assert robot.drive(9.0).status == "done"
    assert length_m(robot.path) == 0.0


WALL = World((), ((1.5, -9.0, 1.5, 9.0),))
TAKEN = World(((2.0, 0.0, 0.3),), ())
"""A drum stands where the goal is."""


def test_a_step_that_comes_no_nearer_is_held_with_the_reason_or_goes_where_stuck_leads() -> None:
    ahead = {"name": "move_ahead", "distance_m": 4.0}
    robot = driven({"schemas": [ahead], "stuck_after_s": 5.0}, world=WALL, seconds=30.0)
    assert robot.status == "held"
    assert "step a is stuck" in robot.reason
    assert "come no nearer for 5 s" in robot.reason
    assert robot.run_s < 16.0
    robot.put(edited(robot.mission, MissionEdit("resume")))
    since_s = robot.run_s
    robot.drive(30.0)
    assert robot.status == "held"
    assert robot.run_s - since_s == pytest.approx(5.0, abs=0.2), "resumed it tries again as long"
    led = driven(
        {"schemas": [ahead], "stuck_after_s": 5.0, "until": [{"when": "reached"}, {"when": "stuck", "go": "failed"}]},
        world=WALL, seconds=30.0,
    )  # fmt: skip
    assert led.reason == "the mission test has failed: stuck in its step a"


GOAL = {"name": "move_to_goal", "x_m": 2.0, "y_m": 0.0}
UNREACHABLE = {"schemas": [GOAL, {"name": "leave_canyon", "gain": 0.0}], "unreachable_after_s": 5.0}


def test_a_goal_that_cannot_be_reached_holds_the_mission_or_leads_on() -> None:
    robot = driven(UNREACHABLE, world=TAKEN, seconds=40.0)
    assert robot.status == "held"
    assert "step a: the goal is unreachable: no nearer than" in robot.reason
    assert "clear the way and resume the mission, or skip the step" in robot.reason
    robot.put(edited(robot.mission, MissionEdit("resume")))
    since_s = robot.run_s
    robot.drive(40.0)
    assert robot.status == "held"
    assert robot.run_s - since_s == pytest.approx(5.0, abs=0.5), "resumed it tries again as long"
    for when in ("unreachable", "stuck"):
        led = driven({**UNREACHABLE, "until": [{"when": when, "go": "failed"}]}, world=TAKEN, seconds=40.0)
        assert led.reason == "the mission test has failed: unreachable in its step a"


def test_a_goal_with_a_gain_of_none_is_stuck_and_the_next_step_has_a_drive_of_its_own() -> None:
    stuck = {"schemas": [{**GOAL, "gain": 0.0}], "stuck_after_s": 2.0, "until": [{"when": "stuck"}]}
    robot = driven(stuck, stuck, {"schemas": [GOAL]}, seconds=30.0)
    assert (robot.status, robot.steps) == ("done", ["a", "b", "c"])


def test_a_goal_is_reached_round_what_is_in_the_way() -> None:
    shield = World((), ((1.2, -0.5, 1.2, 0.5),))
    robot = driven({"schemas": [GOAL]}, world=shield, seconds=60.0)
    assert robot.status == "done"
    assert robot.clearance_m > 0.0
    straight = [{"name": "follow_valley", "gain": 0.0}, {"name": "leave_canyon", "gain": 0.0}]
    robot = driven({"schemas": [GOAL, *straight], "stuck_after_s": 5.0}, world=shield, seconds=60.0)
    assert "stuck 1.4 m short of the goal" in robot.reason


@pytest.mark.parametrize(
    ("name", "least"), [("follow_valley", 0.4), ("avoid_past", 0.01), ("noise", 0.4), ("swirl", 0.1)]
)
def test_schemas_that_lead_nowhere_turn_the_way_of_another(name: str, least: float) -> None:
    post, steps = World(((1.8, 0.1, 0.3),), ()), {"until": [{"when": "time", "after_s": 3.0}]}
    alone = driven({"schemas": [AHEAD], **steps}, world=post)
    robot = MissionRobot(mission({"schemas": [AHEAD, {"name": name, "gain": 0.4}], **steps}), post).drive(2.9)
    assert robot.result is not None
    length = {v.schema: math.hypot(v.x, v.y) for v in robot.result.vectors}[name]
    assert least <= length + 1e-9 <= 0.4 + 1e-6
    assert abs(robot.path[-1].theta - alone.path[len(robot.path) - 1].theta) > 0.005
    assert robot.clearance_m > 0.0


def test_helpers_do_not_move_a_robot_that_waits() -> None:
    away = {"name": "move_to_goal", "x_m": 3.0, "y_m": 0.0, "frame": "map"}
    robot = MissionRobot(mission({"schemas": [away, {"name": "noise"}, {"name": "avoid_past"}]}))
    for _ in range(20):
        robot.cycle()
    assert "does not know its place in the map" in robot.reason
    assert length_m(robot.path) == 0.0


def test_noise_alone_moves_the_robot_about() -> None:
    robot = driven({"schemas": [{"name": "noise", "gain": 0.5}], "until": [{"when": "way", "after_m": 1.0}]})
    assert robot.status == "done"


def test_driving_to_and_fro_is_no_progress_towards_a_place() -> None:
    robot = driven(
        {
            "schemas": [
                {"name": "move_ahead", "distance_m": 4.0},
                {"name": "wander", "gain": 1.5, "persistence_s": 1.0},
            ],
            "stuck_after_s": 20.0,
        },
        world=WALL, seconds=120.0,
    )  # fmt: skip
    assert robot.status == "held"
    assert length_m(robot.path) > 2.0


def test_gains_weigh_the_schemas_and_an_edit_in_between_counts() -> None:
    sideways = {"name": "move_ahead", "direction_deg": 90.0, "gain": 0.5}
    robot = driven(
        {"schemas": [AHEAD | {"gain": 0.5}, sideways], "until": [{"when": "way", "after_m": 2.0}]}, seconds=20.0
    )
    assert robot.pose.theta == pytest.approx(math.pi / 4, abs=0.05)
    robot = MissionRobot(mission(until(when="way", after_m=2.0))).drive(1.0)
    robot.put(edited(robot.mission, MissionEdit("hold")))
    robot.cycle()
    assert "held by the operator" in robot.reason
    assert robot.result is not None
    assert robot.result.vectors == ()
