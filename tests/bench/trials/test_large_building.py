"""A large building: its rooms, its doorways, and drives through them that touch nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.large_building import Building
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene


def test_it_has_rooms_with_a_doorway_to_each_neighbour_and_a_drum() -> None:
    building = Building(0, 27.0)
    n = building.rooms
    assert n == 3
    assert len(building.world.drum) == n * n
    outer, inner = 4 * n, 2 * n * (n - 1)
    assert len(building.world.wall) == outer + 2 * inner
    lengths = [math.hypot(w.x2_m - w.x1_m, w.y2_m - w.y1_m) for w in building.world.wall]
    assert min(lengths) > 0.5
    assert Building(0, 27.0).world == building.world != Building(1, 27.0).world


@pytest.mark.parametrize("seed", range(4))
def test_a_drive_goes_from_room_to_room_and_touches_nothing(seed: int) -> None:
    building = Building(seed, 30.0)
    poses = building.drive(seed, 0.25, 40.0)
    assert len(poses) == 160
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert steps.max() < 0.2501
    scene = compile_scene(building.world)
    assert min(clearance(x, y, scene.circles, scene.segments) for x, y in poses[:, :2].tolist()) > 0.4
    assert np.ptp(poses[:, :2], axis=0).max() > 8.0, "it leaves the first room"
