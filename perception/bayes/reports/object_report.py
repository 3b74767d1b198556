"""Conversion of tracks to reported objects: models by name, all others by a descriptive label."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from perception.bayes.memory.elements import round_label
from perception.bayes.memory.parameters import (
    CIRCLE_INFLATION,
    GATE_M,
    PLACED_SIGMA_M,
    ROOM_MARGIN_M,
    UNKNOWN_HITS_MIN,
)
from perception.bayes.memory.polygon_parameters import EDGE_REACH_M, POLYGON_INFLATION, POLYGON_TURN_SIGMA_RAD
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, PLACED, Memory, PolygonTrack
from perception.bayes.reports.claimed_echoes import own_echoes
from perception.bayes.tracks.track_archive import TrackArchive
from perception.bayes.walls.points import SPREAD_MIN_RAD
from perception.bayes.walls.report import has_mirrors, room_report
from perception.detected_object import DetectedObject, wall_between, worst_sigma
from perception.kernel import Floats
from perception.records import Structured

CIRCLE_FIELDS: Final = (
    "x",
    "y",
    "covariance_xx",
    "covariance_xy",
    "covariance_yy",
    "hits",
    "number",
    "marks",
)
READINGS: Final = "readings"
"""Field of an archived circle."""
NO_SURFACES: Final = np.empty((0, 4))
WALL_OFF_M: Final = 0.05
"""A post at the end of a sure wall, within `ROOM_MARGIN_M`, and this near to touching its line is the edge in which
the wall ends: their ranges differ by less than the noise, and every wall ends somewhere."""
Row = tuple[float, ...]


def circle_object(row: Row, label: str, probability: float) -> DetectedObject:
    """Return a circle track as a reported object, which has no heading.

    Parameters
    ----------
    row : record
        The track's values of `CIRCLE_FIELDS`.
    label : str
        The name it is reported by.
    probability : float
        The probability it is reported with.
    """
    x, y, xx, xy, yy, hits, number, marks = row
    xx, xy, yy = CIRCLE_INFLATION * xx, CIRCLE_INFLATION * xy, CIRCLE_INFLATION * yy
    return DetectedObject(
        label,
        x,
        y,
        0.0,
        worst_sigma(xx, xy, yy),
        int(hits),
        probability,
        probability,
        (xx, xy, yy),
        *label_fields(int(number), int(marks)),
    )


def label_fields(number: int, marks: int) -> tuple[int | None, bool, bool]:
    """Return a track's number, whether a user confirmed it, and whether a user placed it."""
    return number or None, bool(marks & CONFIRMED), bool(marks & PLACED)


def polygon_covariance(track: PolygonTrack) -> Floats:
    """Return the reported covariance of a polygon's x, y (m) and heading (rad); shape (3, 3)."""
    held = track.covariance
    covariance = np.zeros((3, 3))
    covariance[np.tril_indices(3)] = POLYGON_INFLATION * np.array(
        [held.xx, held.yx, held.yy, held.hx, held.hy, held.hh]
    )
    covariance[2, 2] += POLYGON_TURN_SIGMA_RAD**2
    return covariance + np.tril(covariance, -1).T


def polygon_object(track: PolygonTrack, p: SettingsRecord, label: str, probability: float) -> DetectedObject:
    """Return a polygon track as a reported object; of its equivalent headings the least one from −π on.

    Parameters
    ----------
    track, p
        The track and the settings.
    label, probability
        The name and probability it is reported with.
    """
    heading = float(track.heading)
    covariance = polygon_covariance(track)
    xx, xy, yy = float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
    period = 2.0 * math.pi / int(p[0].polygons[track.model].symmetry)
    # Else only a user's placement gives its position so far.
    is_located = xx > 0.0 and not int(track.marks) & PLACED
    return DetectedObject(
        label,
        float(track.x),
        float(track.y),
        (heading + 0.5 * period) % period - 0.5 * period,
        worst_sigma(xx, xy, yy) if is_located else PLACED_SIGMA_M,
        int(track.hits),
        probability,
        probability,
        (xx, xy, yy) if is_located else None,
        *label_fields(int(track.number), int(track.marks)),
        sigma_theta=math.sqrt(float(covariance[2, 2])) if is_located else None,
    )


