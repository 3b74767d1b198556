"""What changed in a map: openings, objects moved, gone and new, and what was not looked at stays."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from config.world import BoxConfig, DrumConfig, PolygonConfig, WallConfig, WorldConfig
from runtime.analysis.map_changes import LOOKS_MIN, compare_with_map, looks_at_circle, looks_at_wall
from runtime.analysis.timeline import ECHO, Echoes
from tests.polylines import BEND

HALF_ANGLE_RAD = math.radians(15.0)
WAY = np.arange(0.0, 4.0, 0.02)
UP = 0.5 * math.pi
WALL = WallConfig(x1_m=0.0, y1_m=2.0, x2_m=4.0, y2_m=2.0)
DRUM = DrumConfig(x_m=2.0, y_m=1.0, radius_m=0.3)


def looking_up(range_of: dict[tuple[float, float], float], otherwise: float = math.inf) -> Echoes:
    """Return a reading every two centimetres along x from 0 to 4 m, looking along y, with the range there."""
    echoes = np.zeros(len(WAY), ECHO)
    echoes["x"], echoes["bearing"], echoes["range_m"] = WAY, UP, otherwise
    for (low, high), range_m in range_of.items():
        echoes["range_m"][(low <= WAY) & (high > WAY)] = range_m
    return echoes


def compare(known: WorldConfig, found: WorldConfig, echoes: Echoes) -> tuple[list[str], WorldConfig]:
    names = ["drum"] * len(found.drum)
    changes, corrected = compare_with_map(known, found, names, echoes, HALF_ANGLE_RAD)
    return [str(change) for change in changes], corrected


def test_a_wall_with_an_opening_is_two_walls() -> None:
    said, corrected = compare(
        WorldConfig(wall=(WALL,)), WorldConfig(), looking_up({(0.0, 1.5): 2.0, (1.5, 2.5): 4.1, (2.5, 4.0): 2.0})
    )
    assert said == ["opened: wall at (2.00, 2.00) m, 1.00 m long"]
    assert [(wall.x1_m, wall.x2_m) for wall in corrected.wall] == [(0.0, 1.5), (2.5, 4.0)]


def test_a_wall_that_no_reading_hits_is_gone_and_one_that_none_looked_at_stays() -> None:
    other = WallConfig(x1_m=0.0, y1_m=-2.0, x2_m=4.0, y2_m=-2.0)
    said, corrected = compare(WorldConfig(wall=(WALL, other)), WorldConfig(), looking_up({}))
    assert said == ["gone: wall at (2.00, 2.00) m, 4.00 m long"]
    assert corrected.wall == (other,)


def test_false_echoes_and_missing_ones_change_nothing() -> None:
    echoes = looking_up({(0.0, 4.0): 2.0})
    echoes["range_m"][::10] = math.inf
    echoes["range_m"][5::20] = 0.7
    known = WorldConfig(wall=(WALL,), drum=(DrumConfig(x_m=2.0, y_m=-1.0, radius_m=0.3),))
    assert compare(known, known, echoes) == ([], known)


def test_what_stands_in_front_hides_what_is_behind() -> None:
    known = WorldConfig(wall=(WALL,), drum=(DRUM,))
    said, corrected = compare(known, known, looking_up({(0.0, 1.7): 2.0, (1.7, 2.3): 0.7, (2.3, 4.0): 2.0}))
    assert said == []
    assert corrected == known


@pytest.mark.parametrize("found", [(), (DrumConfig(x_m=3.0, y_m=1.0, radius_m=0.3),)])
def test_a_drum_is_gone_or_moved(found: tuple[DrumConfig, ...]) -> None:
    said, corrected = compare(WorldConfig(drum=(DRUM,)), WorldConfig(drum=found), looking_up({}))
    moved = "moved: drum at (3.00, 1.00) m, by 1.00 m"
    assert said == ([moved] if found else ["gone: drum at (2.00, 1.00) m"])
    assert corrected.drum == found


def test_a_drum_found_where_the_map_has_one_keeps_the_map_s_place() -> None:
    seen = DRUM.model_copy(update={"x_m": 2.1})
    assert compare(WorldConfig(drum=(DRUM,)), WorldConfig(drum=(seen,)), looking_up({}))[1].drum == (DRUM,)


def test_new_objects_are_added() -> None:
    corners = ((5.0, 0.0), (6.0, 0.0), (6.0, 1.0))
    far = DrumConfig(x_m=9.0, y_m=9.0, radius_m=0.3)
    found = WorldConfig(
        drum=(far,),
        polygon=(PolygonConfig(vertices_m=corners),),
        wall=(
            WallConfig(x1_m=0.0, y1_m=-3.0, x2_m=2.0, y2_m=-3.0),
            WallConfig(x1_m=1.0, y1_m=2.1, x2_m=3.0, y2_m=2.1),  # the map's own
            WallConfig(x1_m=7.0, y1_m=0.0, x2_m=7.1, y2_m=0.0),  # too short to be sure
        ),
    )
    said, corrected = compare(WorldConfig(wall=(WALL,)), found, looking_up({(0.0, 4.0): 2.0}))
    assert said == [
        "new: drum at (9.00, 9.00) m",
        "new: polygon at (5.67, 0.33) m",
        "new: wall at (1.00, -3.00) m, 2.00 m long",
    ]
    assert (corrected.drum, corrected.polygon, len(corrected.wall)) == ((far,), found.polygon, 2)


def test_boxes_and_polygons_that_are_gone() -> None:
    box = BoxConfig(x_m=2.0, y_m=1.5, width_m=1.0, depth_m=0.5)
    polygon = PolygonConfig(vertices_m=((1.0, -1.0), (3.0, -1.0), (2.0, -2.0)))
    known = WorldConfig(box=(box,), polygon=(polygon,), wall=(WALL,))
    side_m = min(y for _, y in box.corners_m())
    there = looking_up({(0.0, 1.4): 2.0, (1.4, 2.6): side_m, (2.6, 4.0): 2.0})
    assert compare(known, WorldConfig(), there) == ([], known)
    said, corrected = compare(known, WorldConfig(), looking_up({(0.0, 4.0): 2.0}))
    assert said == ["gone: box at (2.00, 1.50) m"]
    assert (corrected.box, corrected.polygon) == ((), (polygon,))


def test_a_polygon_whose_first_corner_is_given_again_and_a_wall_without_length_are_compared() -> None:
    closed = PolygonConfig(vertices_m=((1.0, 1.5), (3.0, 1.5), (2.0, 2.5), (1.0, 1.5)))
    point = WallConfig(x1_m=9.0, y1_m=9.0, x2_m=9.0, y2_m=9.0)
    known = WorldConfig(polygon=(closed,), wall=(point,))
    found = WorldConfig(wall=(WALL.model_copy(update={"y1_m": 5.0, "y2_m": 5.0}),))
    said, corrected = compare(known, found, looking_up({(1.0, 3.0): 1.5}))
    assert said == ["new: wall at (2.00, 5.00) m, 4.00 m long"]
    assert corrected.polygon == (closed,)


def test_looks_count_only_within_the_beam_and_in_reach() -> None:
    circle = (2.0, 1.0, 0.3)
    echoes = looking_up({(0.0, 4.0): 0.7})
    looks = looks_at_circle(echoes, circle, HALF_ANGLE_RAD)
    assert 0 < looks.hits[0] < len(WAY) // 2
    assert looks.passes[0] == 0
    echoes["bearing"] += math.pi
    assert sum(itertools.chain(*looks_at_circle(echoes, circle, HALF_ANGLE_RAD))) == 0
    far = looks_at_wall(looking_up({}), (0.0, 30.0, 4.0, 30.0), HALF_ANGLE_RAD)
    assert far.passes.sum() == 0
    few = looking_up({})[: LOOKS_MIN - 1]
    assert looks_at_wall(few, (0.0, 2.0, 4.0, 2.0), HALF_ANGLE_RAD).runs() == []


def test_a_new_polyline_enters_the_map_and_one_along_a_known_wall_does_not() -> None:
    known = WorldConfig(wall=(WALL,))
    along = replace(BEND, points=np.array([[0.0, 1.9], [1.0, 2.1], [2.0, 1.9], [3.0, 2.1]]))
    short = replace(BEND, points=0.2 * BEND.points)
    changes, corrected = compare_with_map(
        known, WorldConfig(), (), looking_up({(0.0, 4.0): 2.0}), HALF_ANGLE_RAD, (BEND, along, short)
    )
    assert [str(change) for change in changes] == ["new: outline at (1.67, 0.33) m, 2.00 m long"]
    assert [(w.x1_m, w.y1_m, w.x2_m, w.y2_m) for w in corrected.wall] == [
        (0.0, 2.0, 4.0, 2.0), (1.0, 0.0, 2.0, 0.0), (2.0, 0.0, 2.0, 1.0),
    ]  # fmt: skip
