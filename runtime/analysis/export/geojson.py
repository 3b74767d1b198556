"""A run's map as GeoJSON (RFC 7946), for geographic information systems and drawing programs.

The coordinates are metres in the map's own frame, not degrees: a room has no place on the globe. That is said in
members of the collection, which other programs pass over.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final, Literal

import orjson
import tomli_w

from config.load import ConfigError, parse_text
from config.places import PLACE_KEYS, PlacesConfig
from config.world import DrumConfig, WorldConfig

CIRCLE_POINTS: Final = 48
"""Corners of the polygon that stands for a round object."""
KEPT: Final = ("name", "heading_deg", "speed_max_m_s")
"""Properties of what an operator has marked, as in a map file."""
DIGITS: Final = 4
"""Decimals of a coordinate, m."""


def world_geojson(world: WorldConfig, name: str, frame: Literal["odom", "map"]) -> dict[str, Any]:
    """Return a world as a feature collection: drums and polygons as areas, walls as lines.

    Coordinates are in `frame`.
    """
    drums = [
        _feature("Polygon", [_circle(drum)], kind="drum", x_m=drum.x_m, y_m=drum.y_m, radius_m=drum.radius_m)
        for drum in world.drum
    ]
    areas = [
        _feature("Polygon", [_ring(corners)], kind=kind)
        for kind, corners in (
            *(("polygon", polygon.vertices_m) for polygon in world.polygon),
            *(("box", tuple(box.corners_m())) for box in world.box),
        )
    ]
    walls = [_feature("LineString", [_point(*at) for at in wall.points_m()], kind="wall") for wall in world.wall]
    features = [*drums, *areas, *walls, *_marked(world.places())]
    return {"type": "FeatureCollection", "name": name, "units": "m", "frame": frame, "features": features}


def places_of_geojson(text: str, name: str) -> PlacesConfig:
    """Return the places of a feature collection, as `world_geojson` writes them; other features are passed over.

    A point with a name is a place. A line or an area of the kinds `no_go_line`, `no_go_area` and `speed_area` is one.

    Raises
    ------
    ConfigError
        The text is no feature collection in metres, or a feature of these kinds is invalid.
    """
    table: dict[str, list[dict[str, Any]]] = {key: [] for key in PLACE_KEYS}
    try:
        collection = orjson.loads(text)
        if collection.get("units") != "m":
            raise ConfigError(f'{name}: not a map in metres: the collection lacks "units": "m"')
        for feature in collection["features"]:
            given, shape = feature["properties"], feature["geometry"]
            kind, points = given.get("kind"), shape["coordinates"]
            row = {key: given[key] for key in KEPT if given.get(key) is not None}
            if kind == "place" and shape["type"] == "Point":
                table["place"].append({**row, "x_m": float(points[0]), "y_m": float(points[1])})
            elif kind == "no_go_line" and shape["type"] == "LineString":
                table[kind].append({**row, "points_m": _corners(points)})
            elif kind in {"no_go_area", "speed_area"} and shape["type"] == "Polygon":
                table[kind].append({**row, "vertices_m": _corners(points[0][:-1])})
        toml = tomli_w.dumps(table)  # which has no null
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise ConfigError(f"{name}: not GeoJSON of a map ({type(error).__name__})") from None
    return parse_text(PlacesConfig, toml, name)


def _corners(points: list[list[float]]) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y, *_ in points]


def _marked(places: PlacesConfig) -> Iterator[dict[str, Any]]:
    """Yield a feature for each place, line and area that an operator has marked."""
    for place in places.place:
        yield _feature(
            "Point", _point(place.x_m, place.y_m), kind="place", name=place.name, heading_deg=place.heading_deg
        )
    for line in places.no_go_line:
        yield _feature("LineString", [_point(*point) for point in line.points_m], kind="no_go_line", name=line.name)
    for area in places.no_go_area:
        yield _feature("Polygon", [_ring(area.vertices_m)], kind="no_go_area", name=area.name)
    for slow in places.speed_area:
        limit = slow.speed_max_m_s
        yield _feature("Polygon", [_ring(slow.vertices_m)], kind="speed_area", name=slow.name, speed_max_m_s=limit)


def _feature(shape: str, coordinates: list[Any], **properties: object) -> dict[str, Any]:
    """Return a GeoJSON feature."""
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": shape, "coordinates": coordinates},
    }


def _circle(drum: DrumConfig) -> list[list[float]]:
    """Return the corners round a drum, through which its true outline goes."""
    turns = [math.tau * k / CIRCLE_POINTS for k in range(CIRCLE_POINTS)]
    return _ring(
        tuple((drum.x_m + drum.radius_m * math.cos(a), drum.y_m + drum.radius_m * math.sin(a)) for a in turns)
    )


def _ring(corners: tuple[tuple[float, float], ...]) -> list[list[float]]:
    """Return a closed ring of corners, counter-clockwise as the standard asks."""
    following = (*corners[1:], corners[0])
    twice_area = sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in zip(corners, following, strict=True))
    turned = corners if twice_area >= 0.0 else corners[::-1]
    return [_point(x, y) for x, y in (*turned, turned[0])]


def _point(x: float, y: float) -> list[float]:
    return [round(x, DIGITS), round(y, DIGITS)]
