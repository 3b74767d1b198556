"""Memory of the walls, corners and recent echoes from which the walls of a room are mapped.

A wall is a straight line in a frame of its own. Its readings are summed in bins along it, so that its cost does not
grow with the length of the run, its ends and openings are seen, and it can be fitted again at any time. Lengths are
metres, angles radians.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

from config.robot import SENSORS_MAX
from perception.bayes.memory.elements import Reading
from perception.bounds import FINITE, PLACE, Bound, Count, Finite, Flag, Place, index_of, up_to
from perception.kernel import Floats
from perception.records import Record, Records

MAX_WALLS: Final = 16
"""Tracked walls at a time; where there are too many, a new one replaces a light one."""
CANDIDATE: Final = MAX_WALLS
"""The place behind them, in which a new wall is fitted."""
WALL_BINS: Final = 192
"""Bins along a wall, the origin in the middle: 11.5 m; the frame moves along the wall as it grows."""
WALL_BIN_M: Final = 0.06
"""Width of a bin along a wall."""
SPANS_MAX: Final = 6
"""Spans of one wall, with openings between them."""
JITTERS: Final = 5
"""Jitters of the pose that are compared."""
CORNERS_MAX: Final = 24
"""Corners and, apart from them, edges at a time."""
EDGES_MAX: Final = CORNERS_MAX
RECENT_READINGS_MAX: Final = 768
"""Spaced readings of all sensors that are remembered for new walls."""
REMEMBERED_MAX: Final = 8192
"""Spaced readings of all sensors by which walls are reviewed: those of some 25 m."""
IS_KNOWN, IS_FREE, IS_TAKEN = range(3)
"""Values of `RecentReading.is_free`; the last is that of a candidate's echoes while it is fitted."""
EXTENT: Final = Bound(-0.5 * WALL_BINS * WALL_BIN_M, 0.5 * WALL_BINS * WALL_BIN_M)
"""Of the ends of a wall's spans, which become indices of its bins, m."""
GOLDEN_RATIO: Final = 0.5 * (math.sqrt(5.0) - 1.0)
"""Its multiples modulo 1 are spread evenly; they choose among readings."""


class WallBin(Record):
    """The readings of one place along a wall; a weight of 1 is an echo from the perpendicular's foot."""

    weight: Finite
    precision: Finite
    """Sum of the echoes' weights, each divided by the variance of its range, m⁻²."""
    offset_sum: Finite
    """Sum of the distances from the origin along the frame's normal at which the echoes lie, by precision, m⁻¹."""
    range_sum: Finite
    """Sum of the ranges, by precision, m⁻¹."""
    passes: Finite
    """Ranges that passed through, less with each new echo."""
    number: Count
    """That of the numbered span that held it last, 0 before."""
    is_held: Flag
    """1 where the last review found that the wall covers it by echoes, or one was entered since."""
    is_open: Flag
    """1 where the last review found it open."""
    is_kept: Flag
    """1 where a wall was sure when the robot stopped, until it moves on."""
    newest: Reading


class Span(Record):
    """A part of a wall without openings."""

    low: Annotated[float, EXTENT]
    """Its ends along the frame's tangent, m."""
    high: Annotated[float, EXTENT]
    first_bin: Annotated[int, up_to(WALL_BINS)]
    end_bin: Annotated[int, up_to(WALL_BINS)]
    """Its bins, this one excluded."""
    weight: Finite
    passes: Finite
    """Of the bins."""
    chi2: Finite
    """Evidence that it is straight; see `walls.evidence.flatness`."""
    number: Count
    """The object's number, of the same sequence as those of tracks; 0 of a span too short to be reported."""


class ReviewedLine(Record):
    """A wall's line by the readings that are remembered, in the wall's frame."""

    information: Finite
    """Determinant of the information on offset and slope, m⁻²; 0 before the first review."""
    offset: Finite
    slope: Finite
    variance_offset: Finite
    covariance: Finite
    variance_slope: Finite


class Wall(Record):
    """A wall; the line is `offset` + `slope` · u along its frame's normal, u along the frame's tangent."""

    origin_x: Place
    origin_y: Place
    normal_x: Place
    """The frame's normal, a unit vector away from the sensors."""
    normal_y: Place
    offset: Place
    slope: Place
    weight: Finite
    """Weight of the readings on its spans; 0 where the place is free."""
    variance_offset: Finite
    covariance: Finite
    variance_slope: Finite
    chi2: Finite
    """Evidence of all its spans together that it is straight."""
    misfit: Finite
    """χ² of the line for each degree of freedom."""
    reviewed: ReviewedLine
    is_changed: Flag
    """1 where its bins have changed since it was fitted."""
    span_count: Annotated[int, up_to(SPANS_MAX)]
    spans: Annotated[Records[Span], SPANS_MAX]
    bins: Annotated[Records[WallBin], WALL_BINS]


