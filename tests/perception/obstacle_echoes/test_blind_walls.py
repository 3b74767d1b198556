"""What a ring with gaps remembers of walls on its blind sides, against the walls that stand there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_robot
from drivers.messages import Firing, Floats, Pose
from perception.obstacle_echoes.blind_walls import (
    KEPT_M,
    NARROW_M,
    SILENT_WAY_M,
    TURN_DIRECTIONS,
    WALL_ECHO_M,
    WIDTH_RAD,
    BlindWalls,
    has_blind_sides,
    middle_walls,
)
from perception.sensor_mounts import mounts_array

HALF = math.radians(15.0)
REACH_M = 5.0
MOUNTS = np.array([[0.2 * math.cos(a), 0.2 * math.sin(a), a] for a in np.radians([-30.0, -10.0, 10.0, 30.0])])


def heard(pose: Pose, normal_rad: float, offset_m: float, mounts: Floats = MOUNTS) -> Floats:
    """Return what a ring hears of an endless mirror."""
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    x, y = pose.x + c * mounts[:, 0] - s * mounts[:, 1], pose.y + s * mounts[:, 0] + c * mounts[:, 1]
    ranges = offset_m - x * math.cos(normal_rad) - y * math.sin(normal_rad)
    off = np.abs(np.remainder(pose.theta + mounts[:, 2] - normal_rad + math.pi, math.tau) - math.pi)
    return np.where((off <= HALF) & (ranges > 0.0) & (ranges < REACH_M), ranges, math.inf)


def look_round(walls: BlindWalls, x: float, y: float, normal_rad: float, offset_m: float) -> None:
    """Turn once on the spot."""
    for theta in np.arange(0.0, math.tau, 0.1).tolist():
        pose = Pose(x, y, theta)
        walls.update(Firing(0.0, pose, theta, heard(pose, normal_rad, offset_m)))


def sides(walls: BlindWalls, pose: Pose) -> tuple[Floats, Floats]:
    return walls.sides(pose, pose.theta + MOUNTS[:, 2])[:2]


@pytest.mark.parametrize("seed", range(6))
def test_a_mirror_that_the_ring_hears_no_more_stands_where_it_stood(seed: int) -> None:
    """Wherever the robot goes with the mirror on its blind side, the foot on it is right to half a direction."""
    rng = np.random.default_rng(seed)
    normal, offset = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(1.0, 2.0))
    walls = BlindWalls(MOUNTS, HALF)
    look_round(walls, 0.0, 0.0, normal, offset)
    heading = normal + float(rng.choice([-1.0, 1.0])) * math.radians(float(rng.uniform(55.0, 85.0)))
    for way in np.arange(0.0, min(1.0, 0.8 * offset), 0.03).tolist():
        pose = Pose(way * math.cos(heading), way * math.sin(heading), heading)
        walls.update(Firing(0.0, pose, heading, heard(pose, normal, offset)))
        points, _ = sides(walls, pose)
        true_m = offset - pose.x * math.cos(normal) - pose.y * math.sin(normal)
        away = np.hypot(points[:, 0] - pose.x, points[:, 1] - pose.y)
        towards = np.arctan2(points[:, 1] - pose.y, points[:, 0] - pose.x)
        near = np.abs(np.remainder(towards - normal + math.pi, math.tau) - math.pi) < math.radians(6.0)
        assert np.abs(away[near] - true_m).min() < 0.02 + 0.1 * way
        assert away.min() > true_m - 0.05 - 0.5 * way, "an echo from the edge of a beam counts in all of it"


def test_silence_and_something_behind_it_remove_a_wall() -> None:
    walls = BlindWalls(MOUNTS, HALF)
    look_round(walls, 0.0, 0.0, 0.5, 1.0)
    pose = Pose(0.0, 0.0, 1.7)
    assert len(sides(walls, pose)[0])
    look_round(walls, 0.0, 0.0, 0.5, 9.0)
    assert not len(sides(walls, pose)[0])
    look_round(walls, 0.0, 0.0, 0.5, 3.0)
    points, _ = sides(walls, pose)
    assert np.hypot(points[:, 0], points[:, 1]).min() == pytest.approx(3.0, abs=0.05)


def test_a_direction_is_unknown_until_the_ring_looks_there_and_again_some_metres_on() -> None:
    walls = BlindWalls(MOUNTS, HALF)
    start = Pose(0.0, 0.0, 0.0)
    assert len(sides(walls, start)[1]) >= 6
    look_round(walls, 0.0, 0.0, 0.0, 90.0)
    assert not len(sides(walls, start)[1])
    for x in np.arange(0.0, KEPT_M + 0.1, 0.1).tolist():
        unknown = sides(walls, Pose(x, 0.0, 0.0))[1]
        assert not len(unknown)
        walls.update(Firing(0.0, Pose(x, 0.0, 0.0), 0.0, np.full(4, math.inf)))
    there = Pose(KEPT_M + 0.1, 0.0, 0.0)
    walls.update(Firing(0.0, there, 0.0, np.full(4, math.inf)))
    unknown = np.degrees(np.abs(np.remainder(sides(walls, there)[1] + math.pi, math.tau) - math.pi))
    assert set(np.rint(unknown)) == {50.0, 60.0, 70.0, 80.0}, "the beams reach 45°, where that of 50° begins"
    walls.clear()
    assert len(sides(walls, there)[1]) >= 6


@pytest.mark.parametrize("seed", range(6))
def test_a_mirror_is_one_wall_of_its_own_direction_and_those_beside_it(seed: int) -> None:
    """Each echo stands for a wall in all directions of its beam; a look round leaves the middle of them."""
    rng = np.random.default_rng([seed, 3])
    normal, offset = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(1.0, 2.0))
    walls = BlindWalls(MOUNTS, HALF)
    look_round(walls, 0.0, 0.0, normal, offset)
    offsets = middle_walls(walls.offsets(0.0, 0.0))
    off = np.remainder(WIDTH_RAD * np.arange(TURN_DIRECTIONS) - normal + math.pi, math.tau) - math.pi
    found = np.isfinite(offsets)
    assert 2 <= found.sum() <= 4
    assert np.abs(off[found]).max() < 2.5 * WIDTH_RAD
    assert abs(off[found].mean()) < WIDTH_RAD
    assert offsets[found] == pytest.approx(offset, abs=0.02)
    beyond = 1.5 * offset
    assert not np.isfinite(walls.offsets(beyond * math.cos(normal), beyond * math.sin(normal))[found]).any()


def test_neighbours_at_one_distance_are_one_wall_across_the_first_direction_too() -> None:
    offsets = np.full(TURN_DIRECTIONS, math.inf)
    offsets[[34, 35, 0, 1, 2]] = offsets[[10, 11]] = 2.0
    offsets[11] += 2.0 * WALL_ECHO_M
    assert set(np.flatnonzero(np.isfinite(middle_walls(offsets))).tolist()) == {35, 0, 1, 10, 11}
    assert np.isfinite(middle_walls(np.ones(TURN_DIRECTIONS))).any(), "all round"


def test_shipped_robots_have_no_gap_as_wide_as_a_beam() -> None:
    """But the AmigoBot, behind, where it does not drive."""
    for name in ("denning", "b21r", "p3dx", "p3at", "peoplebot", "powerbot", "magellan"):
        ring = load_robot(name).ring
        assert not has_blind_sides(mounts_array(ring.mounts), math.radians(ring.beam_half_angle_deg)), name
    assert has_blind_sides(MOUNTS, HALF)


def test_beams_that_touch_leave_nothing_unknown() -> None:
    """The AmigoBot stood for ever in a corridor: no sensor's beam held the whole direction straight ahead."""
    ring = load_robot("amigo").ring
    mounts = mounts_array(ring.mounts)
    assert has_blind_sides(mounts, math.radians(ring.beam_half_angle_deg))
    walls = BlindWalls(mounts, math.radians(ring.beam_half_angle_deg))
    _, unknown, _ = walls.sides(Pose(0.0, 0.0, 0.0), mounts[:, 2])
    assert len(unknown) == 0


