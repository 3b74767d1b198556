"""Tests of bench.free_cells: what sound can reach, and that the grid calls little else free."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.free_cells import STEP_M, beams_of, echoes_of, reachable, with_late_strays
from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from bench.trials.wall_trials import listen
from config.load import load_settings
from config.world import WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.messages import Firing, Pose
from perception.mapping.grid.window import Ring
from perception.pipeline import Perception
from perception.sensor_mounts import mounts_array
from runtime.analysis.export.occupancy_image import FREE, FREE_MAX, RESOLUTION_M, occupancy_image
from runtime.simulation.open_loop import perceive

SETTINGS = load_settings("hallway")
RING = Ring(
    mounts_array(SETTINGS.ring.mounts), math.radians(SETTINGS.ring.beam_half_angle_deg), 0.0,
    SETTINGS.ring.range_max_m,
)  # fmt: skip
UNREACHABLE_MAX = 0.02
"""Of single rooms; over twenty of them it is less than half of this."""


def test_sound_reaches_what_no_wall_hides() -> None:
    world = WorldConfig(wall=(WallConfig(x1_m=2.0, y1_m=-0.5, x2_m=2.0, y2_m=0.5),))
    ranges = np.full(len(RING.mounts), math.nan)
    ranges[0] = math.inf
    beams = beams_of([Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges)], RING)
    cells = np.array([(1.5, 0.0), (2.5, 0.0), (1.5, 1.5), (-1.5, 0.0), (30.0, 0.0)])
    assert reachable(cells, 0.05, beams, RING, compile_scene(world)).tolist() == [True, False, False, False, False]


@pytest.mark.compiled
def test_in_a_bare_square_room_of_mirrors_nothing_behind_the_walls_is_free() -> None:
    """Its cells are heard from many sides, as where everything echoes: 22 % of what was called free lay outside."""
    room = furnished_room(6315, ACOUSTICS)
    firings = listen(SETTINGS.ring, room, 6315, STEP_M).firings
    config = load_settings("hallway", ["perception.grid.method=directed"]).perception
    perception = Perception(SETTINGS.ring, SETTINGS.models, config)
    for firing in firings:
        perceive(perception, firing)
    window = perception.occupancy()
    assert window is not None
    rows, columns = np.nonzero(window.occupied <= FREE_MAX)
    free = np.array([window.x_m, window.y_m]) + (np.column_stack([columns, rows]) + 0.5) * window.cell_m
    can = reachable(free, window.cell_m, beams_of(firings, RING), RING, compile_scene(room.world))
    assert len(free) > 1000
    assert can.mean() > 0.99


def test_little_that_sound_could_not_reach_is_free_in_the_image_though_nothing_was_recognised() -> None:
    """Among mirrors a third of the silent readings come late, from behind the walls."""
    for seed in (2, 5):
        room = furnished_room(seed)
        scene = compile_scene(room.world)
        firings = with_late_strays(
            listen(SETTINGS.ring, room, seed, 0.3).firings, SETTINGS.ring, scene, np.random.default_rng(seed)
        )
        way = np.array([(firing.pose.x, firing.pose.y) for firing in firings])
        image = occupancy_image(WorldConfig(), echoes_of(firings, RING), SETTINGS.ring, way, SETTINGS.body.radius_m)
        rows, columns = np.nonzero(image.pixels[::-1] == FREE)
        free = np.array([image.x_m, image.y_m]) + (np.column_stack([columns, rows]) + 0.5) * RESOLUTION_M
        can = reachable(free, RESOLUTION_M, beams_of(firings, RING), RING, scene)
        near = np.zeros(len(free), np.bool_)
        for x, y in way.tolist():
            near |= np.hypot(*(free - (x, y)).T) < SETTINGS.body.radius_m + 0.1
        assert len(free) * RESOLUTION_M**2 > 4.0
        assert (~can & ~near).mean() < UNREACHABLE_MAX, seed
