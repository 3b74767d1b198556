"""The walls that are sure, with their ends: a segment for each span, as far as the corners in which it ends."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.inference.cross_path import LENGTH_MIN_M
from perception.bayes.memory.state import ESTABLISHED, Memory
from perception.bayes.memory.wall_records import MAX_WALLS
from perception.bayes.walls.contact import EDGES_LEAD, EDGES_SHARE, MIRRORS_SILENCES
from perception.bayes.walls.evidence import SPAN_CHI2_MIN, SURE_SPAN_WEIGHT, WALL_MIN_M, WALL_MISFIT_MAX
from perception.bayes.walls.fit import WALL_WEIGHT_MIN
from perception.bayes.walls.numbers import SPAN_MIN_M
from perception.bayes.walls.reported_points import EVIDENCE_MAX_NAT, end_at_edges, reach_corners
from perception.bayes.walls.straight import Straight, kept_bins, straight, straighten
from perception.records import Record, Structured

WALL_CHI2_MIN: Final = 40.0
"""Least evidence of the best span, or of all together; of the best span of the first wall: where nothing but drums
stands, thousands of their tangents are tried. With 14 for the others, not a metre more was found in 55 rooms, and two
false walls across a real corridor."""
HEAVIEST_SPAN_MIN: Final = 12.0
"""Least weight of the first wall's heaviest span."""
TOGETHER_WEIGHT_MIN: Final = 5.0
"""Weight of two spans, at least, that are evidence together."""
PRIOR_NAT: Final = -2.0
"""Log prior odds of a line that passed the tests, before its evidence."""
PROOF_ECHOES: Final = 5.0
"""Least echoes of a corner that proves its walls."""
PROOF_LEAD: Final = 3.0
"""The echoes of a corner that proves its walls are more than so many times its passes."""
THROUGH: Final = 0.8
"""A wall this near to the middle of a named object, as a share of its radius, would go through it."""
SIDE_M: Final = 0.08
"""A wall no longer than an object is wide, this near to touching it, is the object's side."""


class WallSegment(Record):
    """A reported wall: one span, from end to end."""

    x1: float
    y1: float
    x2: float
    y2: float
    variance_across: float
    """Of its middle, across the wall, m²."""
    variance_turn: float
    """rad²"""
    echoes: float
    log_odds: float
    number: int


class CornerPoint(Record):
    """A reported corner."""

    x: float
    y: float
    covariance_xx: float
    """m²"""
    covariance_xy: float
    covariance_yy: float
    is_edge: int
    """1 where it juts out, 0 for an inside corner."""
    echoes: float
    log_odds: float


def room_report(memory: Memory) -> tuple[Structured, Structured]:
    """Return the walls and the corners that are sure: `WallSegment`, one for each span, and `CornerPoint`."""
    with np.errstate(all="ignore"):  # numbers of a damaged recording
        walls, found = sure_room(memory)
        bodies = memory.circles[(memory.circles["status"] == ESTABLISHED) & (memory.circles["is_named"] == 1)]
        segments = [row for wall in walls.values() for row in _segments(wall) if not is_of_body(row, bodies)]
        return np.array(segments, WallSegment.DTYPE), np.array(found, CornerPoint.DTYPE)


def sure_room(memory: Memory) -> tuple[dict[int, Straight], list[tuple[float, ...]]]:
    """Return the walls that are sure, by their number, with their ends, and the corners, as of `CornerPoint`."""
    with np.errstate(all="ignore"):
        room, are_mirrors, are_rough = memory.state["room"][0], has_mirrors(memory), edges_answer(memory)
        corners, edges = room["corners"].copy(), room["edges"].copy()
        if are_rough:
            # An inside corner is the farthest of its walls from any sensor: what seems to come from it is theirs.
            for points in (corners, edges):
                points["echoes"][points["is_edge"] == 0] = 0.0
        walls = sure_walls(room["walls"][:MAX_WALLS], corners)
        if are_rough:
            for of in walls.values():
                of.hold_to_review()
            walls = {number: of for number, of in walls.items() if len(of.ends)}
        if room["stop"]["is_standing"] == 1:
            for of in walls.values():
                of.hold_to_stop()
        corners, edges = straighten(walls, corners, edges)
        return walls, [*reach_corners(walls, corners, are_mirrors), *end_at_edges(walls, edges, are_mirrors)]


def has_mirrors(memory: Memory) -> bool:
    """Return whether the walls are known to be mirrors, as `contact.are_mirrors` does in compiled code."""
    return float(memory.state["room"]["edge_silences"][0]) >= MIRRORS_SILENCES and not edges_answer(memory)


def edges_answer(memory: Memory) -> bool:
    """Return whether slanting walls answer from the beam's edge, as `contact.edges_answer` does."""
    echoes, silences, is_loud = (
        float(memory.state["room"][name][0]) for name in ("edge_echoes", "edge_silences", "is_loud")
    )
    return echoes > EDGES_SHARE * silences + (-EDGES_LEAD if is_loud == 1.0 else EDGES_LEAD)