def archived_models(
    archive: TrackArchive, p: SettingsRecord, rounds: Sequence[str], outlines: Sequence[str]
) -> Iterator[DetectedObject]:
    """Yield the archived objects that were reported as models, circles first.

    Parameters
    ----------
    archive, p
        The archive and the settings.
    rounds, outlines : sequence of str
        Names of the round models and of the polygons, in the order of their numbers.
    """
    circles = archive.circles.held()
    circles = circles[(circles["is_reported"] == 1) & (circles["kind"] < len(rounds))]
    columns = (circles[name].tolist() for name in (*CIRCLE_FIELDS, "probability", "kind"))
    for *row, probability, kind in zip(*columns, strict=True):
        yield circle_object(tuple(row), rounds[kind], probability)
    polygons = archive.polygons.held()
    for track in polygons[polygons["is_reported"] == 1]:
        yield polygon_object(track, p, outlines[track.model], float(track.probability))


def wall_object(segment: Row) -> DetectedObject:
    """Return a `WallSegment` as a reported object."""
    x1, y1, x2, y2, variance_across, variance_turn, echoes, log_odds, number = segment
    return wall_between((x1, y1, x2, y2), variance_across, variance_turn, int(echoes), log_odds, int(number) or None)


def corner_object(corner: Row) -> DetectedObject:
    """Return a `CornerPoint` as a reported object, without a heading."""
    x, y, xx, xy, yy, is_edge, echoes, log_odds = corner
    probability = 1.0 / (1.0 + math.exp(-log_odds))
    return DetectedObject(
        "edge" if is_edge == 1 else "inside corner",
        x,
        y,
        0.0,
        worst_sigma(xx, xy, yy),
        int(echoes),
        probability,
        probability,
        (xx, xy, yy),
    )


def wall_edge(surfaces: Floats, x: float, y: float, radius: float) -> tuple[float, float] | None:
    """Return the point of a wall's line beside a thin circle at the wall's end, m; None if no wall ends there.

    Parameters
    ----------
    surfaces : (n, 4) float
        As for `own_echoes`.
    x, y, radius : float
        The circle, m.
    """
    lengths = np.hypot(surfaces[:, 2] - surfaces[:, 0], surfaces[:, 3] - surfaces[:, 1])
    walls, length = surfaces[lengths > 0.0], lengths[lengths > 0.0]
    tx, ty = (walls[:, 2:] - walls[:, :2]).T / length
    dx, dy = x - walls[:, 0], y - walls[:, 1]
    along, across = tx * dx + ty * dy, tx * dy - ty * dx
    beyond = np.abs(np.maximum(-along, along - length))
    beyond[np.abs(across) > radius + WALL_OFF_M] = math.inf
    if not (beyond < ROOM_MARGIN_M).any():
        return None
    k = int(beyond.argmin())
    return x + float(across[k] * ty[k]), y - float(across[k] * tx[k])


def is_corner_of_mirrors(circle: Structured) -> bool:
    """Return whether most echoes of a point are from where, between mirrors, no edge is heard, and from all round.

    From afar the end of a wall is heard as well, but only along the wall's normal.

    Parameters
    ----------
    circle : record of `CircleTrack` or of `archived_tracks.archived_dtype`
        The point.
    """
    if READINGS in (circle.dtype.names or ()):
        x, y, _, ranges = circle[READINGS][: int(circle["kept"])].astype(np.float64).T
    else:
        bins = circle["bins"]
        readings = bins["readings"][np.arange(bins["readings"].shape[1]) < bins["count"][:, None]]
        x, y, ranges = readings["x"] - circle["x"], readings["y"] - circle["y"], readings["range_m"]
    is_echo = np.abs(ranges - np.hypot(x, y)) < GATE_M
    is_far = is_echo & (ranges > EDGE_REACH_M)
    if np.count_nonzero(is_far) <= 0.5 * np.count_nonzero(is_echo):
        return False
    mean = math.atan2(float(y[is_far].sum()), float(x[is_far].sum()))
    turned = np.remainder(np.arctan2(y[is_far], x[is_far]) - mean + math.pi, 2.0 * math.pi)
    return bool(np.ptp(turned) >= SPREAD_MIN_RAD)


