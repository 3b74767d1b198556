"""Random rooms: within their limits, and the same for the same seed."""

from __future__ import annotations

import math

import numpy as np

from bench.trials.random_rooms import ACROSS_M, CLEAR_MIN_M, WALL_MIN_M, random_room
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.messages import Pose


def crossings_to_the_right(corners: np.ndarray, pose: Pose) -> int:
    """Walls that a line from a pose along x crosses: an odd number from inside."""
    x1, y1 = corners.T
    x2, y2 = np.roll(corners, -1, axis=0).T
    spans = (y1 > pose.y) != (y2 > pose.y)
    at = x1[spans] + (pose.y - y1[spans]) / (y2[spans] - y1[spans]) * (x2 - x1)[spans]
    return int((at > pose.x).sum())


def test_rooms_and_stands_are_within_their_limits() -> None:
    walls = set()
    for seed in range(60):
        world, stand = random_room(seed)
        corners = np.array(world.polygon[0].vertices_m)
        across = max(math.dist(a, b) for a in corners for b in corners)
        sides = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
        scene = compile_scene(world)
        walls.add(len(corners))
        assert ACROSS_M[0] <= across <= ACROSS_M[1]
        assert sides.min() > WALL_MIN_M
        assert clearance(stand.x, stand.y, scene.circles, scene.segments) > CLEAR_MIN_M
        assert crossings_to_the_right(corners, stand) % 2 == 1
        meeting = {(round(x, 6), round(y, 6)) for x, y in scene.corners[["x", "y"]].tolist()}
        assert len(meeting) == len(corners), "no two walls cross"
    assert walls == {4, 5, 6, 7, 8}


def test_a_seed_determines_the_room() -> None:
    assert random_room(1) == random_room(1)
    assert random_room(1) != random_room(2)