def is_of_body(segment: tuple[float, ...], bodies: Structured) -> bool:
    """Return whether a segment goes through a round object or is the side of one.

    Drums in a row have a line along them, and no wall.

    Parameters
    ----------
    segment : tuple of float
        Begins with its ends x, y, x, y, m.
    bodies : (n,) record of `CircleTrack`
        The objects.
    """
    x1, y1, x2, y2 = segment[:4]
    tx, ty = x2 - x1, y2 - y1
    length = max(math.hypot(tx, ty), LENGTH_MIN_M)
    dx, dy, radius = bodies["x"] - x1, bodies["y"] - y1, bodies["radius"]
    share = np.clip((dx * tx + dy * ty) / length**2, 0.0, 1.0)
    away = np.hypot(dx - share * tx, dy - share * ty)
    is_side = (length < 2.0 * radius) & (np.abs(away - radius) < SIDE_M)
    return bool(((away < THROUGH * radius) | is_side).any())


def _segments(of: Straight) -> Iterator[tuple[float, ...]]:
    variance, covariance, variance_turn = of.variances
    columns = (of.ends.tolist(), *(of.spans[name] for name in ("weight", "chi2", "number")))
    for (low, high), weight, chi2, number in zip(*columns, strict=True):
        middle = 0.5 * (low + high)
        across = variance + 2.0 * middle * covariance + middle * middle * variance_turn
        evidence = min(EVIDENCE_MAX_NAT, 0.5 * max(of.wall["chi2"], chi2) / max(1.0, of.wall["misfit"]))
        yield (*of.point(low), *of.point(high), across, variance_turn, weight, PRIOR_NAT + evidence, number)


def sure_walls(walls: Structured, corners: Structured) -> dict[int, Straight]:
    """Return the walls that are sure, by their number: alone, or as a sure wall's neighbour at a corner.

    Parameters
    ----------
    walls : (n,) record of `Wall`
        All walls.
    corners : (n,) record of `RoomCorner`
        All corners.
    """
    found: dict[int, Straight] = {}
    fitting = np.flatnonzero((walls["weight"] > 0.0) & (walls["misfit"] < WALL_MISFIT_MAX)).tolist()
    misfits = np.maximum(1.0, walls["misfit"])
    heard = corners[(corners["is_used"] == 1) & (corners["echoes"] >= PROOF_ECHOES) & (corners["is_edge"] == 0)]
    heard = heard[heard["echoes"] > PROOF_LEAD * heard["passes"]]
    pairs = np.column_stack([heard["first"], heard["second"]])
    spans = walls["spans"][fitting]
    is_span = np.arange(spans.shape[1]) < walls["span_count"][fitting, None]
    is_long = is_span & (spans["high"] - spans["low"] >= WALL_MIN_M) & (spans["weight"] >= HEAVIEST_SPAN_MIN)
    kept = kept_bins(walls["bins"])
    evidence = spans["chi2"] / misfits[fitting, None]
    if not ((evidence[is_long] >= WALL_CHI2_MIN).any() or kept.any()):
        return found
    for is_neighbour in (False, True):
        proven = {int(b if a in found else a) for a, b in pairs if (a in found) != (b in found)}
        for number in fitting if not is_neighbour else sorted(proven.intersection(fitting)):
            wall = walls[number]
            spans = wall["spans"][: wall["span_count"]].copy()
            is_sure = sure_spans(spans, wall["chi2"], misfits[number], is_neighbour)
            if kept[number].any():
                is_sure |= kept_spans(spans, kept[number], wall["bins"]["number"])
            spans = spans[is_sure]
            if len(spans):
                found[number] = straight(wall, spans)
    return found


def sure_spans(spans: Structured, chi2: float, misfit: float, is_proven: bool) -> NDArray[np.bool_]:
    """Return which spans of a wall can be reported: none unless it is a wall, by its best span or by all together.

    Parameters
    ----------
    spans : (n,) record of `Span`
        All spans of the wall.
    chi2 : float
        Evidence of all together.
    misfit : float
        χ² of the wall's line for each degree of freedom, at least 1: the evidence is divided by it, as echoes that
        scatter more than the noise say less.
    is_proven : bool
        Whether a corner proves that it is a wall.
    """
    length, weight, straight = spans["high"] - spans["low"], spans["weight"], spans["chi2"] / misfit
    least = SURE_SPAN_WEIGHT if is_proven else WALL_WEIGHT_MIN
    heavy = (weight >= least) & (spans["chi2"] > SPAN_CHI2_MIN)
    sure = heavy & (length >= SPAN_MIN_M)
    if sure.any() and not is_proven:
        together = chi2 / misfit if np.count_nonzero(heavy & (weight >= TOGETHER_WEIGHT_MIN)) > 1 else -np.inf
        sure &= bool(max(straight[sure].max(), together) >= WALL_CHI2_MIN and length[sure].max() >= WALL_MIN_M)
    return np.asarray(sure)


def kept_spans(spans: Structured, kept: NDArray[np.bool_], numbers: Structured) -> NDArray[np.bool_]:
    """Return which spans of a wall were sure when the robot stopped.

    Parameters
    ----------
    spans : (n,) record of `Span`
        All spans of the wall. One that has become too short for a number gets back that of its bins.
    kept : (WALL_BINS,) bool
        Of the wall, as of `kept_bins`.
    numbers : (WALL_BINS,) int
        Of the spans that held the bins last.
    """
    are_kept = np.zeros(len(spans), np.bool_)
    for k, (first, end) in enumerate(spans[["first_bin", "end_bin"]].tolist()):
        if kept[first:end].any() and spans["number"][k] == 0:
            spans["number"][k] = np.setdiff1d(numbers[first:end], spans["number"]).max(initial=0)
        are_kept[k] = kept[first:end].any() and spans["number"][k] > 0
    return are_kept