@pytest.mark.parametrize("first_deg", range(0, 10, 2))
def test_a_robot_that_hears_nothing_and_turns_to_what_is_unknown_soon_knows_all(first_deg: float) -> None:
    """It turns on after the edge of its outermost beam has reached a direction, until all of that was looked at."""
    mounts = np.array([[0.3, 0.0, a] for a in np.radians([-34.0, 0.0, 34.0])])
    walls, course = BlindWalls(mounts, math.radians(18.0)), math.radians(first_deg)
    theta, turns = course - 0.5, 0
    while turns < 200:  # four radians
        turns += 1
        pose = Pose(0.0, 0.0, theta)
        walls.update(Firing(0.0, pose, theta, np.full(3, math.inf)))
        _, unknown, _ = walls.sides(pose, theta + mounts[:, 2])
        towards = np.remainder(unknown - theta + math.pi, math.tau) - math.pi
        towards = towards[np.cos(unknown - course) > 0.0]
        if not len(towards):
            break
        theta += math.copysign(0.02, towards[np.abs(towards).argmin()])
    assert turns < 200


def test_a_wall_abeam_stays_as_the_robot_turns_past_it() -> None:
    """As one that left at 90° from the heading, it made a robot beside it turn to and fro."""
    walls = BlindWalls(MOUNTS, HALF)
    look_round(walls, 0.0, 0.0, 0.0, 1.0)
    for turned_deg in (60.0, 89.0, 91.0, 120.0, 180.0):
        points, _ = sides(walls, Pose(0.0, 0.0, math.radians(turned_deg)))
        assert np.abs(points - (1.0, 0.0)).max(axis=1).min() < 0.06


