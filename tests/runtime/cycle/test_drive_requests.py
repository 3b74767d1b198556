"""Tests of drive requests through the whole step: what moves the robot, what stops it, and that nothing resumes."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from behaviors.move_to_goal import Goal
from behaviors.response import Response
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate
from config.load import load_settings
from drivers.driver import LineState
from drivers.messages import Flags, Pose
from runtime.cycle.drive_requests import (
    GOAL_SLEW_M_S,
    GoalPlace,
    Legs,
    first_request,
    goal_place,
)
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import NO_MAP, STANDSTILL, DriveRequest, Order
from tests.runtime.cycle.requested_robot import FORWARD, arm, driving, hold_reason, near, robot
from tests.runtime.scripted_step import PERIOD_S


def test_without_a_drive_request_the_legs_are_driven() -> None:
    script = driving()
    record = script.request_drive(None)
    assert script.state.drive_request == Legs()
    assert record.command == near(0.3, 0.0)
    assert script.state.vectors == (
        Response("move_ahead", 1.0, 0.0), Response("avoid_static_obstacle", 0.0, 0.0), Response("sum", 1.0, 0.0),
    )  # fmt: skip
    assert hold_reason(script) == ""


@pytest.mark.parametrize("drive_request", [Legs(), Goal(3.0, 0.0), FORWARD], ids=["legs", "goal", "teleoperation"])
def test_no_drive_request_moves_a_robot_that_is_not_in_drive(drive_request: DriveRequest) -> None:
    script = robot()
    for line in (LineState.CLOSED, LineState.HANDSHAKE):
        assert script.request_drive(drive_request, line=line, firing=False, odometry=False).command is None
    for _ in range(20):
        assert script.request_drive(drive_request).command == STANDSTILL
    script.request_drive(drive_request, request=Request.HALT)
    for _ in range(20):
        record = script.request_drive(drive_request)
        assert (record.mode.mode, record.command) == (Mode.SAFE_STOP, None)
    assert script.state.vectors == ()


STOPS: list[dict[str, object]] = [
    {"request": Request.HALT},
    {"request": Request.DISARM},
    {"line": LineState.DOWN, "trouble": "the cable"},
    {"flags": Flags.BUMPER | Flags.LATCHED},
    {"rebooted": True},
]


@pytest.mark.parametrize("found", STOPS, ids=["halt", "disarm", "line", "bumper", "reboot"])
@pytest.mark.parametrize("drive_request", [Goal(30.0, 0.0), FORWARD], ids=["goal", "teleoperation"])
@pytest.mark.parametrize("at_once", [True, False], ids=["said as it stops", "said before"])
def test_after_a_stop_goal_and_teleoperation_do_not_resume(
    found: dict[str, object], drive_request: DriveRequest, at_once: bool
) -> None:
    script = driving()
    assert script.request_drive(drive_request).command != STANDSTILL
    script.request_drive(drive_request if at_once else None, **found)
    assert script.state.mode.mode is not Mode.DRIVE
    assert script.state.drive_request == TELEOPERATION_ENDED
    assert arm(script).command == STANDSTILL
    for _ in range(20):
        record = script.request_drive(None)
        assert (record.mode.mode, record.command) == (Mode.DRIVE, STANDSTILL)
    assert "no velocity arrives from an operator" in hold_reason(script)
    assert script.request_drive(Legs()).command == near(0.3, 0.0)


def test_the_legs_resume_after_a_re_arm() -> None:
    script = driving()
    script.request_drive(None, request=Request.HALT)
    assert script.state.drive_request == Legs()
    assert arm(script).command == near(0.3, 0.0)


def test_a_stop_by_the_arbiter_drops_the_goal() -> None:
    script = driving()
    script.request_drive(Goal(30.0, 0.0))
    while script.state.mode.mode is Mode.DRIVE:
        script.pose = replace(script.pose, x=script.pose.x + 0.015)
        record = script.request_drive(None, firing=False)
    assert "ring has not reported" in str(record.mode.reason)
    assert script.state.drive_request == TELEOPERATION_ENDED
    assert script.state.vectors == ()


def test_a_goal_set_before_arming_is_driven_after_it() -> None:
    script = robot()
    script.request_drive(Goal(9.0, 0.0))
    assert arm(script).command == near(0.3, 0.0)
    assert script.state.vectors[0].schema == "follow_valley"


def test_a_disarmed_robot_stands_in_ready_and_can_be_armed_again() -> None:
    script = driving()
    record = script.request_drive(None, request=Request.DISARM)
    assert (record.mode.mode, record.command) == (Mode.READY, STANDSTILL)
    assert "disarmed by the operator" in str(record.mode.reason)
    for _ in range(20):
        record = script.request_drive(None)
        assert (record.mode.mode, record.command) == (Mode.READY, STANDSTILL)
    assert arm(script).mode.reason is None


def test_disarming_during_arming_ends_it_and_sets_the_latch_again() -> None:
    script = robot()
    script.request_drive(None)
    assert script.request_drive(None, request=Request.ARM).command is Order.RELEASE
    assert script.request_drive(None, request=Request.DISARM).command == STANDSTILL
    for _ in range(40):
        assert script.request_drive(None).command == STANDSTILL
    script.request_drive(None, request=Request.HALT)
    assert script.request_drive(None, request=Request.ARM).command is Order.RELEASE
    record = script.request_drive(None, request=Request.DISARM)
    assert (record.mode.mode, record.command) == (Mode.SAFE_STOP, Order.HALT)
    for _ in range(40):
        assert script.request_drive(None).command is None


@pytest.mark.parametrize(
    "drive_request",
    [
        Goal(math.nan, 0.0), Goal(0.0, math.inf), Goal(1e5, 0.0), Teleoperate(math.nan, 0.0),
        Teleoperate(0.0, -math.inf), Teleoperate(0.1, 0.0, math.nan), Teleoperate(0.1, 0.0, -1.0),
    ],
)  # fmt: skip
def test_an_invalid_drive_request_changes_nothing(drive_request: DriveRequest) -> None:
    script = driving()
    assert script.request_drive(Goal(9.0, 0.0)).command == near(0.3, 0.0)
    record = script.request_drive(drive_request)
    assert record.command == near(0.3, 0.0)
    assert script.state.drive_request == Goal(9.0, 0.0)
    assert record.inputs.drive_request is drive_request


def test_a_goal_in_the_map_moves_smoothly_with_it() -> None:
    goal, frame = Goal(2.0, 1.0, frame="map"), Pose(0.5, 0.0, math.pi / 2)
    assert goal_place(Goal(2.0, 1.0), None, None, PERIOD_S) == GoalPlace(2.0, 1.0)
    assert goal_place(goal, None, None, PERIOD_S) is None
    place = goal_place(goal, None, frame, PERIOD_S)
    assert place == GoalPlace(pytest.approx(-0.5), pytest.approx(2.0))  # type: ignore[arg-type]
    corrected, steps = Pose(0.8, 0.4, math.pi / 2), 0
    while place is not None and (not place.is_exact or steps == 0):
        before, place = place, goal_place(goal, place, corrected, PERIOD_S)
        assert place is not None
        assert math.hypot(place.x - before.x, place.y - before.y) <= GOAL_SLEW_M_S * PERIOD_S + 1e-12
        steps += 1
    assert place == GoalPlace(pytest.approx(-0.2), pytest.approx(2.4))  # type: ignore[arg-type]
    assert steps == math.ceil(0.5 / (GOAL_SLEW_M_S * PERIOD_S))
    assert goal_place(goal, place, None, PERIOD_S) is None


def test_without_a_map_a_goal_in_it_is_refused() -> None:
    script = driving()
    record = script.request_drive(Goal(3.0, 0.0, frame="map"))
    assert [refused.why for refused in record.refused] == [NO_MAP]
    assert script.state.drive_request == Legs()


def test_a_configured_goal_is_driven_to_from_the_start() -> None:
    settings = load_settings("hallway", ["goal.x_m=2.0", "goal.y_m=1.0", "goal.frame=map"])
    assert first_request(settings) == Goal(2.0, 1.0, frame="map")
    assert first_request(load_settings("hallway")) == Legs()
