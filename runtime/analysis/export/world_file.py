"""A finished run's map as a world file: drums, polygons and walls, in the frame of the run's odometry.

The map of one run can be the world of the emulator, and the known room of the next run.
"""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import tomli_w

from config.model import ModelConfig
from config.places import PLACE_KEYS, PlacesConfig
from config.world import DrumConfig, PolygonConfig, WallConfig, WorldConfig
from drivers.messages import Floats
from perception.detected_object import DetectedObject
from perception.polyline import Polyline

HEADER: Final = re.compile(r"""\s*\[\[?\s*["']?(?P<name>[A-Za-z_][\w-]*)["']?\s*[\].]""")
"""The first line of a table; a line of coordinates within a list has no letter."""
DIGITS: Final = 4
"""Decimals of a length, m."""


def world_of(
    objects: Sequence[DetectedObject],
    walls: Floats,
    models: Sequence[ModelConfig],
    polylines: Sequence[Polyline] = (),
) -> WorldConfig:
    """Return the world of what was recognised.

    A model with an arc becomes a drum, a closed polygon a polygon, and each side of an open one a wall; so does each
    piece of a polyline.

    Walls are ends x, y, x, y (m), in the frame of the polylines. Objects that are none of the models are left out.
    """
    by_name = {model.name: model for model in models}
    drums, polygons, sides = list[DrumConfig](), list[PolygonConfig](), [tuple(row) for row in walls.tolist()]
    for seen in objects:
        model = by_name.get(seen.model)
        if model is None:
            continue
        if model.arc_radius_m is not None:
            drums.append(
                DrumConfig(x_m=round(seen.x, DIGITS), y_m=round(seen.y, DIGITS), radius_m=model.arc_radius_m)
            )
            continue
        corners = [(round(x, DIGITS), round(y, DIGITS)) for x, y in placed_vertices(model, seen).tolist()]
        if model.closed:
            polygons.append(PolygonConfig(vertices_m=tuple(corners)))
        else:
            sides += [(*a, *b) for a, b in itertools.pairwise(corners)]
    pieces = (wall for polyline in polylines for wall in polyline_walls(polyline))
    return WorldConfig(drum=tuple(drums), polygon=tuple(polygons), wall=(*(_wall(*side) for side in sides), *pieces))


def polyline_walls(polyline: Polyline) -> list[WallConfig]:
    """Return each piece of a polyline as a wall, but for those that rounding to `DIGITS` makes a point."""
    places = polyline.points.round(DIGITS).tolist()
    return [_wall(*a, *b) for a, b in itertools.pairwise(places) if a != b]


def _wall(x1: float, y1: float, x2: float, y2: float) -> WallConfig:
    x1, y1, x2, y2 = (round(value, DIGITS) for value in (x1, y1, x2, y2))
    return WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2)


def with_places(world: WorldConfig, places: PlacesConfig) -> WorldConfig:
    """Return a world with what an operator has marked on its map."""
    return world.model_copy(update={key: getattr(places, key) for key in PLACE_KEYS})


def text_with_places(text: str, places: PlacesConfig) -> str:
    """Return the text of a world file with other places; the rest of it stays as it is, comments included.

    The text is that of a valid world file.
    """
    rows = places.model_dump(mode="json", exclude_defaults=True)
    lines, kept, left_out = text.splitlines(keepends=True), list[str](), list[str]()
    for line in lines:
        header = HEADER.match(line)
        if header is not None:
            kept += _after_last_key(left_out)
            left_out = [line] if header["name"] in PLACE_KEYS else []
        elif left_out:
            left_out.append(line)
        if not left_out:
            kept.append(line)
    kept += _after_last_key(left_out)
    tables = "".join(f"\n[[{key}]]\n{tomli_w.dumps(row)}" for key, listed in rows.items() for row in listed)
    whole = "".join(kept).rstrip() + "\n" + tables
    table = {key: value for key, value in tomllib.loads(text).items() if key not in PLACE_KEYS} | rows
    try:
        is_right = tomllib.loads(whole) == table
    except tomllib.TOMLDecodeError:  # the places stood in another form, as in a list in one line
        is_right = False
    return whole if is_right else tomli_w.dumps(table)


def _after_last_key(lines: Sequence[str]) -> list[str]:
    """Return the empty lines and comments at the end of a table: they belong to what follows."""
    at = next((k for k in range(len(lines), 0, -1) if lines[k - 1].strip()[:1] not in {"", "#"}), 0)
    return list(lines[at:])


def round_names(objects: Sequence[DetectedObject], models: Sequence[ModelConfig]) -> list[str]:
    """Return the models' names of the objects that `world_of` turns into drums, in the same order."""
    is_round = {model.name for model in models if model.arc_radius_m is not None}
    return [seen.model for seen in objects if seen.model in is_round]


def placed_vertices(model: ModelConfig, seen: DetectedObject) -> Floats:
    """Return a model's vertices where it was recognised, shape (n, 2), m."""
    c, s = math.cos(seen.theta), math.sin(seen.theta)
    turned: Floats = np.asarray(model.vertices_m) @ np.array([[c, s], [-s, c]]) + (seen.x, seen.y)
    return turned


def world_text(world: WorldConfig, head: Sequence[str]) -> str:
    """Return a world file as TOML, after the lines of a comment; it has what differs from the defaults."""
    table: dict[str, Any] = world.model_dump(mode="json", exclude_defaults=True)
    comment = "".join(f"# {line}\n" for line in head)
    return f"{comment}\n{tomli_w.dumps(table)}"
