"""What a run found changed in the map in which it was driven, and the map corrected by that.

A reading looks at the point of a surface that is nearest to the sensor, where sound is reflected back to it. If that
point lies in the beam, a range that ends there is a hit. One that ends clearly beyond it, or an echo that does not
come, passes where the surface should be.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.world import DrumConfig, PolygonConfig, WallConfig, WorldConfig
from drivers.messages import Floats
from perception.polyline import Polyline
from runtime.analysis.export.world_file import polyline_walls
from runtime.analysis.timeline import Echoes

NEAR_M: Final = 0.3
"""Objects and walls nearer than this to one of the map are that one."""
MOVED_MAX_M: Final = 2.0
"""Farthest that an object may have been moved to be called the same."""
AGREE_M: Final = 0.15
"""Ranges this much shorter or longer than expected still end at the surface."""
LOOK_MAX_M: Final = 4.0
"""Farthest surface that counts as looked at."""
BEAM_SHARE: Final = 0.7
"""Share of the beam, from its axis, in which sound is surely reflected back."""
LOOKS_MIN: Final = 8
"""Fewest looks at an object, or at an opening, that show it."""
PIECE_LOOKS_MIN: Final = 2
"""Fewest looks at each piece of an opening that show it."""
HIT_SHARE_MAX: Final = 0.15
"""Largest share of hits among the looks at what is gone: false echoes."""
CELL_M: Final = 0.25
"""Length of the pieces of a wall."""
OPENING_MIN_M: Final = 0.5
"""Shortest opening, and shortest new wall."""


class Looks(NamedTuple):
    """How often ranges ended at a surface and how often they passed it, for each of its pieces."""

    hits: NDArray[np.int64]
    passes: NDArray[np.int64]

    def runs(self) -> list[tuple[int, int]]:
        """Return the first piece of each run of pieces that are not there, and the piece after its last one."""
        looks = self.hits + self.passes
        missing = (looks >= PIECE_LOOKS_MIN) & (self.hits <= HIT_SHARE_MAX * looks)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(np.int8)))
        return [(a, b) for a, b in edges.reshape(-1, 2).tolist() if looks[a:b].sum() >= LOOKS_MIN]


@dataclass(frozen=True, slots=True)
class MapChange:
    """One difference between the map and what the run perceived, in the map frame, m."""

    kind: Literal["new", "gone", "moved", "opened"]
    what: str
    """`drum`, `wall`, `outline` (a polyline) or a model's name."""
    place: tuple[float, float]
    """Its middle."""
    extent_m: float = 0.0
    """How far it was moved, or how long the wall, the outline or the opening is."""

    def __str__(self) -> str:
        """Return the change in a line."""
        x, y = self.place
        at = f"{self.kind}: {self.what} at ({x:.2f}, {y:.2f}) m"
        return (
            f"{at}, by {self.extent_m:.2f} m"
            if self.kind == "moved"
            else (f"{at}, {self.extent_m:.2f} m long" if self.extent_m else at)
        )


def looks_at_circle(echoes: Echoes, circle: tuple[float, float, float], half_angle_rad: float) -> Looks:
    """Return how often readings hit and passed a round object.

    The circle is centre x, y and radius, m, in the frame of the echoes.
    """
    x, y, radius = circle
    dx, dy = x - echoes["x"], y - echoes["y"]
    expected = np.hypot(dx, dy) - radius
    return _looks(echoes, np.arctan2(dy, dx), expected, np.zeros(len(echoes), np.int64), 1, half_angle_rad)


def looks_at_wall(echoes: Echoes, ends: Sequence[float], half_angle_rad: float) -> Looks:
    """Return how often readings hit and passed each piece of a wall, pieces of about `CELL_M` from its first end.

    Ends are x1, y1, x2, y2 (m) in the frame of the echoes.
    """
    x1, y1, x2, y2 = ends
    length = math.hypot(x2 - x1, y2 - y1)
    if length == 0.0:  # as between the first corner of a polygon and the same one, given again at its end
        return Looks(np.zeros(1, np.int64), np.zeros(1, np.int64))
    count = max(1, round(length / CELL_M))
    tx, ty = (x2 - x1) / length, (y2 - y1) / length
    along = (echoes["x"] - x1) * tx + (echoes["y"] - y1) * ty
    dx, dy = x1 + along * tx - echoes["x"], y1 + along * ty - echoes["y"]
    piece = np.floor(along / length * count).astype(np.int64)
    return _looks(echoes, np.arctan2(dy, dx), np.hypot(dx, dy), piece, count, half_angle_rad)


