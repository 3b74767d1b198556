"""A drive to a goal over its cycles: quanta of the look-ahead, what is kept and recorded, and when it is given up."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from behaviors.arbiter import Drive
from behaviors.leave_canyon import leave_canyon
from behaviors.move_to_goal import Goal
from behaviors.no_go import with_no_go, zones_of
from behaviors.response import Response
from config.load import load_settings
from config.places import NoGoLineConfig, PlacesConfig
from drivers.messages import Pose, Twist
from perception.percept import OccupancyWindow, Percept
from runtime.cycle.drive_requests import Legs
from runtime.cycle.goal_drive import GoalDrive, _beside, drive_to_goal
from runtime.cycle.step import STANDSTILL
from runtime.recording.channels import decode, encode
from runtime.recording.schema import Keyframe, carried_state, keyframe, state_fields
from tests.behaviors.views import EVERYWHERE
from tests.runtime.cycle.requested_robot import RequestedRobot, driving, hold_reason

FAR = Goal(5.5, 0.0)


def goal_drive(script: RequestedRobot) -> GoalDrive:
    assert script.state.goal_drive is not None
    return script.state.goal_drive


def test_vfh_plus_answers_at_once_and_the_look_ahead_follows_quantum_by_quantum() -> None:
    script = driving()
    script.quanta = 3
    record = script.request_drive(FAR)
    assert next(entry[0] for entry in script.log if isinstance(entry, tuple)) == "command", "before any quantum"
    assert record.quanta == 3
    found = []
    while not goal_drive(script).search.is_done:
        found.append(len(goal_drive(script).search.nodes))
        script.request_drive(None)
    assert all(earlier < later for earlier, later in pairwise(found))
    assert goal_drive(script).search.way
    assert goal_drive(script).search.reaches


@pytest.mark.parametrize("offset_m", [0.0, 0.03, 0.06, 0.09])
def test_a_goal_beside_a_no_go_line_is_not_said_to_have_something_stand_there(offset_m: float) -> None:
    settings, goal = load_settings("hallway"), Goal(0.5, offset_m)
    away_m = settings.body.radius_m + 0.01
    grid = OccupancyWindow(np.full((64, 64), 0.5, np.float32), -3.2, -3.2, 0.1)
    seen = Percept(Pose(0.0, 0.0, 0.0), np.array([[0.5, offset_m + away_m]]), EVERYWHERE, occupancy=grid)
    assert f"what stands there is {away_m:.2f} m from" in _beside(seen, goal, 0.5, settings).goal_fault
    line = NoGoLineConfig(points_m=((-3.0, offset_m - away_m), (3.0, offset_m - away_m)))
    zones = zones_of(PlacesConfig(no_go_line=(line,)))
    fenced = with_no_go(replace(seen, obstacles=np.zeros((0, 2))), zones, Pose(0.0, 0.0, 0.0), away_m - 0.1)
    assert fenced.no_go > 0
    assert f"the no-go line there is {away_m:.2f} m from" in _beside(fenced, goal, 0.5, settings).goal_fault


def test_without_a_look_ahead_it_is_vfh_plus_and_without_a_gain_move_to_goal() -> None:
    script = driving("behaviors.follow_valley.look_ahead_nodes_max=0")
    script.request_drive(FAR)
    assert (script.state.vectors[0].schema, goal_drive(script).search.nodes) == ("follow_valley", ())
    script = driving("behaviors.follow_valley.follow_valley_gain=0.0")
    script.request_drive(FAR)
    assert (script.state.vectors[0].schema, goal_drive(script).search.nodes) == ("move_to_goal", ())


def test_a_robot_that_does_not_come_on_gives_up_with_the_reason_and_a_new_request_starts_anew() -> None:
    for gain in ("0.0", "1.0"):
        script = driving(
            "behaviors.move_to_goal.stuck_after_s=2.0", f"behaviors.follow_valley.follow_valley_gain={gain}"
        )
        script.request_drive(FAR)
        for k in range(42):
            record = script.move_to(Pose(0.2 * (k % 2), 0.0, 0.0))
        assert record.command == STANDSTILL
        assert "stuck 5.5 m short of the goal" in hold_reason(script)
        assert script.move_to(Pose(1.0, 0.0, 0.0)).command == STANDSTILL, "carried on, it does not set out again"
        assert script.request_drive(FAR).command != STANDSTILL
        assert hold_reason(script) == ""


def test_other_requests_and_stops_forget_the_drive() -> None:
    script = driving()
    script.request_drive(FAR)
    script.request_drive(Legs())
    assert script.state.goal_drive is None
    script.request_drive(FAR)
    script.pose = Pose(math.nan, 0.0, 0.0)
    script.request_drive(None, firing=False)
    assert script.state.goal_drive is None


def test_a_keyframe_in_the_middle_of_a_look_ahead_goes_on_to_the_bit() -> None:
    script, other = driving(), driving()
    for each in (script, other):
        each.quanta = 2
        each.request_drive(FAR)
    frame = decode(Keyframe, encode(keyframe(7, 0.35, carried_state(script.state), {})))
    found = state_fields(frame)
    assert repr(found["goal_drive"]) == repr(goal_drive(script))
    assert not goal_drive(script).search.is_done
    other.state.goal_drive = found["goal_drive"]
    for _ in range(20):
        assert repr(script.request_drive(None)) == repr(other.request_drive(None))
    assert repr(script.state.goal_drive) == repr(other.state.goal_drive)


@pytest.mark.promise("P21")
@pytest.mark.parametrize(
    ("path", "poison"),
    [
        (("search", "nodes", 1, "x"), 1e308), (("search", "nodes", 1, "parent"), 5),
        (("search", "waiting", 0, 1), 99),
        (("search", "nodes", 0, "parent"), -2), (("search", "goal", 0), "NaN"), (("valley", "blocked"), "01"),
        (("valley", "direction_rad"), "Infinity"), (("progress", "nearest_m"), "NaN"), (("searched_run_s",), 1e308),
        (("search", "passed", 0, 0), 10**30), (("progress", "moved_run_s"), "-Infinity"),
    ],
)  # fmt: skip
def test_an_impossible_drive_in_a_keyframe_is_refused(path: tuple[Any, ...], poison: object) -> None:
    script = driving()
    script.quanta = 2
    script.request_drive(FAR)
    tree = json.loads(encode(keyframe(7, 0.35, carried_state(script.state), {})))
    at = tree["state"]["goal_drive"]
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = poison
    with pytest.raises(ValidationError):
        decode(Keyframe, json.dumps(tree).encode())


def test_a_goal_that_is_corrected_gets_another_way() -> None:
    script = driving()
    script.request_drive(FAR)
    first = goal_drive(script)
    assert first.search.is_done
    script.state.drive_request = replace(FAR, y=1.0)
    script.request_drive(None)
    assert goal_drive(script).search.goal == (5.5, 1.0)


def test_on_its_way_the_robot_turns_no_faster_than_it_should() -> None:
    for rate, expected in (("0.5", 0.5), ("0.2", 0.2), ("20.0", 1.0)):
        at_once = "behaviors.move_to_goal.turn_acceleration_max_rad_s2=100"
        script = driving(f"behaviors.move_to_goal.turn_rate_max_rad_s={rate}", at_once)
        command = script.request_drive(Goal(-5.0, 0.5)).command
        assert isinstance(command, Twist)
        assert abs(command.w) == expected


def test_on_its_way_its_turning_rate_changes_no_faster_than_it_should() -> None:
    """An echo that comes and goes turned the robot to and fro."""
    script, rates = driving(), [0.0]
    script.request_drive(Goal(5.0, 2.0))
    for k in range(60):
        theta = 0.5 + 0.4 * (-1) ** (k // 2)
        command = script.move_to(Pose(0.0, 0.0, theta)).command
        assert isinstance(command, Twist)
        rates.append(command.w)
    config, step_s = script.settings.behaviors.move_to_goal, 1.0 / script.settings.cycle.rate_hz
    changes = [abs(b - a) for a, b in pairwise(rates[1:])]
    assert max(changes) == pytest.approx(config.turn_acceleration_max_rad_s2 * step_s)
    assert max(map(abs, rates)) < 0.5 * config.turn_rate_max_rad_s


@pytest.mark.parametrize("push", [0.0, 0.01])
def test_pushed_by_an_obstacle_the_robot_turns_at_once(push: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Turning little by little it touched the ends of walls that leave it .12 m."""
    monkeypatch.setattr("runtime.cycle.goal_drive._pushes", lambda *_: Response("avoid_static_obstacle", -push, 0.0))
    script = driving()
    command = script.request_drive(Goal(-5.0, 0.5)).command
    assert isinstance(command, Twist)
    rate = script.settings.behaviors.move_to_goal.turn_rate_max_rad_s
    assert command.w == rate if push else command.w < 0.2 * rate


