"""World files of what was recognised."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from config.load import load_model, parse_text
from config.model import ModelConfig
from config.places import NoGoAreaConfig, PlaceConfig, PlacesConfig
from config.world import WorldConfig
from perception.detected_object import DetectedObject
from runtime.analysis.export.world_file import placed_vertices, text_with_places, with_places, world_of, world_text
from tests.polylines import BEND

BOX = ModelConfig(name="box", closed=True, vertices_m=((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)))
CORNER = ModelConfig(name="corner", closed=False, vertices_m=((1.0, 0.0), (0.0, 0.0), (0.0, 1.0)))
DRUM = load_model("drum")


def seen(model: str, x: float, y: float, theta: float = 0.0) -> DetectedObject:
    return DetectedObject(model, x, y, theta, 0.01, 30, 0.99)


def test_each_model_becomes_what_a_world_has_for_it_and_can_be_read_again() -> None:
    objects = (
        seen(DRUM.name, 1.0, 2.0), seen("box", 3.0, 0.0, 0.5 * math.pi), seen("corner", -1.0, 0.0),
        seen("unknown", 9.0, 9.0),
    )  # fmt: skip
    world = world_of(objects, np.array([[0.0, 5.0, 4.0, 5.00001]]), (DRUM, BOX, CORNER))
    assert [(drum.x_m, drum.y_m, drum.radius_m) for drum in world.drum] == [(1.0, 2.0, DRUM.arc_radius_m)]
    (polygon,) = world.polygon
    assert np.array(polygon.vertices_m) == pytest.approx(
        np.array([(2.8, 0.3), (2.8, -0.3), (3.2, -0.3), (3.2, 0.3)]), abs=1e-9
    )
    assert [(w.x1_m, w.y1_m, w.x2_m, w.y2_m) for w in world.wall] == [
        (0.0, 5.0, 4.0, 5.0), (0.0, 0.0, -1.0, 0.0), (-1.0, 0.0, -1.0, 1.0),
    ]  # fmt: skip
    text = world_text(world, ("a line", "and another"))
    assert text.startswith("# a line\n# and another\n")
    assert WorldConfig.model_validate(tomllib.loads(text)) == world


def test_a_polyline_is_a_wall_for_each_of_its_pieces() -> None:
    doubled = replace(BEND, points=np.insert(BEND.points, 1, BEND.points[1] + 1e-6, axis=0))
    world = world_of((), np.array([[0.0, 5.0, 4.0, 5.0]]), (DRUM,), (doubled,))
    assert [(w.x1_m, w.y1_m, w.x2_m, w.y2_m) for w in world.wall] == [
        (0.0, 5.0, 4.0, 5.0), (1.0, 0.0, 2.0, 0.0), (2.0, 0.0, 2.0, 1.0),
    ]  # fmt: skip
    assert WorldConfig.model_validate(tomllib.loads(world_text(world, ()))) == world


def test_an_empty_map_is_a_world_without_anything() -> None:
    world = world_of((), np.zeros((0, 4)), (DRUM,))
    assert WorldConfig.model_validate(tomllib.loads(world_text(world, ()))) == WorldConfig()


def test_a_model_is_turned_about_its_origin() -> None:
    assert placed_vertices(CORNER, seen("corner", 1.0, 1.0, math.pi)) == pytest.approx(
        np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0)]), abs=1e-12
    )


MAP = """# My room, measured by hand.
[[wall]]  # north
x1_m = 0.0
y1_m = 3.0
x2_m = 4.0
y2_m = 3.0

[[place]]
name = "old"
x_m = 1.0
y_m = 1.0

[[no_go_area]]
vertices_m = [
  [1.0, 1.0],
  [2, 1],
  [2.0, 2.0],
]

# where it starts
[start]
x_m = 0.5
y_m = 0.5
heading_deg = 0.0
"""
RUG = NoGoAreaConfig(name="rug", vertices_m=((5.0, 5.0), (6.0, 5.0), (6.0, 6.0)))


@pytest.mark.parametrize(
    "places",
    [
        PlacesConfig(),
        PlacesConfig(place=(PlaceConfig(name="lift", x_m=1.0, y_m=-2.0, heading_deg=90.0),), no_go_area=(RUG,)),
    ],
)
def test_a_map_gets_other_places_and_keeps_its_other_lines(places: PlacesConfig) -> None:
    text = text_with_places(MAP, places)
    before, after = (parse_text(WorldConfig, one, "map") for one in (MAP, text))
    assert after == with_places(before, places)
    head, _, tail = MAP.partition("[[place]]")
    rest = (head + tail[tail.index("# where") :]).splitlines()
    assert [line for line in text.partition("\n[[place]]")[0].splitlines() if line] == [line for line in rest if line]
    assert "old" not in text
    assert text_with_places(text, places) == text


def test_places_in_a_form_that_is_not_found_in_lines_are_replaced_all_the_same() -> None:
    text = "place = [{ name = 'old', x_m = 1.0, y_m = 1.0 }]\n" + MAP.partition("[[place]]")[0]
    world = parse_text(WorldConfig, text_with_places(text, PlacesConfig(no_go_area=(RUG,))), "map")
    assert (len(world.wall), world.places()) == (1, PlacesConfig(no_go_area=(RUG,)))
