"""What is reported of the map of surfaces: walls beside the method's own or in their place, and polylines.

Whether a straight piece is a wall depends on the place: where the shapes of the method explain what is heard, the
rest is not made of walls; where they explain little, the pieces are the walls, and the method's own are shown where
pieces lie along less than half of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.memory.elements import round_label
from perception.bayes.memory.parameters import RIVAL_RADII_M
from perception.detected_object import DetectedObject, wall_between
from perception.kernel import Floats
from perception.mapping.no_surfaces import SurfaceReport
from perception.mapping.surfaces.parameters import (
    AGREES_M,
    KNOWN_NAT,
    KNOWN_SHARE,
    PIECE_KEPT_M,
    PIECE_MIN_M,
    UNKNOWN_M,
)
from perception.mapping.surfaces.surface_list import ENDS, find_near, places_on
from perception.polyline import Polyline
from perception.records import Structured

PLACES: Final = 16
"""Places along a piece that are compared, those at its ends half a step inside."""
CORNERS: Final = ("inside corner", "edge")
UNKNOWN: Final = "unknown"
CORNER_REACH_M: Final = 0.25
"""Around a corner its echoes are shared among places that are as far from the robot."""
LEFTOVER_M: Final = 0.2
"""So near what is known a piece may be what is left of its echoes. Share of pieces so near: 0.91 and more in
generated rooms, 0.51 and less on drives; within 0.1 m it is 0.66 and 0.39."""
UNSURE, AWAY, NEAR, ALONG, ON_BODY, ON_MODEL = range(-1, 5)
"""How near a place is to what is known: perhaps on an unknown object, which may be as large as the largest body and
is not known; within `LEFTOVER_M` of what is; along a wall or around a corner; on a post or barrel; on a model."""
RIVALS_M: Final = MappingProxyType({round_label(radius): radius for radius in RIVAL_RADII_M if radius > 0.0})
"""Radii of the round bodies that are no models, by their labels, m."""
STRAIGHT_M: Final = 1.0
"""Length of the straight pieces for whose evidence walls are expected at all."""
STRAIGHT_NAT: Final = 15.0
"""The most that one straight piece says for itself: its echoes repeat one another."""
WALLED_PLACE_NAT: Final = 2.0 * STRAIGHT_NAT
"""Evidence of straight pieces that shows a place of walls: an edge's echoes across a real corridor had 14 nat."""
EVIDENCE_MAX: Final = 30.0
"""Greatest log odds that are reported, nat."""
PROBABILITY_MIN: Final = 1e-300
"""Least probability and odds of which a logarithm is taken."""
SIZES: Final = ("variance_across", "variance_turn", "echoes")
Runs = list[tuple[float, float]]
"""Parts of a piece, from 0 to 1."""


