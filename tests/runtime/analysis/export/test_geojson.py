"""GeoJSON of a map: rings closed and counter-clockwise, walls as lines, and what the coordinates are."""

from __future__ import annotations

import itertools
import json
import math

import pytest

from config.load import ConfigError, load_world
from config.world import PolygonConfig, WallConfig, WorldConfig
from runtime.analysis.export.geojson import CIRCLE_POINTS, places_of_geojson, world_geojson


@pytest.mark.parametrize("name", ["room", "irregular", "office", "hallway"])
def test_every_surface_is_a_feature_of_the_right_shape(name: str) -> None:
    world = load_world(name)
    found = json.loads(json.dumps(world_geojson(world, name, "odom")))
    assert (found["type"], found["name"], found["frame"], found["units"]) == ("FeatureCollection", name, "odom", "m")
    kinds = [feature["properties"]["kind"] for feature in found["features"]]
    counts = {"drum": len(world.drum), "polygon": len(world.polygon), "box": len(world.box), "wall": len(world.wall)}
    assert {kind: kinds.count(kind) for kind in counts} == counts
    for feature in found["features"]:
        shape, coordinates = feature["geometry"]["type"], feature["geometry"]["coordinates"]
        if shape == "LineString":
            assert len(coordinates) == 2
            continue
        (ring,) = coordinates
        assert ring[0] == ring[-1]
        area = 0.5 * sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in itertools.pairwise(ring))
        assert area > 0.0, "a ring turns counter-clockwise"
        if feature["properties"]["kind"] == "drum":
            exact = math.pi * feature["properties"]["radius_m"] ** 2
            assert area == pytest.approx(
                exact * math.sin(math.tau / CIRCLE_POINTS) * CIRCLE_POINTS / math.tau, rel=0.01
            )


def test_a_bent_wall_is_a_line_through_its_pieces() -> None:
    wall = WallConfig(x1_m=0.0, y1_m=0.0, x2_m=3.0, y2_m=0.0, bend_m=0.03)
    (found,) = world_geojson(WorldConfig(wall=(wall,)), "a", "map")["features"]
    places = found["geometry"]["coordinates"]
    assert (places[0], places[-1]) == ([0.0, 0.0], [3.0, 0.0])
    assert max(y for _, y in places) == pytest.approx(0.03, abs=1e-3)


@pytest.mark.parametrize("name", [{"a": None}, [None], {"a": [None]}])
def test_a_name_that_is_no_text_is_refused(name: object) -> None:
    """Such a file comes from a page: it must not end in an error of the program."""
    place = {"properties": {"kind": "place", "name": name}, "geometry": {"type": "Point", "coordinates": [1.0, 2.0]}}
    with pytest.raises(ConfigError, match="map: not GeoJSON of a map"):
        places_of_geojson(json.dumps({"units": "m", "features": [place]}), "map")


def test_a_polygon_given_clockwise_is_turned() -> None:
    corners = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0))
    for order in (corners, corners[::-1]):
        found = world_geojson(WorldConfig(polygon=(PolygonConfig(vertices_m=order),)), "a", "map")["features"]
        (ring,) = found[0]["geometry"]["coordinates"]
        assert sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in itertools.pairwise(ring)) > 0.0
