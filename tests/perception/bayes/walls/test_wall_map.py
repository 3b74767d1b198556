"""The wall map on the readings of a whole room: every wall once, its doorway open, and drums no walls."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Pose
from perception.bayes.inference.placement import place_readings
from perception.bayes.memory.state import ESTABLISHED, Memory
from perception.bayes.tracks.observe import associate_circles
from perception.bayes.walls.corners import find_corners
from perception.bayes.walls.wall_map import may_be_of_wall, update_walls
from perception.kernel import Floats
from perception.localization.room.expected_ranges import Reflection
from tests.perception.bayes.random_tracks import MOUNTS, NOISES, SENSORS, SETTINGS, P, new_memory
from tests.perception.bayes.rooms import fill, new_room, place_wall, reading, wall_ends

ROOM = (
    (-2.0, -1.5, 2.0, -1.5),
    (2.0, -1.5, 2.0, 1.5),
    (2.0, 1.5, 0.4, 1.5),
    (-0.5, 1.5, -2.0, 1.5),
    (-2.0, 1.5, -2.0, -1.5),
)
"""Ends of the walls, m; the upper wall has a doorway."""
TURNS = ((-1.2, -0.7), (1.2, 0.7), (-1.2, 0.7), (1.2, -0.7))
PATH = np.concatenate([np.linspace(a, b, 50, endpoint=False) for a, b in itertools.pairwise(TURNS)])


def walls_after(world: WorldConfig, path: Floats, memory: Memory) -> Floats:
    """Return the ends of the walls after a drive; the noise of the ranges is known."""
    memory.s[0].noise_level = int(np.abs(NOISES - (0.0, 0.01)).sum(axis=1).argmin())
    sonar = Sonar(SETTINGS.ring, compile_scene(world), world.acoustics, np.random.default_rng(3))
    for k, (x, y) in enumerate(path.tolist()):
        ranges = sonar.fire(Pose(x, y, 0.0), 0.3, range(k % 3, SENSORS, 3))
        m = place_readings(memory.s, P, MOUNTS, x, y, 0.3, ranges)
        associate_circles(memory.s, memory.tracks, P, m)
        update_walls(memory, P, m)
    return wall_ends(memory)


@pytest.mark.parametrize("model", ["specular", pytest.param("cone", marks=[pytest.mark.compiled, pytest.mark.soak])])
def test_each_wall_of_a_room_is_found_once_and_its_doorway_stays_open(model: Reflection) -> None:
    acoustics = AcousticsConfig(model=model, noise_relative=0.01, dropout=0.05, outliers=0.03, outlier_max_m=5.0)
    world = WorldConfig(
        wall=tuple(WallConfig(x1_m=a, y1_m=b, x2_m=c, y2_m=d) for a, b, c, d in ROOM), acoustics=acoustics
    )
    sides = {"left": 0, "right": 0, "lower": 0, "upper": 0}
    for x1, y1, x2, y2 in walls_after(world, PATH, new_memory()).tolist():
        if abs(x1 - x2) < abs(y1 - y2):
            assert (abs(x1), abs(x2)) == pytest.approx((2.0, 2.0), abs=0.05)
            sides["right" if x1 > 0.0 else "left"] += 1
        else:
            assert (abs(y1), abs(y2)) == pytest.approx((1.5, 1.5), abs=0.05)
            sides["upper" if y1 > 0.0 else "lower"] += 1
            assert y1 < 0.0 or max(x1, x2) < -0.3 or min(x1, x2) > 0.2
    assert sides["left"] == sides["right"] == sides["lower"] == 1
    assert sides["upper"] in {1, 2}


def test_echoes_of_a_named_drum_make_no_wall() -> None:
    world = WorldConfig(drum=(DrumConfig(x_m=0.0, y_m=1.2, radius_m=0.3048),), acoustics=AcousticsConfig())
    memory = new_memory()
    track = memory.tracks[0]
    track.status, track.x, track.y, track.radius, track.is_named = ESTABLISHED, 0.0, 1.2, 0.3048, 1
    assert len(walls_after(world, PATH * (1.0, 0.3), memory)) == 0


@pytest.mark.parametrize(("heard", "silent", "is_loud"), [(900.0, 100.0, 1), (790.0, 210.0, 0), (60.0, 4.0, 0)])
def test_slanting_walls_are_taken_to_answer_where_fewer_beams_are_silent_than_between_drums(
    heard: float, silent: float, is_loud: int
) -> None:
    memory = new_memory()
    memory.s[0].heard, memory.s[0].silent = heard, silent
    update_walls(memory, P, 0)
    assert memory.state["room"]["is_loud"][0] == is_loud


def test_an_echo_from_afar_that_its_wall_may_answer_is_none_of_its_end() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 0.0)
    find_corners(memory.s)
    edge = next(it for it in room.edges if it.is_used == 1 and it.second == 1)

    def is_walls(x: float, y: float) -> bool:
        off = edge.x - x, edge.y - y
        return may_be_of_wall(room, edge, reading(x, y, math.atan2(off[1], off[0]), math.hypot(*off)))

    assert is_walls(0.5, 0.1), "the wall would answer in the same range"
    assert not is_walls(0.5, 1.0), "from the side an end is farther than its wall"
    assert not is_walls(1.2, 0.1), "from near ends between mirrors answer"
    room.edge_echoes = 100.0
    assert not is_walls(0.5, 0.1), "where all answers, ends are heard from afar"
