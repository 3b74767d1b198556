"""Drives of robots with few sensors from goal to goal: how they are counted."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from behaviors.move_to_goal import Goal
from bench.few_sensors import (
    AWAY_M,
    NO_WAY,
    few_sensors_table,
    make_world,
    measure,
    next_goal,
    run_room,
    settings_of,
)
from bench.trials.navigation_trials import closed_room_m
from bench.trials.shortest_way import free_space
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from runtime.cycle.drive_requests import DriveRequest


def test_goals_lie_far_away_and_are_free() -> None:
    settings, world = settings_of("hobby3"), make_world(3, "specular")
    assert world.drum
    assert len(world.box) == 2
    room_m = closed_room_m(settings)
    asked = next_goal(np.random.default_rng(0), free_space(world, room_m), (-3.0, 0.0), (5.0, 4.0))
    assert asked is not None
    (there, way_m), scene = asked, compile_scene(world)
    assert AWAY_M <= math.dist(there, (-3.0, 0.0)) <= 1.01 * way_m
    assert clearance(*there, scene.circles, scene.segments) > room_m - 0.15


def test_where_no_place_is_so_far_away_the_farthest_is_the_goal() -> None:
    """A robot that gave up in the middle of a room got no further goal, and eight minutes were not driven."""
    settings, world = settings_of("round-12"), make_world(5001, "cone")
    asked = next_goal(np.random.default_rng(0), free_space(world, closed_room_m(settings)), (1.33, -0.35), (3.2, 4.4))
    assert asked is not None
    assert 4.5 < math.dist(asked[0], (1.33, -0.35)) < AWAY_M


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("seconds", "arrived", "way_m"), [(8.0, 0, 0.5), pytest.param(98.0, 1, 15.0, marks=pytest.mark.soak)]
)
def test_a_drive_is_counted(seconds: float, arrived: int, way_m: float) -> None:
    """In a room in which a robot that waited for a quiet second before each start gave its second goal up."""
    result = run_room("hobby8", "cone", 5002, seconds)
    assert (result.contacts, result.reasons) == (0, {})
    assert result.arrived >= arrived
    assert result.way_m > way_m
    assert few_sensors_table([result]).row_count == 1


def test_a_small_robot_does_not_begin_within_a_box() -> None:
    """No way led out of it, and no goal was counted, reached or missed."""
    requests = list[DriveRequest]()
    run_room("hobby3", "cone", 8600, 0.5, lambda _, state, __: requests.append(state.drive_request))
    assert isinstance(requests[-1], Goal)


def test_a_room_that_leaves_a_robot_no_way_is_counted_as_that(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.few_sensors.next_goal", lambda *_: None)
    result = run_room("hobby3", "cone", 8600, 0.5)
    assert (result.goals, result.reasons) == (0, {NO_WAY: 1})


@pytest.mark.soak
@pytest.mark.compiled
def test_three_sensors_in_front_touch_nothing_and_arrive(measured: Callable[[str], None]) -> None:
    results = measure(["hobby3"], range(300, 305), 300.0, lambda _: None)
    assert sum(one.contacts for one in results) == 0
    goals, arrived = sum(one.goals for one in results), sum(one.arrived for one in results)
    assert arrived >= 0.8 * goals
    measured(
        f"{len(results)} rooms, {arrived} of {goals} goals, {sum(one.way_m for one in results):.0f} m: no contact"
    )