class PointInformation(Record):
    """What is known of the place of a point: the sum of information (m⁻²), and of information times place (m⁻¹)."""

    xx: Finite
    xy: Finite
    yy: Finite
    x: Finite
    y: Finite


class RoomCorner(Record):
    """A point where two walls meet, or would meet, or where one ends."""

    is_used: Flag
    is_edge: Flag
    """1 where it juts out, as the post of a doorway does; 0 for an inside corner."""
    x: Place
    y: Place
    covariance_xx: Finite
    """m²"""
    covariance_xy: Finite
    covariance_yy: Finite
    heard: PointInformation
    """From its echoes, without its walls."""
    echoes: Finite
    """Echoes from the point itself."""
    passes: Finite
    """Ranges towards it that went on."""
    ended: Finite
    """Ranges towards it that did not go on."""
    far_echoes: Finite
    """The echoes and passes from where an edge between mirrors is not heard."""
    far_passes: Finite
    first: Annotated[int, index_of(MAX_WALLS)]
    """The first wall, or the one that ends alone."""
    second: Annotated[int, index_of(MAX_WALLS)]
    """The second wall; where one ends alone, 1 for its high end and 0 for its low end."""
    is_kept: Flag
    """1 if it was sure when the robot stopped, until it moves on."""


class RecentReading(Record):
    """A reading that may support a new wall."""

    reading: Reading
    is_free: Annotated[int, Bound(IS_KNOWN, IS_TAKEN)]
    """1 for an echo that nothing explains yet, 2 while a new wall is fitted to it."""


class Stop(Record):
    """Where the robot is, and whether it stands there."""

    x: Place
    y: Place
    yaw: Finite
    """Of the ring, rad."""
    is_standing: Flag


class PoseJitter(Record):
    """How far poses jump from one firing to the next; see `walls.pose_jitter`."""

    common_nat: Annotated[Floats, JITTERS, FINITE]
    """Evidence of each jitter over none, where the readings of a firing share it."""
    alone_nat: Annotated[Floats, JITTERS, FINITE]
    """The same where each reading has an error of its own."""
    level: Annotated[int, index_of(JITTERS)]
    """The one that is assumed, 0: none."""
    x: Place
    y: Place
    """Mean shift of the last firings: by it the walls are off where odometry has them, m."""


class WallMap(Record):
    """The walls around the robot, their corners, and the readings from which new walls come."""

    walls: Annotated[Records[Wall], MAX_WALLS + 1]
    corners: Annotated[Records[RoomCorner], CORNERS_MAX]
    edges: Annotated[Records[RoomCorner], EDGES_MAX]
    """Where walls end alone."""
    lines: PointInformation
    """From a corner's walls, while it is located."""
    recent: Annotated[Records[RecentReading], RECENT_READINGS_MAX]
    recent_count: Count
    """Readings ever put there."""
    kept_x: Annotated[Floats, SENSORS_MAX, PLACE]
    """Where each sensor was at its last recent reading, m; meaningless before the first."""
    kept_y: Annotated[Floats, SENSORS_MAX, PLACE]
    kept: Annotated[Floats, SENSORS_MAX, FINITE]
    """1 for each sensor that has a recent reading."""
    remembered: Annotated[Records[Reading], REMEMBERED_MAX]
    """Spaced readings of all sensors by which walls are reviewed, a ring buffer."""
    remembered_count: Count
    """Readings ever put there."""
    remembered_x: Annotated[Floats, SENSORS_MAX, PLACE]
    """Where each sensor was at its last remembered reading, m; meaningless before the first."""
    remembered_y: Annotated[Floats, SENSORS_MAX, PLACE]
    remembered_of: Annotated[Floats, SENSORS_MAX, FINITE]
    """1 for each sensor that has one."""
    firings: Count
    stop: Stop
    jitter: PoseJitter
    edge_echoes: Finite
    """Slanting walls that answered from the beam's edge."""
    edge_silences: Finite
    """Slanting walls that did not."""
    is_loud: Flag
    """1 where so few beams are silent that surfaces must answer at any angle."""
    variance_m2: Finite
    """Variance of a range r, as assumed now: `variance_m2` + `relative_variance` · r²."""
    relative_variance: Finite
    noise_sums: Annotated[Floats, 5, FINITE]
    """Of the errors e of echoes of known walls: sums of w, w · r², w · r⁴, w · e² and w · r² · e²; w (m⁻⁴) is one
    divided by the square of the range's variance."""