def test_a_half_turn_on_the_spot_is_no_standing_that_begins_a_detour(monkeypatch: pytest.MonkeyPatch) -> None:
    script, waited = driving(), list[tuple[float, bool]]()

    def seen(*arguments: Any, waits: bool, **named: Any) -> Any:
        waited.append((script.run_s, waits))
        return leave_canyon(*arguments, waits=waits, **named)

    monkeypatch.setattr("runtime.cycle.goal_drive.leave_canyon", seen)
    script.request_drive(FAR)
    begin_s, until_s = script.run_s, 5.0 + math.pi / script.settings.behaviors.move_to_goal.turn_rate_max_rad_s
    while script.run_s < begin_s + until_s + 1.0:
        script.request_drive(None)
    stood = [(run_s - begin_s, waits) for run_s, waits in waited[1:]]
    assert all(waits is (stood_s < until_s) for stood_s, waits in stood if abs(stood_s - until_s) > 0.1)


def test_what_stands_at_the_goal_is_believed_from_near_only() -> None:
    """From afar an echo at the goal may be of anything in its beam: the drive goes on."""
    script = driving("behaviors.move_to_goal.stuck_after_s=2.0")
    script.request_drive(Goal(3.5, 0.0))
    for k in range(60):
        script.move_to(Pose(0.35 * (k // 10 % 2), 0.0, 0.0))
    assert goal_drive(script).progress.given_up is None


def test_a_robot_that_has_stood_turns_to_its_way_before_the_next_look_ahead_and_counts_as_stuck_only_then() -> None:
    script = driving("behaviors.move_to_goal.stuck_after_s=9.0")
    script.request_drive(Goal(-5.0, 0.5))
    started, turned = list[float | None](), [0.015 * k for k in range(200)]
    for theta in turned:
        script.move_to(Pose(0.0, 0.0, theta))
        started.append(goal_drive(script).searched_run_s)
        assert goal_drive(script).progress.given_up is None
    assert len(set(started[100:150])) == 1, "it has stood for 5 s, and turns"
    assert len(set(started[:100])) > 3
    assert started[-1] not in started[:150], "it has turned"


def test_a_robot_that_has_looked_to_a_blind_side_turns_back_as_fast() -> None:
    """Slowing down as on its way, it turned on by a quarter, and back for seven seconds."""
    settings = load_settings("office", robot="hobby3")
    looking = replace(EVERYWHERE, unknown_rad=np.array([1.2]))
    drive, rates = None, list[float]()
    for view in (looking, EVERYWHERE, EVERYWHERE):
        percept = Percept(Pose(0.0, 0.0, 0.5 if drive else 0.0), np.empty((0, 2)), view)
        _, drive, _, decision, _ = drive_to_goal(FAR, drive, percept, 1.0, (), settings)
        assert isinstance(decision, Drive)
        rates.append(decision.twist.w)
    limit = settings.behaviors.move_to_goal.turn_rate_max_rad_s
    assert rates[0] > 2.0 * limit
    assert rates[1] == rates[2] == pytest.approx(-0.5 * settings.behaviors.arbiter.turn_gain_per_s)