def alternative_labels(p: SettingsRecord, rounds: Sequence[str]) -> tuple[str, ...]:
    """Return the labels of a circle's alternatives: the round models, their rivals, a line and a corner."""
    settings = p[0]
    rivals = settings.circles[settings.model_count : settings.circle_count]
    return (*rounds, *(round_label(float(it.radius_m)) for it in rivals), "wall", "corner")


def other_objects(
    memory: Memory, p: SettingsRecord, least: float, named: Sequence[DetectedObject]
) -> list[DetectedObject]:
    """Return the objects without a model's name: walls, corners, edges, posts, barrels, and unknown objects.

    Parameters
    ----------
    memory, p
        Memory and settings.
    least : float
        Least probability at which a rival gets its own label.
    named : sequence of DetectedObject
        The models.
    """
    segments, points = room_report(memory)
    corners = [corner_object(point.item()) for point in points]
    # What stands in a corner of the room is the corner: a thin object there is not another one.
    surfaces = [row[:4] for row in segments.tolist()] + [(*row[:2], *row[:2]) for row in points.tolist()]
    circles = other_circles(memory.circles, memory, p, least, [*named, *corners], np.array(surfaces).reshape(-1, 4))
    return [*(wall_object(segment.item()) for segment in segments), *corners, *circles]


def other_circles(
    circles: Structured,
    memory: Memory,
    p: SettingsRecord,
    least: float,
    named: Sequence[DetectedObject],
    surfaces: Floats = NO_SURFACES,
) -> list[DetectedObject]:
    """Return the circles without a model's name.

    Parameters
    ----------
    circles : (n,) record of `CircleTrack` or of `archived_tracks.archived_dtype`
        The circles.
    memory, p, least, named
        As for `other_objects`.
    surfaces : (n, 4) float, optional
        As for `own_echoes`. Where there are any, only circles with enough echoes of their own are returned, and those
        that a user marked.
    """
    found: list[DetectedObject] = []
    merge_m, models = float(p[0].merge_m), int(p[0].model_count)
    is_shown = (circles["status"] != FREE) & (circles["hits"] >= UNKNOWN_HITS_MIN)
    for o in named:
        is_shown &= np.hypot(circles["x"] - o.x, circles["y"] - o.y) >= merge_m
    shown = np.flatnonzero(is_shown)
    if len(surfaces) > 0 and len(shown) > 0:
        is_own = own_echoes(circles[shown], surfaces, memory, p) >= UNKNOWN_HITS_MIN
        shown = shown[is_own | (circles["marks"][shown] != 0)]
    names = (*CIRCLE_FIELDS, "probability", "status", "kind", "radius")
    columns = (circles[name][shown].tolist() for name in names)  # at once: a value at a time takes five times as long
    are_mirrors = has_mirrors(memory)
    for at, *row, probability, status, kind, radius in zip(shown.tolist(), *columns, strict=True):
        is_rival = status == ESTABLISHED and kind >= models and probability >= least
        label = round_label(radius) if is_rival else "unknown"
        if label == "edge" and are_mirrors and is_corner_of_mirrors(circles[at]):
            label = "inside corner"
        edge = wall_edge(surfaces, row[0], row[1], radius) if label == "post" else None
        if edge is not None:
            label, row[:2] = "edge", edge
        found.append(circle_object(tuple(row), label, probability if is_rival else 1.0 - probability))
    return found
