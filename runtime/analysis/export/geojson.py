"""A run's map as GeoJSON (RFC 7946), for geographic information systems and drawing programs.

The coordinates are metres in the map's own frame, not degrees: a room has no place on the globe. That is said in
members of the collection, which other programs pass over.
"""

from __future__ import annotations

import math
from typing import Any, Final, Literal

from config.world import DrumConfig, WorldConfig

CIRCLE_POINTS: Final = 48
"""Corners of the polygon that stands for a round object."""
DIGITS: Final = 4
"""Decimals of a coordinate, m."""


def world_geojson(world: WorldConfig, name: str, frame: Literal["odom", "map"]) -> dict[str, Any]:
    """Return a world as a feature collection: drums and polygons as areas, walls as lines.

    Parameters
    ----------
    world : WorldConfig
        What was recognised.
    name : str
        Of the collection.
    frame : {"odom", "map"}
        In which the coordinates are.
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
    walls = [
        _feature("LineString", [_point(wall.x1_m, wall.y1_m), _point(wall.x2_m, wall.y2_m)], kind="wall")
        for wall in world.wall
    ]
    return {
        "type": "FeatureCollection", "name": name, "units": "m", "frame": frame, "features": [*drums, *areas, *walls],
    }  # fmt: skip


def _feature(shape: str, coordinates: list[Any], **properties: object) -> dict[str, Any]:
    return {
        "type": "Feature", "properties": properties, "geometry": {"type": shape, "coordinates": coordinates},
    }  # fmt: skip


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
