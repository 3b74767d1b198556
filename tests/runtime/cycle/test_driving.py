"""What each drive request leads to: the schemas that it uses, and the velocity that follows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import TELEOPERATION_ENDED
from drivers.messages import Pose, Twist
from perception.pipeline import Perception
from runtime.cycle.drive_requests import GOAL_SLEW_M_S, GoalPlace, Legs
from runtime.cycle.driving import NO_PLACE
from runtime.cycle.modes import Mode
from runtime.cycle.step import STANDSTILL, DriveRequest, Order
from tests.runtime.cycle.requested_robot import FORWARD, driving, hold_reason, near
from tests.runtime.scripted_step import PERIOD_S


def test_a_goal_is_approached_and_the_robot_stands_there() -> None:
    script = driving(
        "behaviors.move_to_goal.success_radius_m=0.2", "behaviors.move_to_goal.turn_acceleration_max_rad_s2=100"
    )
    rate = script.settings.behaviors.move_to_goal.turn_rate_max_rad_s
    assert script.request_drive(Goal(0.0, 5.0)).command == near(0.0, rate)
    to_goal = script.state.vectors[0]
    assert to_goal.schema == "follow_valley"
    assert (to_goal.x, to_goal.y) == pytest.approx((0.0, 1.0))
    assert script.move_to(Pose(0.0, 1.0, math.pi / 2)).command == near(0.3, 0.0)
    speeds = []
    for y in (4.1, 4.4, 4.7):  # farther apart than the ring compares its echoes: those of this robot do not change
        command = script.move_to(Pose(0.0, y, math.pi / 2)).command
        assert isinstance(command, Twist)
        speeds.append(command.v)
    assert all(later < earlier for earlier, later in pairwise(speeds)), "it comes in slowly"
    assert hold_reason(script) == ""
    record = script.move_to(Pose(0.0, 4.9, math.pi / 2))
    assert (record.mode.mode, record.command) == (Mode.DRIVE, STANDSTILL)
    assert hold_reason(script) == "the goal (0.00 m, 5.00 m) is reached"
    assert script.move_to(Pose(0.0, 3.0, 0.0)).command == STANDSTILL, "pushed away it does not set out again"
    command = script.request_drive(Goal(0.0, 5.0)).command
    assert command != STANDSTILL, "requested again, it drives"
    assert hold_reason(script) == ""


def test_a_goal_with_a_final_heading_is_turned_to_there_once() -> None:
    script = driving("behaviors.move_to_goal.success_radius_m=0.2")
    goal = Goal(0.0, 2.0, heading=-math.pi / 2 - 6.0 * math.pi)
    script.request_drive(goal)
    turn = script.move_to(Pose(0.0, 1.9, math.pi / 2 + 0.1)).command
    assert isinstance(turn, Twist)
    assert (turn.v, turn.w > 0.0) == (0.0, True), "it turns on the spot, the short way round"
    assert hold_reason(script) == ""
    assert script.state.drive_request == replace(goal, reached=True)
    assert script.move_to(Pose(0.0, 1.9, -math.pi / 2 + 0.04)).command == STANDSTILL
    assert hold_reason(script) == "the goal (0.00 m, 2.00 m), heading -1170°, is reached"
    assert script.move_to(Pose(0.0, 1.9, 0.0)).command == STANDSTILL, "turned away it does not turn back"


def test_teleoperation_drives_while_velocities_arrive_and_stops_within_a_quarter_second() -> None:
    script = driving()
    begin_s = script.run_s + PERIOD_S
    for _ in range(10):
        record = script.request_drive(FORWARD)
        assert record.command == near(0.2, 0.1)
        assert hold_reason(script) == ""
    last_s = script.run_s
    assert last_s - begin_s > 0.4, "longer than one velocity is valid"
    while (record := script.request_drive(None)).command != STANDSTILL:
        assert record.command == near(0.2, 0.1)
    assert 0.19 < script.run_s - last_s < 0.251
    assert record.mode.mode is Mode.DRIVE
    assert "no velocity arrives from an operator" in hold_reason(script)
    assert script.state.drive_request == TELEOPERATION_ENDED
    for _ in range(50):
        assert script.request_drive(None).command == STANDSTILL
    assert script.request_drive(FORWARD).command != STANDSTILL


def test_teleoperation_is_limited_by_echoes_and_by_the_validity_of_a_velocity() -> None:
    """3 m of free space; the schema of the settings may be switched off, the clearance may not."""
    for avoid in ("true", "false"):
        script = driving(f"behaviors.teleoperation.avoid={avoid}", "behaviors.arbiter.clearance_m=3.0")
        assert script.request_drive(FORWARD).command == near(0.0, 0.1)
        assert hold_reason(script).startswith("blocked by an obstacle 3.00 m from the robot's edge, 0° left of")
        assert [r.schema for r in script.state.vectors] == [
            "teleoperation", *(["avoid_static_obstacle"] if avoid == "true" else []), "sum",
        ]  # fmt: skip
    script = driving()
    script.request_drive(replace(FORWARD, valid_s=0.12))
    assert script.request_drive(None).command != STANDSTILL
    assert script.request_drive(None).command == STANDSTILL


def test_legs_that_are_done_begin_again_on_request() -> None:
    script = driving("behaviors.move_ahead.distance_m=1.0", "behaviors.move_ahead.at_end=stop")
    assert script.move_to(Pose(1.1, 0.0, 0.0)).command == STANDSTILL
    assert hold_reason(script) == "the leg is done"
    assert script.request_drive(None).command == STANDSTILL
    assert script.request_drive(Legs()).command == near(0.3, 0.0)
    script.move_to(Pose(1.5, 0.0, 0.0))
    script.request_drive(Goal(9.0, 0.0))
    script.request_drive(Legs())
    assert script.move_to(Pose(2.0, 0.0, 0.0)).command != STANDSTILL, "one under way goes on"
    assert script.move_to(Pose(2.2, 0.0, 0.0)).command == STANDSTILL


@pytest.mark.parametrize("drive_request", [Legs(), Goal(9.0, 0.0), FORWARD], ids=["legs", "goal", "teleoperation"])
def test_vectors_of_a_stop_are_not_shown(drive_request: DriveRequest) -> None:
    script = driving()
    script.pose = Pose(math.nan, 0.0, 0.0)
    record = script.request_drive(drive_request, firing=False)
    assert (record.mode.mode, record.command) == (Mode.SAFE_STOP, Order.HALT)
    assert script.state.vectors == ()


DRIVES, CORRECTIONS, HELD_CYCLES = 40, 5, 3
WITH_MAP = "perception.localization.correct_drift=true"
"""A run without a map refuses goals in it."""


@pytest.mark.promise("P30")
def test_no_correction_of_the_map_makes_the_drive_jump(
    monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    rng = np.random.default_rng(0)
    frame = Pose(0.0, 0.0, 0.0)
    monkeypatch.setattr(Perception, "known_map_frame", lambda _: frame)
    monkeypatch.setattr(Perception, "localized", lambda _: "a place in the map")
    steps, changes = list[float](), list[float]()
    for _ in range(DRIVES):  # short ones: this robot does not move, and the motion monitor stops it for that
        frame = Pose(0.0, 0.0, 0.0)
        script = driving(WITH_MAP)
        script.request_drive(Goal(20.0, 0.0, frame="map"))
        places, turns = [GoalPlace(20.0, 0.0)], [0.0]
        for _ in range(CORRECTIONS):
            x, y, turn = (rng.uniform(-1.0, 1.0, 3) * (5.0, 5.0, math.pi / 6)).tolist()
            frame = Pose(x, y, turn)
            for _ in range(HELD_CYCLES):
                command = script.request_drive(None).command
                assert isinstance(command, Twist)
                assert script.state.goal_place is not None
                places.append(script.state.goal_place)
                turns.append(command.w)
        steps += [math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(places)]
        changes += [abs(b - a) for a, b in pairwise(turns)]
    assert max(steps) <= GOAL_SLEW_M_S * PERIOD_S * (1.0 + 1e-9)
    assert max(changes) < 0.01, "without a limit it is the whole rate of turn"
    measured(
        f"{DRIVES * CORRECTIONS} corrections: the goal moves by at most {max(steps) / PERIOD_S:.2f} m/s, "
        f"the rate of turn changes by at most {max(changes):.3f} rad/s from cycle to cycle"
    )


@pytest.mark.promise("P30")
def test_a_goal_in_the_map_is_driven_without_a_jump_and_only_where_the_place_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    frames: list[Pose | None] = [Pose(0.0, 0.0, 0.0)]
    monkeypatch.setattr(Perception, "known_map_frame", lambda _: frames[-1])
    monkeypatch.setattr(Perception, "localized", lambda _: "a place in the map")
    script = driving(WITH_MAP)
    assert script.request_drive(Goal(3.0, 0.0, frame="map")).command == near(0.3, 0.0)
    frames.append(Pose(0.0, 1.0, 0.0))
    turns = [script.request_drive(None).command for _ in range(17)]
    ways = [command.w for command in turns if isinstance(command, Twist)]
    assert len(ways) == 17
    assert 0.0 <= ways[0] < 0.05, "a correction by a metre turns the robot little by little"
    assert ways[-1] > 0.0
    assert max(abs(b - a) for a, b in pairwise(ways)) < 0.05
    assert script.state.drive_request == Goal(3.0, 0.0, frame="map")
    frames.append(None)
    assert script.request_drive(None).command == STANDSTILL
    assert hold_reason(script) == NO_PLACE
    frames.append(Pose(0.0, -1.0, 0.0))
    assert script.request_drive(None).command != STANDSTILL
    assert script.state.goal_place == GoalPlace(3.0, -1.0)
    record = script.move_to(Pose(3.0, -1.0, 0.0))
    assert record.command == STANDSTILL
    assert script.state.drive_request == Goal(3.0, 0.0, frame="map", reached=True)
