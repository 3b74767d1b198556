"""The robot creeps where it drives at what its ring has lost, and nowhere else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.arbiter import Drive, arbitrate
from behaviors.avoid_static_obstacle import avoid_static_obstacle
from behaviors.memory.commitment import Commitment
from behaviors.move_to_goal import Goal
from behaviors.response import Response
from behaviors.surroundings.clearance import stoppable_speed_m_s
from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from config.robot import PASSAGE_M
from drivers.messages import Firing, Twist
from perception.obstacle_echoes.blind_walls import TURN_DIRECTIONS, BlindWalls
from perception.obstacle_echoes.fresh_echoes import FreshEchoes
from perception.obstacle_echoes.unheard_echoes import ALONE, UnheardEchoes
from perception.percept import FieldOfView, Percept, Pose
from perception.sensor_mounts import mounts_array
from runtime.cycle.drive_requests import DriveRequest
from runtime.cycle.echo_watch import NOTHING_YET
from runtime.cycle.unheard_limit import CREEP_M_S, LOST, REMEMBERED, UNHEARD, limit_unheard, lost_ahead
from tests.behaviors.views import EVERYWHERE
from tests.perception.obstacle_echoes.test_blind_walls import heard

SETTINGS = load_settings("room", robot="denning")
RIM_M = SETTINGS.body.radius_m


def limited(
    twist: Twist, *places: tuple[float, float], silent: bool = False, slow_reason: str | None = None
) -> tuple[Twist, str | None]:
    percept = Percept(Pose(1.0, 0.0, 0.0), np.empty((0, 2)), EVERYWHERE)
    unheard = UnheardEchoes(np.zeros((max(1, len(places)), 3)))
    for echo, (x, y) in zip(unheard.records, places, strict=False):
        echo.state, echo.x, echo.y = ALONE, 1.0 + x, y
    unheard.silences[:] = len(unheard.records) if silent else 0
    return limit_unheard(twist, percept, unheard, SETTINGS, slow_reason)


@pytest.mark.parametrize("v", [0.3, -0.3])
def test_at_what_was_lost_it_creeps_on_the_same_curve(v: float) -> None:
    ahead = math.copysign(RIM_M + 0.1, v)
    twist, reason = limited(Twist(v, 0.6), (ahead, 0.0))
    assert twist.v == pytest.approx(math.copysign(CREEP_M_S, v))
    assert twist.w / twist.v == pytest.approx(0.6 / v)
    assert reason == UNHEARD
    assert limited(Twist(v, 0.6), (-ahead, 0.0)) == (Twist(v, 0.6), None)
    assert limited(Twist(v, 0.6), (ahead, 1.0)) == (Twist(v, 0.6), None)
    assert limited(Twist(v, 0.6)) == (Twist(v, 0.6), None)


@pytest.mark.parametrize("v", [0.3, 2.0, -2.0])
def test_at_what_other_sensors_heard_lately_it_drives_as_fast_as_it_can_stop(v: float) -> None:
    percept, side = Percept(Pose(1.0, 0.0, 0.0), np.empty((0, 2)), EVERYWHERE), math.copysign(1.0, v)
    speeds = []
    for away_m in (0.0, 0.2, 1.0, 3.0):
        unheard = UnheardEchoes(np.zeros((1, 3)))
        place = (1.0, 0.0, 0.0 if v > 0.0 else math.pi)
        heard_m = np.array([RIM_M + SETTINGS.behaviors.arbiter.clearance_m + away_m])
        unheard.remembered.enter(heard_m, np.zeros((1, 3)), place, 0.0, (0.1, 5.0, 0.2), np.ones(1, np.bool_))
        twist, reason = limit_unheard(Twist(v, 0.0), percept, unheard, SETTINGS, None)
        assert reason == (REMEMBERED if abs(v) > 1.0 or away_m == 0.0 else None)
        speeds.append(side * twist.v)
    braking = [math.sqrt(2.0 * SETTINGS.body.acceleration_max_m_s2 * away_m) for away_m in (0.0, 0.2, 1.0, 3.0)]
    assert speeds == pytest.approx([min(abs(v), max(CREEP_M_S, limit)) for limit in braking])


def test_farther_away_it_can_still_stop() -> None:
    place = (RIM_M + 0.2, 0.0)
    twist, _ = limited(Twist(0.3, 0.0), place)
    percept = Percept(Pose(0.0, 0.0, 0.0), np.array([place]), EVERYWHERE)
    arbiter = SETTINGS.behaviors.arbiter
    assert twist.v == pytest.approx(
        stoppable_speed_m_s(percept, SETTINGS.body, arbiter.clearance_m, arbiter.cautious_velocity_m_s)
    )
    assert limited(Twist(0.3, 0.0), (3.0, 0.0)) == (Twist(0.3, 0.0), None)


def test_before_its_first_echo_a_robot_creeps_and_turns_freely() -> None:
    """A deaf ring and open ground are alike until then."""
    assert limited(Twist(0.3, 0.0), slow_reason=NOTHING_YET) == (Twist(CREEP_M_S, 0.0), NOTHING_YET)
    assert limited(Twist(0.0, 1.0), slow_reason=NOTHING_YET) == (Twist(0.0, 1.0), NOTHING_YET)
    assert limited(Twist(0.0, 0.0), slow_reason=NOTHING_YET) == (Twist(0.0, 0.0), None)


def test_while_the_ring_hears_nothing_it_creeps_everywhere_and_turns_freely() -> None:
    twist, reason = limited(Twist(0.3, 0.0), (3.0, 2.0), silent=True)
    assert twist.v == pytest.approx(CREEP_M_S)
    assert reason == LOST
    assert limited(Twist(0.0, 1.0), (0.5, 0.0), silent=True) == (Twist(0.0, 1.0), None)


@pytest.mark.parametrize("v", [0.3, -0.3])
def test_it_slows_down_before_a_wall_that_a_silent_ring_presumes(v: float) -> None:
    """Until it creeps, also where the wall's line is less exact than that and was crossed."""
    percept, unheard = Percept(Pose(1.0, 0.0, 0.0), np.empty((0, 2)), EVERYWHERE), UnheardEchoes(np.zeros((3, 3)))
    walls = BlindWalls(np.array([[0.4, 0.0, 0.0]]), 0.1)
    walls.records[0 if v > 0.0 else TURN_DIRECTIONS // 2].odds = 1.0
    speeds = []
    for away_m in (3.0, RIM_M + PASSAGE_M + 0.05, RIM_M - 0.02, -0.1):
        walls.records[0].offset, walls.records[TURN_DIRECTIONS // 2].offset = 1.0 + away_m, away_m - 1.0
        unheard.silences[:] = 0
        unheard.presume_walls(-10.0 * math.copysign(1.0, v), 0.0, walls)
        unheard.silences[:] = 3
        twist, reason = limit_unheard(Twist(v, 0.0), percept, unheard, SETTINGS, None)
        speeds.append(abs(twist.v))
        assert reason == (None if twist.v == v else LOST)
    braking = math.sqrt(2.0 * SETTINGS.body.acceleration_max_m_s2 * 0.05)
    assert speeds == pytest.approx([0.3, min(0.3, braking), CREEP_M_S, CREEP_M_S])


@pytest.mark.parametrize("robot", ["hobby3", "denning"])
def test_before_what_a_silent_ring_heard_a_robot_stops_unless_it_is_about_to_look_round(robot: str) -> None:
    settings = load_settings("room", robot=robot)

    def stops(request: DriveRequest, *, has_unknown: bool) -> bool:
        unheard = UnheardEchoes(np.zeros((3, 3)))
        for echo in unheard.records:
            echo.state, echo.is_steady = ALONE, 1
            echo.x, echo.y = settings.body.radius_m + 0.3, 0.0
        unheard.silences[:] = 100
        pose = Pose(0.0, 0.0, 0.0)
        return lost_ahead(unheard, pose, has_unknown, request, settings) is not None

    assert stops(Goal(3.0, 0.0), has_unknown=False)
    assert stops(Goal(3.0, 0.0), has_unknown=True) == settings.body.synchro
    assert stops(Teleoperate(0.1, 0.0), has_unknown=True), "an operator's robot does not look by itself"


@pytest.mark.parametrize("offset_m", [0.5, 0.7])
def test_a_robot_beside_a_mirror_between_two_beams_drives_on_and_does_not_touch_it(offset_m: float) -> None:
    """A wall that only slowed a `p3at` down had it stand, or creep into the wall."""
    settings = load_settings("hallway", robot="p3at")
    ring, body, behaviors = settings.ring, settings.body, settings.behaviors
    mounts, half, course = mounts_array(ring.mounts), math.radians(ring.beam_half_angle_deg), math.radians(70.0)
    echoes, commitment = FreshEchoes(mounts, half, ring.turning, ring.window_m), Commitment()
    pose = moved = Pose(0.0, 0.0, 0.0)
    for k in range(311):
        pose = Pose(0.0, 0.0, math.radians(30.0 + 4.0 * k)) if k <= 10 else pose.compose(moved)
        run_s = 0.05 * k
        echoes.update(Firing(run_s, pose, pose.theta, heard(pose, 0.0, offset_m, mounts)))
        bearings, ages, sensor_ages, points = echoes.looks(run_s, 1.5)
        points, *sides = echoes.with_blind_sides(points, pose, axes := pose.theta + mounts[:, 2])
        view = FieldOfView(bearings, ages, axes, sensor_ages, half, ring.window_m, 1.5, *sides)
        percept = Percept(pose, points, view)
        schemas = (
            Response("way", math.cos(course), math.sin(course)),
            avoid_static_obstacle(percept, body.radius_m, behaviors.avoid_static_obstacle),
        )
        names = [one.schema for one in schemas]
        decision = arbitrate(schemas, percept, body, behaviors.arbiter, names, commitment=commitment, run_s=run_s)
        assert isinstance(decision, Drive)
        twist, commitment = commitment.commit(
            limit_unheard(decision.twist, percept, echoes.unheard, settings, None)[0], run_s
        )
        moved = Pose(0.05 * twist.v, 0.0, 0.05 * twist.w)
        assert pose.x < offset_m - body.radius_m, "it touches the wall"
    assert math.hypot(pose.x, pose.y) > 1.0
