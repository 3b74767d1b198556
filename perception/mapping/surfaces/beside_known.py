"""What the map of surfaces adds to what the method knows: walls beside its own, which are more exact, and polylines.

Whether a straight piece is a wall depends on the place: where the shapes of the method explain what is heard, the
rest is not made of walls; where they explain little, it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.detected_object import DetectedObject, wall_between
from perception.kernel import Floats
from perception.mapping.surfaces.parameters import AGREES_M, KNOWN_NAT, PIECE_MIN_M, UNKNOWN_M
from perception.mapping.surfaces.surface_list import ENDS, find_near, places_on
from perception.polyline import Polyline

PLACES: Final = 16
"""Places along a piece that are compared, those at its ends half a step inside."""
CORNERS: Final = ("inside corner", "edge")
CORNER_REACH_M: Final = 0.25
"""Around a corner its echoes are shared among places that are as far from the robot."""
STRAIGHT_M: Final = 1.0
STRAIGHT_NAT: Final = 15.0
"""Evidence for straight pieces of this length by which walls are expected at all."""
THIN_SHARE: Final = 0.25
"""A piece with less than this share of the usual echoes a metre is none."""
EVIDENCE_MAX: Final = 30.0
"""Greatest log odds that are reported, nat."""
WALL_FIELDS: Final = (*ENDS, "variance_across", "variance_turn", "echoes", "evidence")
Runs = list[tuple[float, float]]
"""Parts of a piece, from 0 to 1."""


def free_of_known(
    rows: NDArray[Any], known: tuple[DetectedObject, ...], reach_m: Mapping[str, float]
) -> NDArray[np.bool_]:  # fmt: skip
    """Return which places along surfaces lie along no known wall and not on an object, shape (n, PLACES).

    Parameters
    ----------
    rows : (n,) record of Surface
        The surfaces.
    known : tuple of DetectedObject
        What the method reports: walls, and objects.
    reach_m : mapping
        Radius within which each model's outline lies, m.
    """
    walls = np.array([one.ends for one in known if one.ends is not None]).reshape(-1, 4)
    reach_m = {**reach_m, **dict.fromkeys(CORNERS, CORNER_REACH_M)}
    bodies = np.array([(one.x, one.y, reach_m[one.model]) for one in known if one.model in reach_m]).reshape(-1, 3)
    return is_free(rows, walls, bodies)


def beside_known(
    rows: NDArray[Any], free: NDArray[np.bool_]
) -> tuple[tuple[DetectedObject, ...], tuple[Polyline, ...]]:  # fmt: skip
    """Return the walls and the polylines in what is free.

    Parameters
    ----------
    rows : (n,) record of Surface
        The surfaces.
    free : (n, PLACES) bool
        Which places along them are free of what the method knows.
    """
    if not len(rows):
        return (), ()
    is_piece = rows["number"] < 0
    length = np.hypot(rows["x2"] - rows["x1"], rows["y2"] - rows["y1"]) * is_piece
    density = rows["echoes"] / np.maximum(length, PIECE_MIN_M)
    is_dense = density > THIN_SHARE * (float(np.median(density[is_piece])) if is_piece.any() else 0.0)
    known_m = float(length @ (1.0 - free.mean(axis=1))) + UNKNOWN_M
    known_share = known_m / (float(length.sum()) + UNKNOWN_M)
    # Where nothing but round bodies stands, each has short straight pieces: long ones show that there are walls.
    is_long = (length >= STRAIGHT_M) & free.all(axis=1) & is_dense
    straight_share = min(float(rows["evidence"][is_long].clip(0.0).sum()) / STRAIGHT_NAT, 1.0)
    prior = KNOWN_NAT * (2.0 * straight_share * (1.0 - known_share) - 1.0)
    is_wall = is_piece & (rows["evidence"] + prior > 0.0) & is_dense
    straight, places = rows[is_wall], free[is_wall]
    numbers = zip(*(straight[name].tolist() for name in WALL_FIELDS), strict=True)
    found = [
        _wall(wall, begin, end, prior)
        for wall, length_m, runs in zip(numbers, length[is_wall].tolist(), map(_runs, places), strict=True)
        for begin, end in runs
        if (end - begin) * length_m >= PIECE_MIN_M
    ]
    rest = ~is_wall & free.any(axis=1)
    return tuple(found), tuple(_polylines(rows[rest]))


def is_free(rows: NDArray[Any], walls: Floats, bodies: Floats) -> NDArray[np.bool_]:
    """Return which places along surfaces lie along no wall and on no body, shape (n, PLACES).

    Parameters
    ----------
    rows : (n,) record of Surface
        The surfaces.
    walls : (k, 4) float
        Ends x, y, x, y of the walls, m.
    bodies : (m, 3) float
        x, y, radius, m.
    """
    places, found = places_on(rows, PLACES), np.zeros(len(rows) * PLACES, np.int64)
    find_near(places, walls, AGREES_M, found)
    for x, y, radius in bodies.tolist():
        find_near(places, np.array([[x, y, x, y]]), radius + AGREES_M, found)
    return np.asarray(found.reshape(-1, PLACES) == 0)


def _runs(free: NDArray[np.bool_]) -> Runs:
    """Return the parts of a piece whose places are free."""
    if free.all():
        return [(0.0, 1.0)]
    borders = np.flatnonzero(np.diff(np.concatenate([[0], free.astype(np.int8), [0]])))
    return [(begin / PLACES, end / PLACES) for begin, end in borders.reshape(-1, 2).tolist()]


def _wall(wall: tuple[float, ...], begin: float, end: float, prior: float) -> DetectedObject:
    """Return a part of a piece, the values of `WALL_FIELDS`, as a wall, as sure as the whole."""
    x, y, x2, y2, variance_across, variance_turn, echoes, evidence = wall
    dx, dy = x2 - x, y2 - y
    return wall_between(
        (x + begin * dx, y + begin * dy, x + end * dx, y + end * dy),
        variance_across, variance_turn, round((end - begin) * echoes), min(evidence + prior, EVIDENCE_MAX),
    )  # fmt: skip


def _polylines(rows: NDArray[Any]) -> Iterator[Polyline]:
    """Yield the polylines of rows, which follow each other in order; a piece that is no wall is one, too."""
    if not len(rows):
        return
    firsts, lasts = (np.column_stack([rows[f"x{end}"], rows[f"y{end}"]]) for end in "12")
    is_next = (np.diff(rows["number"]) == 0) & (lasts[:-1] == firsts[1:]).all(axis=1)
    begins = np.flatnonzero(np.concatenate([[True], ~is_next]))
    ends = np.append(begins[1:], len(rows))
    echoes = np.add.reduceat(rows["echoes"], begins) / (ends - begins)
    numbers = np.abs(rows["number"][begins])
    for begin, end, number, mean in zip(*(a.tolist() for a in (begins, ends, numbers, echoes)), strict=True):
        points = np.concatenate([firsts[begin:end], lasts[end - 1 : end]])
        yield Polyline(number, points, -math.expm1(-max(mean, 0.0)))
