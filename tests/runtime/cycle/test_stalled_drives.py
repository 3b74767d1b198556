"""In DRIVE no 25 s without progress have no reason: random robots before walls, by every request."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from behaviors.memory.way_progress import GROUND_M, WayProgress
from behaviors.missions.mission import Mission
from behaviors.move_ahead import Leg
from behaviors.move_to_goal import Goal
from behaviors.no_go import zones_of
from config.load import load_settings
from config.places import PlacesConfig, SpeedAreaConfig
from drivers.messages import Pose
from runtime.cycle.drive_requests import Legs
from runtime.cycle.drive_state import Moment
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import fresh_state
from runtime.cycle.stalled_drives import observe_way
from runtime.cycle.step import STANDSTILL
from runtime.cycle.velocity_limits import ZoneLimits
from tests.random_robots import random_furnished_room, random_robot
from tests.runtime.emulated_run import Run

pytestmark = pytest.mark.compiled

SILENT_MAX_S = 25.0
FAR_M = 30.0
"""A goal so far away lies behind the walls of every room."""


def gains(request: str, begin: Pose, start: Pose, pose: Pose, best_m: float) -> float | None:
    """Return the new least distance if the robot has made progress since `begin`, by the truth; None otherwise."""
    if request == "wander":
        return 0.0 if math.hypot(pose.x - begin.x, pose.y - begin.y) >= GROUND_M + 0.1 else None
    here = start.inverse().compose(pose)
    left_m = -here.x if request == "legs" else math.hypot(FAR_M - here.x, here.y)
    return left_m if left_m <= best_m - GROUND_M - 0.02 else None


def silent_s(robot: int, room: int, request: str, seconds: float) -> tuple[float, list[str]]:
    """Return the longest time in DRIVE without progress and without a reason, s, and the reasons that were given."""
    settings = random_robot(robot)
    run = Run(settings, random_furnished_room(room, settings), 100 * robot + room)
    run.state = fresh_state(settings, recognises=False)
    if request == "wander":
        mission = load_settings("room", mission="wander").mission
        assert mission is not None
        run.state.drive_request = Mission(mission)
    elif request == "goal":
        run.state.drive_request = Goal(FAR_M, 0.0)
    start = begin = run.robot.truth.pose
    best_m, since_s, longest_s, reasons = math.inf, 0.0, 0.0, [""]
    while run.run_s < seconds:
        run.cycle(Request.ARM if run.mode is Mode.SAFE_STOP else None)
        pose, reason = run.robot.truth.pose, run.state.hold_reason
        gained_m = gains(request, begin, start, pose, best_m)
        if gained_m is not None or reason is not None or run.mode is not Mode.DRIVE:
            best_m, begin, since_s = min(best_m, gained_m or math.inf), pose, run.run_s
        longest_s = max(longest_s, run.run_s - since_s)
        if reason is not None and reason != reasons[-1]:
            reasons.append(reason)
    return longest_s, reasons[1:]


def assert_explained(
    robots: range, rooms: range, seconds: float, requests: tuple[str, ...] = ("legs", "wander", "goal")
) -> str:
    worst_s, stalled = 0.0, 0
    for robot in robots:
        for room in rooms:
            for request in requests:
                longest_s, reasons = silent_s(robot, room, request, seconds)
                assert longest_s < SILENT_MAX_S, (
                    f"robot {robot}, room {room}, {request}: {longest_s:.1f} s, {reasons}"
                )
                worst_s, stalled = (
                    max(worst_s, longest_s),
                    stalled + any(" for 20 s: " in reason for reason in reasons),
                )
    assert stalled > 0
    drives = len(robots) * len(rooms) * len(requests)
    return f"{drives} drives of {seconds:g} s: at most {worst_s:.1f} s without progress and reason; {stalled} stalled"


def test_no_drive_is_stalled_without_a_reason(measured: Callable[[str], None]) -> None:
    measured(assert_explained(range(1), range(1), 42.0, ("goal",)))  # legs: see below


@pytest.mark.soak
def test_no_drive_is_stalled_without_a_reason_in_many_rooms(measured: Callable[[str], None]) -> None:
    measured(assert_explained(range(200, 220), range(3), 120.0))


@pytest.mark.parametrize("limited", [False, True])
def test_a_speed_area_is_no_reason_to_say_that_the_drive_is_stalled(limited: bool) -> None:
    """At .02 m/s a robot gains .4 m in 20 s: too little where it may drive faster, and all that a limit allows."""
    settings = load_settings("room")
    area = SpeedAreaConfig(vertices_m=((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)), speed_max_m_s=0.02)
    zones = zones_of(PlacesConfig(speed_area=(area,) if limited else ()))
    leg, progress, reasons = Leg.starting_at(Pose(0.0, 0.0, 0.0)), WayProgress(), set[str | None]()
    for k in range(1200):
        now = Moment(0.05 * k, zones=ZoneLimits(zones, Pose(1.0, 1.0, 0.5), is_void=False))
        pose = Pose(0.02 * now.run_s, 0.0, 0.0)
        progress, leg, reason = observe_way(Legs(), leg, progress, None, pose, 0.0, now, settings, stands=False)
        reasons.add(reason)
    assert (reasons == {None}) == limited


def test_legs_before_a_wall_are_given_up_and_say_so() -> None:
    """A robot that drives to and fro before a wall ends its leg, and stands with the reason."""
    settings = random_robot(0)
    run = Run(settings, random_furnished_room(0, settings), 5)
    run.state = fresh_state(settings, recognises=False)
    reasons = []
    while run.run_s < 90.0 and not (run.state.leg is not None and run.state.leg.done):
        run.cycle(Request.ARM if run.mode is Mode.SAFE_STOP else None)
        reasons.append(run.state.hold_reason)
    run.cycle()
    assert run.state.leg is not None
    assert run.state.leg.gave_up
    assert any(reason and "farther along the leg for 20 s" in reason for reason in reasons)
    run.until(run.run_s + 1.0)
    assert run.state.hold_reason is not None
    assert "the leg has ended" in run.state.hold_reason
    assert all(record.command == STANDSTILL for record in run.records[-10:])
