"""Memory of the walls, corners and recent echoes from which the walls of a room are mapped.

A wall is a straight line in a frame of its own. Its readings are summed in bins along it, so that its cost does not
grow with the length of the run, its ends and openings are seen, and it can be fitted again at any time. Lengths are
metres, angles radians.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

from config.robot import SENSORS_MAX
from perception.bayes.elements import Reading
from perception.kernel import Floats
from perception.records import Record, Records

MAX_WALLS: Final = 16
CANDIDATE: Final = MAX_WALLS
"""The place behind them, in which a new wall is fitted."""
WALL_BINS: Final = 192
"""Bins along a wall, the origin in the middle: 11.5 m; the frame moves along the wall as it grows."""
WALL_BIN_M: Final = 0.06
SPANS_MAX: Final = 6
"""Spans of one wall, with openings between them."""
CORNERS_MAX: Final = 24
EDGES_MAX: Final = 24
RECENT_MAX: Final = 768
"""Spaced readings of all sensors that are remembered for new walls."""
REMEMBERED_MAX: Final = 8192
"""Spaced readings of all sensors by which walls are reviewed: those of some 25 m."""
IS_KNOWN: Final = 0
IS_FREE: Final = 1
IS_TAKEN: Final = 2
"""Values of `RecentReading.is_free`; the last is that of a candidate's echoes while it is fitted."""
GOLDEN_RATIO: Final = 0.5 * (math.sqrt(5.0) - 1.0)
"""Its multiples modulo 1 are spread evenly; they choose among readings."""


class WallBin(Record):
    """The readings of one place along a wall; a weight of 1 is an echo from the perpendicular's foot."""

    weight: float
    precision: float
    """Sum of the echoes' weights, each divided by the variance of its range, m⁻²."""
    offset_sum: float
    """Sum of the distances from the origin along the frame's normal at which the echoes lie, by precision, m⁻¹."""
    range_sum: float
    """Sum of the ranges, by precision, m⁻¹."""
    passes: float
    """Ranges that passed through, less with each new echo."""
    number: int
    """That of the numbered span that held it last, 0 before."""
    is_held: int
    """1 where the last review found that the wall covers it by echoes, or one was entered since."""
    is_open: int
    """1 where the last review found it open."""
    newest: Reading


class Span(Record):
    """A part of a wall without openings."""

    low: float
    """Its ends along the frame's tangent, m."""
    high: float
    first_bin: int
    end_bin: int
    """Its bins, this one excluded."""
    weight: float
    passes: float
    """Of the bins."""
    chi2: float
    """Evidence that it is straight; see `wall_evidence.flatness`."""
    number: int
    """The object's number, of the same sequence as those of tracks; 0 of a span too short to be reported."""


class ReviewedLine(Record):
    """A wall's line by the readings that are remembered, in the wall's frame."""

    information: float
    """Determinant of the information on offset and slope, m⁻²; 0 before the first review."""
    offset: float
    slope: float
    variance_offset: float
    covariance: float
    variance_slope: float


class Wall(Record):
    """A wall; the line is `offset` + `slope` · u along its frame's normal, u along the frame's tangent."""

    origin_x: float
    origin_y: float
    normal_x: float
    """The frame's normal, a unit vector away from the sensors."""
    normal_y: float
    offset: float
    slope: float
    weight: float
    """Weight of the readings on its spans; 0 where the place is free."""
    variance_offset: float
    covariance: float
    variance_slope: float
    chi2: float
    """Evidence of all its spans together that it is straight."""
    misfit: float
    """χ² of the line for each degree of freedom."""
    reviewed: ReviewedLine
    is_changed: int
    """1 where its bins have changed since it was fitted."""
    span_count: int
    spans: Annotated[Records[Span], SPANS_MAX]
    bins: Annotated[Records[WallBin], WALL_BINS]


class PointInformation(Record):
    """What is known of the place of a point: the sum of information (m⁻²), and of information times place (m⁻¹)."""

    xx: float
    xy: float
    yy: float
    x: float
    y: float


class RoomCorner(Record):
    """A point where two walls meet, or would meet, or where one ends."""

    is_used: int
    is_edge: int
    """1 where it juts out, as the post of a doorway does; 0 for an inside corner."""
    x: float
    y: float
    covariance_xx: float
    """m²"""
    covariance_xy: float
    covariance_yy: float
    heard: PointInformation
    """From its echoes, without its walls."""
    echoes: float
    """Echoes from the point itself."""
    passes: float
    """Ranges towards it that went on …"""
    ended: float
    """… and those that did not."""
    far_echoes: float
    """The echoes and passes from where an edge between mirrors is not heard."""
    far_passes: float
    first: int
    """The walls; where a wall ends alone, that wall …"""
    second: int
    """… and 1 if it is its high end, 0 for its low end."""


class RecentReading(Record):
    """A reading that may support a new wall."""

    reading: Reading
    is_free: int
    """1 for an echo that nothing explains yet, 2 while a new wall is fitted to it."""


class WallMap(Record):
    """The walls around the robot, their corners, and the readings from which new walls come."""

    walls: Annotated[Records[Wall], MAX_WALLS + 1]
    corners: Annotated[Records[RoomCorner], CORNERS_MAX]
    edges: Annotated[Records[RoomCorner], EDGES_MAX]
    """Where walls end alone."""
    lines: PointInformation
    """From a corner's walls, while it is located."""
    recent: Annotated[Records[RecentReading], RECENT_MAX]
    recent_count: int
    """Readings ever put there."""
    kept_x: Annotated[Floats, SENSORS_MAX]
    """Where each sensor was at its last recent reading, m; meaningless before the first."""
    kept_y: Annotated[Floats, SENSORS_MAX]
    kept: Annotated[Floats, SENSORS_MAX]
    """1 for each sensor that has a recent reading."""
    remembered: Annotated[Records[Reading], REMEMBERED_MAX]
    """Spaced readings of all sensors by which walls are reviewed, a ring buffer."""
    remembered_count: int
    """Readings ever put there."""
    remembered_x: Annotated[Floats, SENSORS_MAX]
    """Where each sensor was at its last remembered reading, m; meaningless before the first."""
    remembered_y: Annotated[Floats, SENSORS_MAX]
    remembered_of: Annotated[Floats, SENSORS_MAX]
    """1 for each sensor that has one."""
    firings: int
    edge_echoes: float
    """Slanting walls that answered from the beam's edge …"""
    edge_silences: float
    """… and those that did not."""
    is_loud: int
    """1 where so few beams are silent that surfaces must answer at any angle."""
    variance_m2: float
    """Variance of a range r, as assumed now: `variance_m2` + `relative_variance` · r²."""
    relative_variance: float
    noise_sums: Annotated[Floats, 5]
    """Of the errors e of echoes of known walls: sums of w, w · r², w · r⁴, w · e² and w · r² · e²; w (m⁻⁴) is one
    divided by the square of the range's variance."""