def nearness(
    rows: Structured, known: tuple[DetectedObject, ...], reach_m: Mapping[str, float]
) -> NDArray[np.int64]:  # fmt: skip
    """Return how near places along surfaces are to what is known, from `UNSURE` to `ON_MODEL`, shape (n, PLACES).

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
    bodies, body_reaches = _bodies(known, reach_m)
    models, model_reaches = _bodies(known, {name: reach for name, reach in reach_m.items() if name not in RIVALS_M})
    unknown, unknown_reaches = _bodies(known, {UNKNOWN: max(reach_m.values(), default=0.0)})
    corners, corner_reaches = _bodies(known, dict.fromkeys(CORNERS, CORNER_REACH_M))
    every = np.concatenate([walls, bodies, corners])
    reaches = np.concatenate([np.zeros(len(walls)), body_reaches, corner_reaches])
    places = places_on(rows, PLACES)
    found = np.zeros(len(places), np.int64)
    for how_near, ends, within in (
        (UNSURE, unknown, unknown_reaches + AGREES_M), (NEAR, every, reaches + LEFTOVER_M),
        (ALONG, every, reaches + AGREES_M), (ON_BODY, bodies, body_reaches + AGREES_M),
        (ON_MODEL, models, model_reaches + AGREES_M),
    ):  # fmt: skip
        marks = np.zeros(len(places), np.int64)
        find_near(places, ends, within, marks)
        found[marks == 1] = how_near
    return found.reshape(-1, PLACES)


def _bodies(known: tuple[DetectedObject, ...], reach_m: Mapping[str, float]) -> tuple[Floats, Floats]:
    """Return what is known of some kinds as segments without length, shape (k, 4), and their reaches, (k,), m."""
    found = np.array([(one.x, one.y, reach_m[one.model]) for one in known if one.model in reach_m]).reshape(-1, 3)
    return found[:, [0, 1, 0, 1]], found[:, 2]


def beside_known(rows: Structured, near: NDArray[np.int64], prior: float) -> SurfaceReport:
    """Return the walls and the polylines that are reported beside what is known, or in place of its walls.

    Parameters
    ----------
    rows : (n,) record of Surface
        The surfaces.
    near : (n, PLACES) int
        How near places along them are to what is known.
    prior : float
        From `wall_prior`, nat.
    """
    if not len(rows):
        return SurfaceReport()
    is_piece = rows["number"] < 0
    length = lengths(rows)
    evidence = rows["evidence"].clip(None, STRAIGHT_NAT) + prior
    free = near < ON_BODY if prior > 0.0 else (near >= AWAY) & (near < ALONG)
    is_wall = is_piece & (evidence > 0.0)
    straight = rows[is_wall]
    numbers = zip(*(straight[name].tolist() for name in ENDS + SIZES), evidence[is_wall].tolist(), strict=True)
    found = [
        _wall(wall, begin, end)
        for wall, length_m, runs in zip(numbers, length[is_wall].tolist(), map(_runs, free[is_wall]), strict=True)
        for begin, end in runs
        if (end - begin) * length_m >= PIECE_KEPT_M
    ]
    if prior > 0.0:
        # Where shapes explain little, what is on a post or barrel is no wall, but an outline: no result has the body.
        on_body = near == ON_BODY
        rest = np.concatenate([rows[~is_wall & (free | on_body).any(axis=1)], _cut(straight, on_body[is_wall])])
    else:
        rest = rows[~is_wall & (near < ALONG).any(axis=1)]  # an unknown object hides no outline
    return SurfaceReport(tuple(found), tuple(_polylines(rest)))


def lengths(rows: Structured) -> Floats:
    """Return the lengths of pieces, 0 of parts of polylines, shape (n,), m."""
    return np.asarray(np.hypot(rows["x2"] - rows["x1"], rows["y2"] - rows["y1"]) * (rows["number"] < 0))


def wall_prior(rows: Structured, near: NDArray[np.int64]) -> float:
    """Return the log odds that a piece of this place is a wall, before its own evidence, nat.

    Parameters
    ----------
    rows : (n,) record of Surface
        The surfaces.
    near : (n, PLACES) int
        As for `beside_known`.
    """
    length = lengths(rows)
    length[length < PIECE_MIN_M] = 0.0  # shorter ones are left of the ends of others
    known_m = float(length @ (near > AWAY).mean(axis=1)) + UNKNOWN_M
    known_share = known_m / (float(length.sum()) + UNKNOWN_M)
    # Where nothing but round bodies stands, each has short straight pieces: long ones show that there are walls,
    # those that the method knows as walls, too.
    is_long = (length >= STRAIGHT_M) & ((near >= AWAY) & (near < ON_BODY)).all(axis=1)
    straight_share = min(float(rows["evidence"][is_long].clip(0.0).sum()) / WALLED_PLACE_NAT, 1.0)
    return KNOWN_NAT * (straight_share * (1.0 - known_share) / (1.0 - KNOWN_SHARE) - 1.0)


def refuted(
    rows: Structured, known: tuple[DetectedObject, ...], radius_m: Mapping[str, float]
) -> frozenset[int]:  # fmt: skip
    """Return the numbers of round objects that are none, where pieces stand for the walls.

    In such a place most of what seems round is not: so much has to speak for it as for a place of walls, the evidence
    of the pieces at its outline, circle against line, included. Drives: 4 to 12 nat of seven false ones; generated
    rooms: 15 and more of the true ones.

    Parameters
    ----------
    rows, known
        As for `nearness`.
    radius_m : mapping
        Radii of the round models, m.
    """
    pieces = rows[lengths(rows) >= PIECE_MIN_M]  # a shorter one lies at a round outline as well
    places = places_on(pieces, PLACES).reshape(-1, PLACES, 2)
    gone = set()
    for one in known:
        if one.model not in radius_m or one.number is None or one.probability is None:
            continue
        away = np.hypot(places[..., 0] - one.x, places[..., 1] - one.y).min(axis=1, initial=math.inf)
        straight = float(pieces["evidence"][away < radius_m[one.model] + AGREES_M].sum())
        odds = one.probability / max(1.0 - one.probability, PROBABILITY_MIN)
        if math.log(max(odds, PROBABILITY_MIN)) - straight < STRAIGHT_NAT:
            gone.add(one.number)
    return frozenset(gone)


def replaced(walls: tuple[DetectedObject, ...], known: tuple[DetectedObject, ...]) -> frozenset[int]:
    """Return the numbers of the method's walls along half of which, at least, pieces stand as walls.

    Parameters
    ----------
    walls : tuple of DetectedObject
        The pieces that are reported as walls, where they stand for the method's.
    known
        As for `nearness`.
    """
    own = [(one.number, one.ends) for one in known if one.ends is not None and one.number is not None]
    if not walls or not own:
        return frozenset()
    lines = np.array([ends for _, ends in own])
    shares = ((np.arange(PLACES) + 0.5) / PLACES)[:, None]
    places = (lines[:, None, :2] + shares * (lines[:, None, 2:] - lines[:, None, :2])).reshape(-1, 2)
    marks = np.zeros(len(places), np.int64)
    ends = np.array([one.ends for one in walls])
    find_near(places, ends, np.full(len(ends), AGREES_M), marks)
    is_along = marks.reshape(-1, PLACES).mean(axis=1) >= 0.5
    return frozenset(number for (number, _), is_gone in zip(own, is_along.tolist(), strict=True) if is_gone)


def _cut(rows: Structured, of: NDArray[np.bool_]) -> Structured:
    """Return the parts of pieces from the first to the last of some of their places, shape (n, PLACES)."""
    is_some = of.any(axis=1)
    cut, of = rows[is_some].copy(), of[is_some]
    begin, end = of.argmax(axis=1) / PLACES, 1.0 - of[:, ::-1].argmax(axis=1) / PLACES
    for name in "xy":
        first, way = cut[f"{name}1"].copy(), cut[f"{name}2"] - cut[f"{name}1"]
        cut[f"{name}1"], cut[f"{name}2"] = first + begin * way, first + end * way
    return cut


def _runs(free: NDArray[np.bool_]) -> Runs:
    """Return the parts of a piece whose places are free."""
    if free.all():
        return [(0.0, 1.0)]
    borders = np.flatnonzero(np.diff(np.concatenate([[0], free.astype(np.int8), [0]])))
    return [(begin / PLACES, end / PLACES) for begin, end in borders.reshape(-1, 2).tolist()]


def _wall(wall: tuple[float, ...], begin: float, end: float) -> DetectedObject:
    """Return a part of a piece as a wall, as sure as the whole: its ends, `SIZES` and log odds."""
    x, y, x2, y2, variance_across, variance_turn, echoes, evidence = wall
    dx, dy = x2 - x, y2 - y
    return wall_between(
        (x + begin * dx, y + begin * dy, x + end * dx, y + end * dy),
        variance_across, variance_turn, round((end - begin) * echoes), min(evidence, EVIDENCE_MAX),
    )  # fmt: skip


def _polylines(rows: Structured) -> Iterator[Polyline]:
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
