"""What was heard stays an obstacle while nothing shows that the sensors which look there now can hear."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Floats, Pose
from perception.obstacle_echoes.fresh_echoes import FreshEchoes
from perception.obstacle_echoes.remembered_echoes import HEARS_S, ONE_PLACE_M, REMEMBERED_PLACES, REMEMBERED_S
from perception.obstacle_echoes.unheard_echoes import ALONE
from perception.sensor_mounts import ring_pose
from perception.snapshot import put_back, snapshot_of

COUNT, RADIUS_M, REACH_M = 24, 0.2, 5.0
AXES = math.tau * np.arange(COUNT) / COUNT
MOUNTS = np.stack([RADIUS_M * np.cos(AXES), RADIUS_M * np.sin(AXES), AXES], axis=1)
BEAM = math.radians(12.0)
SILENT = np.full(COUNT, math.inf)
AHEAD = Pose(0.0, 0.0, 0.0)


def one(sensor: int, range_m: float) -> Floats:
    return np.where(np.arange(COUNT) == sensor, range_m, math.inf)


class Drive:
    """A ring that turns in place, with what it hears."""

    def __init__(self, sensor_of: tuple[int, ...] = ()) -> None:
        self.ring, self.t = FreshEchoes(MOUNTS, BEAM, (), REACH_M, sensor_of), 0.0

    def fire(self, ranges: Floats, yaw: float = 0.0, x: float = 0.0, steps: int = 1) -> None:
        for _ in range(steps):
            self.t += 0.1
            self.ring.update(Firing(self.t, Pose(x, 0.0, yaw), yaw, ranges))

    def ahead(self, pose: Pose = AHEAD) -> list[tuple[float, float]]:
        found = self.ring.unheard.remembered.ahead(pose, 0.3)
        return [(round(x, 3), round(y, 3)) for x, y in found.tolist()]


def heard_behind() -> Drive:
    """Return a ring whose sensor 12 has heard something ahead of where the robot turns then, at 1.2 m."""
    drive = Drive()
    drive.fire(one(12, 1.0), yaw=math.pi, steps=3)
    return drive


def test_sensors_that_have_heard_nothing_since_contradict_nothing() -> None:
    drive = heard_behind()
    assert drive.ahead() == [(1.2, 0.0)]
    drive.fire(SILENT, steps=100)
    assert drive.ahead() == [(1.2, 0.0)]
    assert drive.ahead(Pose(0.0, 0.0, math.pi)) == drive.ahead(Pose(0.0, 1.0, 0.0)) == []
    drive.fire(SILENT, steps=round(10.0 * REMEMBERED_S) - 90)
    assert drive.ahead() == []


def test_a_single_echo_may_be_a_stray() -> None:
    drive = Drive()
    drive.fire(one(12, 1.0), yaw=math.pi)
    assert drive.ahead() == []


def test_the_silence_of_a_sensor_that_hears_does() -> None:
    drive = heard_behind()
    drive.fire(SILENT, steps=round(10.0 * HEARS_S))
    drive.fire(one(0, 2.0), yaw=0.5 * math.pi)
    drive.fire(SILENT)
    assert drive.ahead() == [(1.2, 0.0)], "a single echo may be all that a broken sensor hears"
    drive.fire(one(0, 2.0), yaw=0.5 * math.pi, steps=2)
    assert drive.ahead() == [(1.2, 0.0)], "it looks elsewhere"
    drive.fire(SILENT)
    assert drive.ahead() == []
    drive.fire(SILENT, yaw=math.pi, steps=3)
    assert drive.ahead() == [], "it has been contradicted for good"


@pytest.mark.parametrize("moved_m", [0.0, 0.1])
def test_what_falls_silent_before_a_ring_that_stands_has_left(moved_m: float) -> None:
    drive = heard_behind()
    drive.fire(SILENT, yaw=math.pi, x=moved_m)
    assert drive.ahead() == [(1.2, 0.0)], "it may have missed it"
    drive.fire(SILENT, yaw=math.pi, x=moved_m)
    assert drive.ahead() == [(1.2, 0.0)] * (moved_m > 0.0)


def test_a_servo_misses_an_echo_at_one_bearing_and_not_at_the_next() -> None:
    drive = Drive((0,) * COUNT)
    at = np.where(np.arange(COUNT) == 12, 1.0, math.nan)
    drive.fire(at, yaw=math.pi, steps=3)
    for misses in (1, 2):
        drive.fire(np.where(np.arange(COUNT) == 6, 1.0, math.nan), yaw=math.pi)
        drive.fire(np.where(np.isnan(at), math.nan, math.inf), yaw=math.pi)
        assert len(drive.ahead()) == (misses == 1)


def test_a_clock_that_leaps_back_leaves_it() -> None:
    drive = heard_behind()
    drive.t -= 0.6
    drive.fire(SILENT)
    assert drive.ahead() == [(1.2, 0.0)]
    drive.fire(SILENT, steps=round(10.0 * REMEMBERED_S))
    assert drive.ahead() == []


def test_a_stop_before_what_a_silent_ring_heard_leaves_the_rest() -> None:
    drive = heard_behind()
    unheard = drive.ring.unheard
    for echo in unheard.records:
        echo.state, echo.is_steady, echo.x = ALONE, 1, 1.0
    unheard.silences[:] = 1000
    assert unheard.take_ahead(AHEAD, 2.0, 0.5) == pytest.approx(1.0)
    assert drive.ahead() == [(1.2, 0.0)]


@pytest.mark.parametrize(("sensor_of", "left"), [((), 1), ((0,) * COUNT, 0)])
def test_a_sensor_on_a_servo_hears_where_it_heard_in_any_direction(sensor_of: tuple[int, ...], left: int) -> None:
    drive = Drive(sensor_of)
    drive.fire(one(12, 1.0), yaw=math.pi, steps=3)
    drive.fire(SILENT, yaw=math.pi, x=0.01, steps=round(10.0 * HEARS_S) + 1)
    for _ in range(2):
        drive.fire(np.where(np.arange(COUNT) == 6, 1.0, math.nan))
    drive.fire(SILENT)
    assert len(drive.ahead()) == left


@pytest.mark.parametrize(("range_m", "expected"), [(1.5, [1.7]), (0.98, [1.18]), (0.6, [0.8, 1.2])])
def test_an_echo_from_behind_it_removes_it_and_one_from_there_renews_it(
    range_m: float, expected: list[float]
) -> None:
    drive = heard_behind()
    drive.fire(one(0, range_m), steps=2)
    drive.fire(SILENT, yaw=math.pi, x=-0.01)
    assert sorted(x for x, _ in drive.ahead()) == expected


def test_what_the_ring_stands_on_is_gone() -> None:
    drive = heard_behind()
    drive.fire(SILENT, x=1.1)
    assert drive.ahead() == []


def test_a_reading_at_the_rings_reach_is_a_silence() -> None:
    drive = heard_behind()
    drive.fire(np.full(COUNT, REACH_M), steps=30)
    assert drive.ahead() == [(1.2, 0.0)]


def test_the_oldest_makes_room() -> None:
    drive = heard_behind()
    memory = drive.ring.unheard.remembered
    mounts = np.array([[0.0, 0.0, 0.0]])
    for k in range(REMEMBERED_PLACES - 1):
        place = ring_pose(Firing(0.0, Pose(0.0, 3.0 + 2.0 * ONE_PLACE_M * k, 0.0), 0.0, np.zeros(1)))
        memory.enter(np.array([1.0]), mounts, place, drive.t, (0.1, REACH_M, RADIUS_M), np.ones(1, np.bool_))
    assert drive.ahead() == [(1.2, 0.0)]
    memory.enter(np.array([1.0]), mounts, (0.0, -3.0, 0.0), drive.t, (0.1, REACH_M, RADIUS_M), np.ones(1, np.bool_))
    assert drive.ahead() == []


def test_a_snapshot_keeps_it_and_a_reset_forgets_it() -> None:
    drive, other = heard_behind(), FreshEchoes(MOUNTS, BEAM, (), REACH_M)
    put_back(other, snapshot_of(drive.ring))
    kept = drive.ring.unheard.remembered.ahead(AHEAD, 0.3)
    assert len(kept) == 1
    np.testing.assert_array_equal(other.unheard.remembered.ahead(AHEAD, 0.3), kept)
    drive.ring.clear()
    assert drive.ahead() == []
