"""Random rooms with doorways and drums: clear of the robot, and the same for the same seed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.furnished_rooms import CLEAR_M, drive, furnished_room, with_moved_wall
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene


def test_drives_stay_clear_and_keep_their_step() -> None:
    walls, drums = set(), set()
    for seed in range(8):
        room = furnished_room(seed)
        scene = compile_scene(room.world)
        walls.add(len(room.world.wall))
        drums.add(len(room.world.drum))
        poses = drive(room, seed, 0.1, 6.0)
        gaps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        assert gaps.max() < 0.2
        assert gaps.sum() > 5.0
        assert len(np.unique(poses[:, 2])) == 1
        assert min(clearance(x, y, scene.circles, scene.segments) for x, y in poses[:, :2].tolist()) >= CLEAR_M
    assert min(walls) >= 4
    assert max(walls) <= 8
    assert len(walls) > 2
    assert drums > {0, 1}


def test_even_rooms_are_driven_straight_and_odd_ones_swerving() -> None:
    for seed, straight in ((0, True), (1, False)):
        poses = drive(furnished_room(seed), seed, 0.1, 6.0)
        turns = np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(poses[:, :2], axis=0).T))))
        assert (float(np.median(turns)) < 1e-9) is straight


def test_a_seed_determines_room_and_drive() -> None:
    assert furnished_room(3) == furnished_room(3)
    assert furnished_room(3) != furnished_room(4)
    first, again = (drive(furnished_room(3), 3, 0.1, 4.0) for _ in range(2))
    assert (first == again).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_moved_wall_stands_farther_out_and_nothing_else_moves(seed: int) -> None:
    room = furnished_room(seed)
    moved = with_moved_wall(room, 0.6).world
    assert moved.drum == room.world.drum
    off = []
    for before, after in zip(room.world.wall, moved.wall, strict=True):
        x, y = after.x1_m - before.x1_m, after.y1_m - before.y1_m
        assert (after.x2_m - before.x2_m, after.y2_m - before.y2_m) == pytest.approx((x, y))
        assert x * (before.x2_m - before.x1_m) + y * (before.y2_m - before.y1_m) == pytest.approx(0.0, abs=1e-9)
        assert x * before.x1_m + y * before.y1_m >= 0.0
        off.append(math.hypot(x, y))
    parts = sum(away > 0.0 for away in off)
    assert off == pytest.approx([0.6] * parts + [0.0] * (len(off) - parts))
    assert 1 <= parts <= 2
    assert with_moved_wall(room, 0.0) == room
