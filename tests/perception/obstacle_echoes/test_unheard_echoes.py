"""What fell silent as the robot came nearer stays an obstacle until a look contradicts it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from config.load import load_robot
from drivers.messages import Firing, Floats, Pose
from perception.obstacle_echoes.fresh_echoes import FreshEchoes
from perception.obstacle_echoes.unheard_echoes import AWAY_M
from perception.sensor_mounts import mounts_array

MOUNTS = np.array([[0.4, 0.0, 0.0], [0.0, 0.4, math.pi / 2]])
BEAM = math.radians(12.0)
WALL_M, REACH_M = 3.0, 5.0
ROBOTS = ("amigo", "b21r", "denning", "ears", "magellan", "p3dx", "powerbot")


def heard(mounts: Floats, x: float, yaw: float, half_angle: float) -> Floats:
    """Return what a ring hears of a rough wall across the x axis: the nearest place in each beam."""
    axes = yaw + mounts[:, 2]
    own_x = x + mounts[:, 0] * math.cos(yaw) - mounts[:, 1] * math.sin(yaw)
    off = np.maximum(0.0, np.abs(np.remainder(axes + math.pi, 2.0 * math.pi) - math.pi) - half_angle)
    ranges = np.where(np.cos(off) > 0.05, (WALL_M - own_x) / np.maximum(np.cos(off), 0.05), math.inf)
    return np.where(ranges < REACH_M, ranges, math.inf)


def approach(to: Callable[[float, Floats], Floats], ring: FreshEchoes, mounts: Floats, until_m: float) -> None:
    """Drive at the wall, with what the ring reports in place of what it hears."""
    for k in range(round(until_m / 0.03)):
        x = 0.03 * k
        ring.update(Firing(0.1 * k, Pose(x, 0.0, 0.0), 0.0, to(x, heard(mounts, x, 0.0, BEAM))))


@pytest.mark.covered
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("seed", range(3))
def test_a_wall_that_is_too_near_to_be_heard_stays_where_it_was_heard(robot: str, seed: int) -> None:
    """The least range, the noise and lost readings are drawn."""
    rng = np.random.default_rng([seed, 7])
    blind_m, mounts = float(rng.uniform(0.3, 0.8)), mounts_array(load_robot(robot).ring.mounts)
    ring = FreshEchoes(mounts, BEAM, (), REACH_M)

    def reported(_: float, ranges: Floats) -> Floats:
        noisy = ranges + rng.normal(0.0, 0.01, len(ranges))
        noisy[rng.random(len(ranges)) < 0.05] = math.nan
        return np.where(noisy < blind_m, math.inf, noisy)

    rim_m = float(mounts[:, 0].max())
    approach(reported, ring, mounts, WALL_M - rim_m - 0.15)
    kept = ring.unheard.points()
    assert len(kept)
    ahead = kept[np.abs(kept[:, 1]) < 0.3]
    assert np.abs(ahead[:, 0] - WALL_M).min() < 0.1


def test_a_ring_that_hears_the_wall_keeps_nothing() -> None:
    mounts = mounts_array(load_robot("denning").ring.mounts)
    ring = FreshEchoes(mounts, BEAM, (), REACH_M)
    approach(lambda _, ranges: ranges, ring, mounts, 2.4)
    assert len(ring.unheard.points()) == 0


def lost(echo_of: int = 1) -> FreshEchoes:
    """Return a ring that lost the wall .9 m before it, while another sensor hears something."""
    ring = FreshEchoes(MOUNTS, BEAM, (), REACH_M)
    for k in range(56):
        ranges = np.full(2, math.inf)
        ranges[0] = WALL_M - 0.03 * k - 0.4 if k < 54 else math.inf
        ranges[echo_of] = 2.0 if echo_of else ranges[0]
        ring.update(Firing(0.1 * k, Pose(0.03 * k, 0.0, 0.0), 0.0, ranges))
    assert ring.unheard.points() == pytest.approx(np.array([[WALL_M, 0.0]]))
    assert not ring.unheard.is_ring_silent
    return ring


def look(ring: FreshEchoes, x: float, first: float, t: float, yaw: float = 0.0) -> int:
    """Return how many echoes are kept after a firing."""
    ring.update(Firing(t, Pose(x, 0.0, 0.0), yaw, np.array([first, 2.0 + 0.001 * t])))
    return len(ring.unheard.points())


def test_silence_and_a_random_echo_contradict_nothing() -> None:
    ring = lost()
    assert look(ring, 1.65, math.inf, 5.7) == 1
    assert look(ring, 1.65, 2.4, 5.8) == 1, "behind it, but no other look agrees"
    assert look(ring, 1.65, math.inf, 60.0) == 1, "however long the robot stands"


def test_it_is_gone_if_it_is_heard_again_or_something_behind_it() -> None:
    for range_m in (0.95, 2.4):
        ring = lost()
        look(ring, 1.65, range_m, 5.7)
        assert look(ring, 1.65, range_m, 5.8) == 0


def test_an_echo_beside_it_or_before_it_contradicts_nothing() -> None:
    ring = lost()
    for t in (5.7, 5.8):
        assert look(ring, 1.65, 0.3, t) == 1
    for t in (5.9, 6.0):
        assert look(ring, 1.65, 2.4, t, yaw=math.radians(20.0)) == 1


AROUND = np.array([[0.4 * math.cos(a), 0.4 * math.sin(a), a] for a in np.radians(30.0 * np.arange(12.0)).tolist()])


@pytest.mark.parametrize(("sensors", "is_kept"), [(2, False), (3, True)])
@pytest.mark.parametrize(("speed", "chatter"), [(0.03, 0.0), (0.03, 0.001), (0.0, 0.0)])
def test_an_echo_that_repeats_to_the_bit_on_the_way_does_not_end_the_silence_of_others(
    sensors: int, is_kept: bool, speed: float, chatter: float
) -> None:
    """A frozen ring may repeat silence in the place of walls, and an echo behind."""
    ring = FreshEchoes(AROUND, BEAM, (), REACH_M)
    for k in range(14):
        ranges = np.full(12, math.inf)
        ranges[8] = 3.0 + chatter * k
        if k < 8:
            ranges[:sensors] = 2.0
        ring.update(Firing(0.1 * k, Pose(speed * k, 0.0, 0.0), 0.0, ranges))
    is_alive = speed == 0.0 or chatter > 0.0
    assert ring.unheard.is_ring_silent == (is_kept and not is_alive)
    ranges[8] = 2.9
    ring.update(Firing(1.4, Pose(14.0 * speed, 0.0, 0.0), 0.0, ranges))
    assert not ring.unheard.is_ring_silent


@pytest.mark.parametrize("turn_rad", [0.0, 0.05])
def test_a_sensor_on_a_ring_that_turns_has_moved_too(turn_rad: float) -> None:
    ring = FreshEchoes(AROUND, BEAM, (), REACH_M)
    for k in range(14):
        ranges = np.full(12, math.inf)
        ranges[8] = 3.0
        if k < 8:
            ranges[:6] = 2.0
        pose = Pose(0.03 * min(k, 9), 0.0, turn_rad * max(0, k - 9))  # it drives, then turns on the spot
        ring.update(Firing(0.1 * k, pose, pose.theta, ranges))
    assert ring.unheard.is_ring_silent is (turn_rad > 0.0)


@pytest.mark.parametrize(("sensors", "is_kept"), [(2, False), (3, True)])
def test_a_ring_that_loses_several_echoes_at_once_keeps_them_although_it_only_turns(
    sensors: int, is_kept: bool
) -> None:
    ring = FreshEchoes(AROUND, BEAM, (), REACH_M)
    for k in range(10):
        ranges = np.full(12, math.inf)
        if k < 8:
            ranges[:sensors] = 2.0
        ring.update(Firing(0.1 * k, Pose(0.0, 0.0, 0.0), 0.02 * k, ranges))
    assert ring.unheard.is_ring_silent == is_kept
    assert len(ring.unheard.points()) == (sensors if is_kept else 0)
    ring.update(Firing(1.0, Pose(-5.0 * AWAY_M, 0.0, 0.0), 0.2, np.full(12, math.inf)))
    assert ring.unheard.is_ring_silent == is_kept, "a ring that hears nothing could not hear them again either"
    ranges[11] = 3.0
    ring.update(Firing(1.1, Pose(0.0, 0.0, 0.0), 0.2, ranges))
    assert not ring.unheard.is_ring_silent


def test_random_echoes_of_a_ring_that_hears_little_else_stop_no_robot() -> None:
    """Among mirrors, three strays in succession were taken for what stood ahead before the ring failed."""
    pose = Pose(0.0, 0.0, 0.0)
    for is_steady in (False, True):
        ring = FreshEchoes(AROUND, BEAM, (), REACH_M)
        for k in range(40):
            ranges = np.full(12, math.nan)
            ranges[k % 4 :: 4] = math.inf
            if 4 * (not is_steady) <= k % 8 < 8 and 8 <= k < 16:
                ranges[k % 4] = 0.6 + 0.4 * (k % 4)
            ring.update(Firing(0.05 * k, pose, 0.0, ranges))
        assert ring.unheard.is_ring_silent, "it drives slowly all the same"
        assert (ring.unheard.take_ahead(pose, 3.0, 0.5) is not None) is is_steady


def test_it_is_gone_where_the_robot_could_have_heard_it_again_or_stands_on_it() -> None:
    ring = lost()
    assert look(ring, 1.65 - 0.5 * AWAY_M, math.inf, 5.7) == 1
    assert look(ring, 1.65 - 2.0 * AWAY_M, math.inf, 5.8) == 0
    assert look(lost(), WALL_M - 0.3, math.inf, 5.7) == 0
    ring = lost()
    ring.clear()
    assert len(ring.unheard.points()) == 0


def test_few_sensors_that_turn_away_from_what_they_heard_have_not_lost_it() -> None:
    """Three in front hear nothing beside a wall; those of a ring all round would have heard it again."""
    mounts = mounts_array(load_robot("hobby3").ring.mounts)
    for turn_rad, is_lost in ((1.6, False), (0.1, True)):
        ring, beam = FreshEchoes(mounts, math.radians(15.0), (), REACH_M), math.radians(15.0)
        for k in range(6):
            ring.update(Firing(0.1 * k, Pose(1.0, 0.0, 0.0), 0.0, heard(mounts, 1.0, 0.0, beam)))
        for k in range(6, 10):
            ring.update(Firing(0.1 * k, Pose(1.0, 0.0, turn_rad), turn_rad, np.full(3, math.inf)))
        assert ring.unheard.is_ring_silent == is_lost


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("robot", "is_frozen"), [("hobby3", False), ("parking12", False), ("parking12", True)])
def test_walls_beside_a_ring_go_on_while_it_hears_nothing_new(robot: str, is_frozen: bool, seed: int) -> None:
    """It looked round between two mirrors, failed, and drives at one of them, wherever it turns."""
    rng, config = np.random.default_rng([seed, 9]), load_robot(robot).ring
    mounts, half = mounts_array(config.mounts), math.radians(config.beam_half_angle_deg)
    tilt = float(rng.uniform(-math.pi, math.pi))
    ring, t = FreshEchoes(mounts, half, (), 4.0), 0.0
    for theta in np.arange(0.0, math.tau, 0.1).tolist():
        ranges = np.full(len(mounts), math.inf)
        for normal, offset in ((tilt, 0.5), (tilt + math.pi, 0.6)):
            axes = theta + mounts[:, 2]
            off = np.abs(np.remainder(axes - normal + math.pi, math.tau) - math.pi)
            own = mounts[:, 0] * math.cos(theta - normal) - mounts[:, 1] * math.sin(theta - normal)
            ranges = np.where(off <= half, offset - own, ranges)
        ring.update(Firing(t, Pose(0.0, 0.0, theta), theta, ranges))
        t += 0.1
    towards = tilt + float(rng.uniform(-0.7, 0.7))
    assert ring.unheard.presumed_way_m(Pose(0.0, 0.0, towards), 0.1) == math.inf or not np.isfinite(ranges).any()
    failed = ranges if is_frozen else np.full(len(mounts), math.inf)
    for k in range(6):  # a ring that stands may hear the same again
        ring.update(Firing(t, Pose(0.0, 0.0, towards + 0.01 * k), towards + 0.01 * k, failed))
        t += 0.1
    true_m = 0.4 / math.cos(towards - tilt)
    assert true_m - 0.15 < ring.unheard.presumed_way_m(Pose(0.0, 0.0, towards), 0.1) < true_m + 0.05
    along = tilt + 0.5 * math.pi
    assert ring.unheard.presumed_way_m(Pose(0.0, 0.0, along), 0.1) > 1.2, "between them the way is free"
    ranges[1] = 3.0
    ring.update(Firing(t, Pose(0.0, 0.0, towards), towards, ranges))
    assert ring.unheard.presumed_way_m(Pose(0.0, 0.0, towards), 0.1) == math.inf, "it hears again"
    ring.clear()
