"""The occupancy image of a run, pixel by pixel where a reading is simple."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from config.robot import FiringConfig, RingConfig, SensorConfig
from config.world import BoxConfig, DrumConfig, PolygonConfig, WallConfig, WorldConfig
from runtime.analysis.export.occupancy_image import (
    CELL_M,
    FREE,
    OCCUPIED,
    RESOLUTION_M,
    UNKNOWN,
    OccupancyImage,
    explained_bearings,
    occupancy_image,
    slanting_answers,
    world_outlines,
)
from runtime.analysis.timeline import ECHO, Echoes

HALF_ANGLE_RAD = math.radians(12.0)
RING = RingConfig(
    sensors=(SensorConfig(x_m=0.0, y_m=0.0, angle_deg=0.0),), beam_half_angle_deg=12.0, resolution_m=0.0,
    range_min_m=0.1, range_max_m=7.0, firing=FiringConfig(sets=((0,),)),
)  # fmt: skip
WAY = np.zeros((1, 2))
BODY_M = 0.2


def readings(*ranges_m: float, bearing: float = 0.0) -> Echoes:
    """Return readings of one sensor at the origin, one after another."""
    rows = np.zeros(len(ranges_m), ECHO)
    rows["robot_s"] = np.arange(len(ranges_m))
    rows["range_m"], rows["bearing"] = ranges_m, bearing
    return rows


def value_at(image: OccupancyImage, x: float, y: float) -> int:
    row = len(image.pixels) - 1 - int((y - image.y_m) / RESOLUTION_M)
    return int(image.pixels[row, int((x - image.x_m) / RESOLUTION_M)])


def driving(wall_x: float) -> Echoes:
    """Return readings of a sensor that drives at a wall and looks at it."""
    rows = readings(*(wall_x - 0.1 * k for k in range(12)))
    rows["x"] = 0.1 * np.arange(12)
    return rows


def test_free_is_what_sound_has_passed_and_where_the_robot_stood_and_occupied_what_answers() -> None:
    image = occupancy_image(WorldConfig(), driving(3.03), RING, WAY, BODY_M)
    assert [value_at(image, x, 0.02) for x in (1.5, 2.5, 3.03, 3.3)] == [FREE, FREE, OCCUPIED, UNKNOWN]
    assert [value_at(image, 2.5, y) for y in (0.2, 0.6)] == [FREE, UNKNOWN]
    assert (value_at(image, -0.15, 0.0), value_at(image, -0.3, 0.0)) == (FREE, UNKNOWN)


def test_boxes_and_bent_walls_of_a_corrected_map_are_occupied_where_they_are() -> None:
    """A run in a known room has them from the room's file."""
    box = BoxConfig(x_m=2.0, y_m=1.0, width_m=1.0, depth_m=0.5)
    bent = WallConfig(x1_m=1.0, y1_m=-1.0, x2_m=4.0, y2_m=-1.0, bend_m=0.3)
    image = occupancy_image(WorldConfig(box=(box,), wall=(bent,)), readings(3.0), RING, WAY, BODY_M)
    assert [value_at(image, x, y) for x, y in ((2.0, 0.76), (1.51, 1.0), (2.5, -0.71))] == [OCCUPIED] * 3
    assert value_at(image, 2.5, -1.01) == UNKNOWN


def test_where_all_surfaces_were_mapped_other_echoes_are_strays() -> None:
    """The grid's cell is not free for that, nor are those beside it."""
    wall = WorldConfig(wall=(WallConfig(x1_m=-1.0, y1_m=1.0, x2_m=4.0, y2_m=1.0),))
    image = occupancy_image(wall, driving(3.03), RING, WAY, BODY_M, surfaces_mapped=True)
    assert [value_at(image, x, 0.02) for x in (2.5, 2.93, 3.03, 3.13)] == [FREE, UNKNOWN, UNKNOWN, UNKNOWN]
    assert value_at(image, 2.0, 1.0) == OCCUPIED


def test_no_pixel_is_free_within_a_cell_of_an_occupied_one() -> None:
    image = occupancy_image(WorldConfig(), driving(3.03), RING, WAY, BODY_M)
    occupied, free = (np.argwhere(image.pixels == value) for value in (OCCUPIED, FREE))
    apart = np.hypot(*(occupied[:, None] - free[None]).transpose(2, 0, 1)).min()
    assert apart * RESOLUTION_M > CELL_M


