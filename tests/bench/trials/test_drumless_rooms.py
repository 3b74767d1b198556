"""Random rooms without a drum: two boxes, clutter of other radii, nothing overlaps, and a drive fits."""

from __future__ import annotations

import math

from bench.trials.drumless_rooms import APART_M, drumless_room
from bench.trials.furnished_rooms import CLEAR_M, drive
from config.world import AcousticsConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene

DRUM_M = 0.3048


def test_rooms_have_walls_boxes_and_only_on_request_clutter_but_no_drum() -> None:
    pieces = set()
    for seed in range(12):
        plain, cluttered = (drumless_room(seed, AcousticsConfig(), is_cluttered=it).world for it in (False, True))
        assert (len(plain.wall), len(plain.box), len(plain.drum) + len(plain.polygon)) == (4, 2, 0)
        assert plain.wall == cluttered.wall
        pieces.add(len(cluttered.drum) + len(cluttered.polygon))
        assert all(abs(it.radius_m - DRUM_M) > 0.1 for it in cluttered.drum)
        for drum in cluttered.drum:
            others = cluttered.model_copy(update={"drum": tuple(it for it in cluttered.drum if it != drum)})
            scene = compile_scene(others)
            assert clearance(drum.x_m, drum.y_m, scene.circles, scene.segments) >= drum.radius_m + APART_M
    assert len(pieces) > 2


def test_a_drive_stays_clear_of_everything_and_outside_of_boxes() -> None:
    for seed in range(3):
        room = drumless_room(seed, AcousticsConfig(), is_cluttered=True)
        scene = compile_scene(room.world)
        for x, y, _ in drive(room, seed, 0.2, 20.0).tolist():
            assert clearance(x, y, scene.circles, scene.segments) >= CLEAR_M
            assert all(math.dist((x, y), (box.x_m, box.y_m)) > CLEAR_M for box in room.world.box)


def test_a_seed_determines_the_room() -> None:
    rooms = [drumless_room(seed, AcousticsConfig(), is_cluttered=True) for seed in (3, 3, 4)]
    assert rooms[0] == rooms[1] != rooms[2]