def _looks(
    echoes: Echoes, bearing: Floats, expected: Floats, piece: NDArray[np.int64], count: int, half_angle_rad: float
) -> Looks:
    """Return how often readings hit and passed each of `count` pieces.

    A reading has one piece that it may look at, `expected` m away at `bearing`, rad; it counts if that is from 0 to
    `count` − 1, inside the beam, and neither too near nor too far.
    """
    off = np.abs(np.angle(np.exp(1j * (bearing - echoes["bearing"]))))
    sees = (off < BEAM_SHARE * half_angle_rad) & (expected > AGREE_M) & (expected < LOOK_MAX_M)
    sees &= (piece >= 0) & (piece < count)
    beyond = echoes["range_m"] - expected
    hits = np.bincount(piece[sees & (np.abs(beyond) <= AGREE_M)], minlength=count)
    return Looks(hits, np.bincount(piece[sees & (beyond > AGREE_M)], minlength=count))


def compare_with_map(
    known: WorldConfig,
    found: WorldConfig,
    names: Sequence[str],
    echoes: Echoes,
    half_angle_rad: float,
    polylines: Sequence[Polyline] = (),
) -> tuple[list[MapChange], WorldConfig]:
    """Return what changed, and the corrected map.

    Parameters
    ----------
    known : WorldConfig
        The map in which the run was driven.
    found : WorldConfig
        What the run recognised, in the map frame.
    names : sequence of str
        Names of the found drums.
    echoes : (n,) ECHO
        All readings, in the map frame.
    half_angle_rad : float
        Half the beam's opening.
    polylines : sequence of Polyline
        Those that the run found, in the map frame. A new one enters the map as a wall for each of its pieces.
    """
    changes = list[MapChange]()
    drums = _compare_drums(known, found, names, echoes, half_angle_rad, changes)
    walls, outlines = list[WallConfig](), list[PolygonConfig]()
    for wall in known.wall:
        if wall.bend_m != 0.0:  # no piece of it is as long as an opening
            walls.append(wall)
        else:
            walls += _without_openings(wall, looks_at_wall(echoes, _ends(wall), half_angle_rad), changes)
    boxes = []
    for box in known.box:
        if not _is_outline_gone(box.corners_m(), echoes, half_angle_rad):
            boxes.append(box)
        else:
            changes.append(MapChange("gone", "box", (box.x_m, box.y_m)))
    for polygon in known.polygon:
        if not _is_outline_gone(polygon.vertices_m, echoes, half_angle_rad):
            outlines.append(polygon)
        else:
            changes.append(MapChange("gone", "polygon", _middle(polygon.vertices_m)))
    sides = np.array(known.sides_m()).reshape(-1, 4)
    for polygon in found.polygon:
        if not _is_near(np.array(polygon.vertices_m), sides, known.drum):
            outlines.append(polygon)
            changes.append(MapChange("new", "polygon", _middle(polygon.vertices_m)))
    for wall in found.wall:
        x1, y1, x2, y2 = _ends(wall)
        length = math.hypot(x2 - x1, y2 - y1)
        places = np.linspace((x1, y1), (x2, y2), max(2, round(length / CELL_M)))
        if length >= OPENING_MIN_M and not _is_near(places, sides, known.drum):
            walls.append(wall)
            changes.append(MapChange("new", "wall", (0.5 * (x1 + x2), 0.5 * (y1 + y2)), length))
    for polyline in polylines:
        length = polyline.length_m
        places = np.concatenate(
            [
                np.linspace(a, b, max(2, round(math.dist(a, b) / CELL_M)))
                for a, b in itertools.pairwise(polyline.points)
            ]
        )
        if length >= OPENING_MIN_M and not _is_near(places, sides, known.drum):
            walls += polyline_walls(polyline)
            changes.append(MapChange("new", "outline", _middle(polyline.points.tolist()), length))
    corrected = {"drum": tuple(drums), "wall": tuple(walls), "box": tuple(boxes), "polygon": tuple(outlines)}
    return changes, known.model_copy(update=corrected)