def test_a_wall_is_presumed_from_elsewhere_until_it_is_looked_at() -> None:
    walls = BlindWalls(MOUNTS, HALF)
    look_round(walls, 0.0, 0.0, 0.0, 1.0)
    away = math.radians(70.0)
    here, on = Pose(0.0, 0.0, away), Pose(0.0, 1.5 * SILENT_WAY_M, away)
    assert not len(walls.sides(here, here.theta + MOUNTS[:, 2])[2])
    points, _, presumed = walls.sides(on, on.theta + MOUNTS[:, 2])
    assert len(points)
    assert presumed == pytest.approx(points)
    look_round(walls, on.x, on.y, 0.0, 1.0)
    points, _, presumed = walls.sides(on, on.theta + MOUNTS[:, 2])
    assert len(points)
    assert not len(presumed)


def test_a_ring_that_fell_silent_looks_again_and_once_everywhere_if_that_lasts() -> None:
    walls = BlindWalls(MOUNTS, HALF)
    look_round(walls, 0.0, 0.0, 0.5, 1.0)
    start, on = Pose(0.0, 0.0, 0.0), Pose(2.0 * SILENT_WAY_M, 0.0, 0.0)
    walls.look_again(start.x, start.y, is_lasting=False)
    assert not len(sides(walls, start)[1])
    known = len(sides(walls, Pose(0.0, 0.0, 1.7))[0])
    walls.look_again(on.x, on.y, is_lasting=False)
    assert len(sides(walls, on)[1]) >= 6
    look_round(walls, on.x, on.y, 0.5, 1.0)
    walls.look_again(on.x, on.y, is_lasting=True)
    assert len(sides(walls, on)[1]) >= 6
    assert known
    look_round(walls, on.x, on.y, 0.5, 1.0)
    walls.look_again(on.x, on.y, is_lasting=True)
    assert not len(sides(walls, on)[1]), "a failed ring would have it turn for ever"


@pytest.mark.parametrize("robot", ["p3at", "peoplebot"])
@pytest.mark.parametrize("seed", range(3))
def test_a_mirror_between_two_beams_stands_where_it_was_heard_before_the_robot_turned(robot: str, seed: int) -> None:
    """A `p3at` turned along a wall until its normal lay in a gap of 10°, and touched it in honest drives."""
    rng, ring = np.random.default_rng([seed, 5]), load_robot(robot).ring
    mounts, half = mounts_array(ring.mounts), math.radians(ring.beam_half_angle_deg)
    walls, normal, offset = BlindWalls(mounts, half), float(rng.uniform(-math.pi, math.pi)), 0.8
    for off_deg in range(30, 71, 4):
        pose = Pose(0.0, 0.0, normal + math.radians(off_deg))
        walls.update(Firing(0.0, pose, pose.theta, heard(pose, normal, offset, mounts)))
    for way in np.arange(0.0, 0.6, 0.03).tolist():
        pose = Pose(way * math.cos(pose.theta), way * math.sin(pose.theta), pose.theta)
        ranges = heard(pose, normal, offset, mounts)
        assert not np.isfinite(ranges).any()
        walls.update(Firing(0.0, pose, pose.theta, ranges))
        points, unknown, _ = walls.sides(pose, pose.theta + mounts[:, 2])
        true_m = offset - pose.x * math.cos(normal) - pose.y * math.sin(normal)
        assert np.hypot(points[:, 0] - pose.x, points[:, 1] - pose.y).min() == pytest.approx(true_m, abs=0.15)
        assert not len(unknown), "it need not look into so narrow a gap"
    beyond = Pose(2.0 * NARROW_M * math.cos(pose.theta), 2.0 * NARROW_M * math.sin(pose.theta), pose.theta)
    assert not len(walls.sides(beyond, pose.theta + mounts[:, 2])[0]), "a drum that was passed is no wall for long"


@pytest.mark.parametrize("heading_deg", [0.0, 0.4, 3.0, 7.0])
def test_two_beams_that_touch_miss_a_wall_together(heading_deg: float) -> None:
    """Neither holds all of a direction: a drum that was passed stayed a wall ahead, and the robot crept."""
    mounts, theta = np.array([[0.1, 0.0, a] for a in np.radians([0.0, 25.0, 50.0])]), math.radians(heading_deg)
    walls, pose = BlindWalls(mounts, HALF), Pose(0.0, 0.0, theta)
    for _ in range(2):
        walls.update(Firing(0.0, pose, theta, np.ones(3)))
    assert np.isfinite(walls.offsets(0.0, 0.0)).sum() >= 7
    for _ in range(3):
        for i in range(3):
            ranges = np.full(3, math.nan)
            ranges[i] = math.inf
            walls.update(Firing(0.0, pose, theta, ranges))
    left_deg = np.degrees(WIDTH_RAD * np.flatnonzero(np.isfinite(walls.offsets(0.0, 0.0)))) - heading_deg
    edges = (np.abs(left_deg - 65.0) < 5.0) | (np.abs(left_deg + 15.0) < 5.0) | (np.abs(left_deg - 345.0) < 5.0)
    assert edges.all(), "only directions at the edge of what the beams cover remain"
