"""The final heading of goals and routes, by the emulator's truth: synchro and differential bases turn to it."""

from __future__ import annotations

import math

import pytest

from behaviors.missions.mission import Mission, route
from behaviors.move_to_goal import Goal
from config.load import load_settings
from config.settings import GoalConfig, Settings
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Pose, Twist, wrap_angle
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.closed_loop import simulate

PLACES = ((0.6, 0.0, 90.0), (0.6, 0.5, -135.0))
"""Waypoints x, y (m) and final heading (degrees) that the robot reaches in the room without a detour."""
NEAR_M, ALIGNED_DEG = 0.2, 6.0
"""By truth: the success radius and the turn's tolerance, with the errors of the odometry beside them."""


def settings_of(robot: str, **drive: object) -> Settings:
    """Return the settings of a robot in the room, driving a goal or a mission."""
    settings = load_settings(
        "room", ["perception.method=paper", "behaviors.arbiter.base_velocity_m_s=0.5"], robot=robot
    )
    return settings.model_copy(update=drive)


def stands(settings: Settings, seconds: float) -> list[tuple[float, float, float]]:
    """Return where the robot truly stood, by how it was placed at the start: x, y (m) and heading (degrees)."""
    assert settings.world is not None
    found: list[tuple[float, float, float]] = []
    begin: list[Pose] = []
    done: list[bool] = []

    def on_state(record: CycleRecord, state: State, start: Pose) -> None:
        request = state.drive_request
        done.append(
            request.progress.changes > sum(done) if isinstance(request, Mission) else
            isinstance(request, Goal) and request.aligned and record.command == Twist(0.0, 0.0)
        )  # fmt: skip
        begin[:] = [start]

    def on_cycle(_record: CycleRecord, truth: GroundTruth) -> None:
        if done and done[-1]:
            at = begin[0].inverse().compose(truth.pose)
            found.append((at.x, at.y, math.degrees(at.theta)))

    simulate(settings, settings.world, 3, seconds, on_cycle, on_state=on_state)
    return found


def check(found: tuple[float, float, float], place: tuple[float, float, float]) -> None:
    x, y, heading_deg = found
    assert math.dist((x, y), place[:2]) < NEAR_M
    assert abs(math.degrees(wrap_angle(math.radians(heading_deg - place[2])))) < ALIGNED_DEG


@pytest.mark.compiled
@pytest.mark.parametrize("robot", ["p3dx", pytest.param("denning", marks=pytest.mark.soak)])
def test_a_goal_is_left_with_its_final_heading(robot: str) -> None:
    goal = GoalConfig(x_m=0.6, y_m=0.2, heading_deg=-120.0)
    found = stands(settings_of(robot, goal=goal), 14.0)
    assert len(found) > 1, "it never stood there"
    check(found[-1], (0.6, 0.2, -120.0))


@pytest.mark.compiled
@pytest.mark.parametrize("robot", ["denning", pytest.param("p3dx", marks=pytest.mark.soak)])
def test_each_waypoint_of_a_route_is_left_with_its_final_heading(robot: str) -> None:
    found = stands(settings_of(robot, mission=route(PLACES, "odom").plan), 16.0)
    assert len(found) == len(PLACES)
    for at, place in zip(found, PLACES, strict=True):
        check(at, place)