def _compare_drums(
    known: WorldConfig,
    found: WorldConfig,
    names: Sequence[str],
    echoes: Echoes,
    half_angle_rad: float,
    changes: list[MapChange],
) -> list[DrumConfig]:
    """Append what changed among the drums, and return those of the corrected map."""
    kept, missing = list[DrumConfig](), list[DrumConfig]()
    for drum in known.drum:
        is_found = any(_distance(drum, other) < NEAR_M for other in found.drum)
        circle = (drum.x_m, drum.y_m, drum.radius_m)
        gone = not is_found and bool(looks_at_circle(echoes, circle, half_angle_rad).runs())
        (missing if gone else kept).append(drum)
    new = [
        (drum, name)
        for drum, name in zip(found.drum, names, strict=True)
        if all(_distance(drum, other) >= NEAR_M for other in known.drum)
    ]
    for drum, name in new:
        same = [other for other in missing if abs(other.radius_m - drum.radius_m) < AGREE_M]
        before = min(same, key=lambda other: _distance(drum, other), default=None)
        if before is not None and _distance(drum, before) < MOVED_MAX_M:
            missing.remove(before)
            changes.append(MapChange("moved", name, (drum.x_m, drum.y_m), _distance(drum, before)))
        else:
            changes.append(MapChange("new", name, (drum.x_m, drum.y_m)))
    changes += [MapChange("gone", "drum", (drum.x_m, drum.y_m)) for drum in missing]
    return kept + [drum for drum, _ in new]


def _without_openings(wall: WallConfig, looks: Looks, changes: list[MapChange]) -> list[WallConfig]:
    """Append the openings of a wall to the changes, and return what is left of it."""
    x1, y1, x2, y2 = _ends(wall)
    length, count = math.hypot(x2 - x1, y2 - y1), len(looks.hits)
    openings = [(low / count, high / count) for low, high in looks.runs()]
    openings = [(low, high) for low, high in openings if (high - low) * length >= OPENING_MIN_M]
    for low, high in openings:
        middle = 0.5 * (low + high)
        place = (x1 + middle * (x2 - x1), y1 + middle * (y2 - y1))
        is_whole = high - low == 1.0
        changes.append(MapChange("gone" if is_whole else "opened", "wall", place, (high - low) * length))
    bounds = [0.0, *(edge for opening in openings for edge in opening), 1.0]
    rest = [(low, high) for low, high in zip(bounds[::2], bounds[1::2], strict=True) if high > low]
    if rest == [(0.0, 1.0)]:
        return [wall]
    return [
        WallConfig(x1_m=x1 + a * (x2 - x1), y1_m=y1 + a * (y2 - y1), x2_m=x1 + b * (x2 - x1), y2_m=y1 + b * (y2 - y1))
        for a, b in rest
    ]


def _is_outline_gone(corners: Sequence[tuple[float, float]], echoes: Echoes, half_angle_rad: float) -> bool:
    """Return whether a box or polygon is gone: pieces of at least half a metre are, and none is there."""
    gone_m, is_hit = 0.0, False
    for (x1, y1), (x2, y2) in zip(corners, [*corners[1:], corners[0]], strict=True):
        looks = looks_at_wall(echoes, (x1, y1, x2, y2), half_angle_rad)
        missing = sum(high - low for low, high in looks.runs()) / len(looks.hits)
        gone_m += missing * math.hypot(x2 - x1, y2 - y1)
        is_hit = is_hit or bool((looks.hits > HIT_SHARE_MAX * (looks.hits + looks.passes)).any())
    return gone_m >= OPENING_MIN_M and not is_hit


def _is_near(places: Floats, sides: Floats, drums: Sequence[DrumConfig]) -> bool:
    """Return whether half of some places (n, 2) lie near the map's walls or drums."""
    near = np.zeros(len(places), bool)
    for x1, y1, x2, y2 in sides.tolist():
        d = np.array([x2 - x1, y2 - y1])
        share = np.clip((places - (x1, y1)) @ d / max(1e-12, float(d @ d)), 0.0, 1.0)
        near |= np.hypot(*(places - (x1, y1) - share[:, np.newaxis] * d).T) < NEAR_M
    for drum in drums:
        near |= np.abs(np.hypot(*(places - (drum.x_m, drum.y_m)).T) - drum.radius_m) < NEAR_M
    return bool(near.mean() >= 0.5)


def _ends(wall: WallConfig) -> tuple[float, float, float, float]:
    return wall.x1_m, wall.y1_m, wall.x2_m, wall.y2_m


def _middle(corners: Sequence[tuple[float, float]]) -> tuple[float, float]:
    x, y = np.mean(corners, axis=0).tolist()
    return x, y


def _distance(a: DrumConfig, b: DrumConfig) -> float:
    return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m)