def test_an_echo_that_something_recognised_explains_marks_its_contact_only() -> None:
    rows = readings(2.02, 2.02, 1.0, math.inf, bearing=0.1)
    drum = WorldConfig(drum=(DrumConfig(x_m=2.3, y_m=0.1, radius_m=0.3),))
    found = explained_bearings(drum, rows, HALF_ANGLE_RAD)
    assert found[:2] == pytest.approx(math.atan2(0.1, 2.3) - 0.1)
    assert np.isnan(found[2:]).all()
    wall = WorldConfig(wall=(WallConfig(x1_m=2.0, y1_m=-1.0, x2_m=2.0, y2_m=1.0),))
    assert explained_bearings(wall, rows, HALF_ANGLE_RAD)[0] == pytest.approx(-0.1)
    ended = WorldConfig(wall=(WallConfig(x1_m=2.0, y1_m=0.5, x2_m=2.0, y2_m=1.0),))
    assert np.isnan(explained_bearings(ended, rows, HALF_ANGLE_RAD)).all()


def test_silent_beams_on_slanting_walls_show_mirrors() -> None:
    wall = WorldConfig(wall=(WallConfig(x1_m=2.0, y1_m=-3.0, x2_m=2.0, y2_m=3.0),))
    answer_m = 2.0 / math.cos(0.5 - HALF_ANGLE_RAD)
    silent = math.inf
    for ranges_m, shown in ((19 * (silent,), 0), (20 * (silent,), -1), (9 * (answer_m,), 1), (30 * (1.0,), 0)):
        for bearing in (-0.5, 0.5):
            assert slanting_answers(wall, readings(*ranges_m, bearing=bearing), RING) == shown
    for bearing in (0.1, 1.2, 2.0):  # the foot is in the beam, the edge meets the wall's end, or no wall
        assert slanting_answers(wall, readings(*30 * (silent,), bearing=bearing), RING) == 0


def test_what_was_recognised_is_occupied_wherever_sound_has_passed() -> None:
    world = WorldConfig(
        drum=(DrumConfig(x_m=2.0, y_m=0.0, radius_m=0.3),),
        wall=(WallConfig(x1_m=-1.0, y1_m=1.0, x2_m=4.0, y2_m=1.0),),
        polygon=(PolygonConfig(vertices_m=((3.0, -1.0), (4.0, -1.0), (4.0, -2.0))),),
    )
    image = occupancy_image(world, readings(6.0, 6.0), RING, WAY, BODY_M)
    for x, y in ((1.7, 0.0), (2.3, 0.0), (2.0, 0.3), (0.5, 1.0), (3.5, -1.0), (4.0, -1.5), (3.52, -1.52)):
        assert value_at(image, x, y) == OCCUPIED, (x, y)
    assert len(world_outlines(world)) == 5


def test_the_files_are_those_of_map_server(tmp_path: Path) -> None:
    image = occupancy_image(WorldConfig(), readings(3.0, 3.0, bearing=0.7), RING, WAY, BODY_M)
    beside = image.write(tmp_path / "map.pgm")
    data = (tmp_path / "map.pgm").read_bytes()
    head = re.match(rb"P5\n(\d+) (\d+)\n255\n", data)
    assert head is not None
    columns, rows = int(head[1]), int(head[2])
    assert len(data) - head.end() == rows * columns
    assert (rows, columns) == image.pixels.shape
    yaml = dict(line.split(": ", 1) for line in beside.read_text().splitlines())
    assert (yaml["image"], yaml["resolution"], yaml["negate"]) == ("map.pgm", "0.05", "0")
    assert yaml["origin"] == f"[{image.x_m:.3f}, {image.y_m:.3f}, 0.0]"
    beside = image.write(tmp_path / "hall #2: new.pgm")
    assert beside.read_text().splitlines()[0] == 'image: "hall #2: new.pgm"', "no comment of YAML"


def test_an_image_beyond_all_measure_is_refused() -> None:
    far = np.array([(0.0, 0.0), (9000.0, 9000.0)])
    with pytest.raises(ValueError, match="too large"):
        occupancy_image(WorldConfig(), readings(), RING, far, BODY_M)
    with pytest.raises(ValueError, match="4096 cells is too large"):
        occupancy_image(WorldConfig(), readings(), RING, np.array([(0.0, 0.0), (300.0, 0.0)]), BODY_M)
