"""The occupancy image of a run, pixel by pixel where a reading is simple."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from config.world import DrumConfig, PolygonConfig, WallConfig, WorldConfig
from runtime.analysis.export.occupancy_image import (
    BEFORE_ECHO_M,
    FREE,
    OCCUPIED,
    RESOLUTION_M,
    UNKNOWN,
    OccupancyImage,
    occupancy_image,
    world_outlines,
)
from runtime.analysis.timeline import ECHO, Echoes

HALF_ANGLE_RAD = math.radians(12.0)
WAY = np.zeros((1, 2))
BODY_M = 0.2


def readings(*ranges_m: float, bearing: float = 0.0) -> Echoes:
    """Return readings of one sensor at the origin."""
    rows = np.zeros(len(ranges_m), ECHO)
    rows["range_m"], rows["bearing"] = ranges_m, bearing
    return rows


def value_at(image: OccupancyImage, x: float, y: float) -> int:
    row = len(image.pixels) - 1 - int((y - image.y_m) / RESOLUTION_M)
    return int(image.pixels[row, int((x - image.x_m) / RESOLUTION_M)])


def test_free_is_what_two_echoes_have_passed_and_where_the_robot_stood() -> None:
    image = occupancy_image(WorldConfig(), readings(3.0, 3.0, math.inf, 5.0), HALF_ANGLE_RAD, WAY, BODY_M)
    assert [value_at(image, x, 0.0) for x in (1.0, 2.8, 3.0 - BEFORE_ECHO_M + 0.06, 4.0)] == [
        FREE, FREE, UNKNOWN, UNKNOWN,
    ]  # fmt: skip
    edge = math.tan(0.25 * HALF_ANGLE_RAD)
    assert (value_at(image, 2.0, 2.0 * edge), value_at(image, 2.0, 2.0 * math.tan(HALF_ANGLE_RAD))) == (FREE, UNKNOWN)
    assert (value_at(image, -0.15, 0.0), value_at(image, -0.3, 0.0)) == (FREE, UNKNOWN)


def test_what_was_recognised_is_occupied_wherever_sound_has_passed() -> None:
    world = WorldConfig(
        drum=(DrumConfig(x_m=2.0, y_m=0.0, radius_m=0.3),),
        wall=(WallConfig(x1_m=-1.0, y1_m=1.0, x2_m=4.0, y2_m=1.0),),
        polygon=(PolygonConfig(vertices_m=((3.0, -1.0), (4.0, -1.0), (4.0, -2.0))),),
    )
    image = occupancy_image(world, readings(6.0, 6.0), HALF_ANGLE_RAD, WAY, BODY_M)
    for x, y in ((1.7, 0.0), (2.3, 0.0), (2.0, 0.3), (0.5, 1.0), (3.5, -1.0), (4.0, -1.5), (3.52, -1.52)):
        assert value_at(image, x, y) == OCCUPIED, (x, y)
    assert value_at(image, 5.0, 0.0) == FREE
    assert len(world_outlines(world)) == 3


def test_the_files_are_those_of_map_server(tmp_path: Path) -> None:
    image = occupancy_image(WorldConfig(), readings(3.0, 3.0, bearing=0.7), HALF_ANGLE_RAD, WAY, BODY_M)
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


def test_an_image_beyond_all_measure_is_refused() -> None:
    far = np.array([(0.0, 0.0), (9000.0, 9000.0)])
    with pytest.raises(ValueError, match="too large"):
        occupancy_image(WorldConfig(), readings(), HALF_ANGLE_RAD, far, BODY_M)
