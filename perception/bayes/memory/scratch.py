"""Records that kernels overwrite before each use: segments, scores and fits of one firing or one object."""

from __future__ import annotations

from typing import Annotated, Final

from config.robot import SENSORS_MAX
from config.settings import TRACKS_MAX
from perception.bayes.memory.elements import (
    ATTRACTING_MAX,
    BEARING_BINS,
    BIN_CAPACITY,
    COMPARED_MAX,
    CROSS_HISTORY,
    GRID_CELLS,
    PAIRS_PER_SENSOR,
    MappedSegment,
    Pose,
    Reading,
)
from perception.bayes.memory.wall_records import RECENT_READINGS_MAX, WALL_BINS
from perception.kernel import Floats, Ints
from perception.records import Record, Records

UNEXPLAINED: Final = -1
"""Value of `Scratch.explained_by` of a reading that nothing explains; circle tracks have their own numbers."""
PROPOSED: Final = UNEXPLAINED - 1
"""A hypothesis was tried on it."""
POLYGON: Final = TRACKS_MAX
"""This plus k: polygon k explains it."""
TAKES_NOTHING, TAKES_BETTER, TAKES_ALL = range(3)
"""Values of `OtherCircle.takes`: none, as a part of the same body; the readings that it explains better; all that it
explains, as it has a name and that circle has none."""


class PairSegment(Record):
    """An outline segment from a pair of readings."""

    x: float
    """Its middle point, m."""
    y: float
    normal_x: float
    normal_y: float
    length: float
    sigma_direction: float
    """Standard deviation of the direction, rad."""
    reading: int
    """Index of the fired reading it came from."""


class LinearReading(Record):
    """A reading's error near a circle, and its slope along the axes of the posterior's frame."""

    error: float
    """m"""
    slope_a: float
    """Fall of the error per unit of the first axis, m."""
    slope_b: float
    bins_per_m: float
    level: int
    """Row of `Settings.table`."""


class Predictions(Record):
    """What a circle predicts of each reading, field by field, so that the processor computes several at a time."""

    rays: int
    """By how many rays the circle is heard, 0 by its nearest point. Given, not computed."""
    half_angle: float
    """Half the beam's opening, rad; given where there are rays."""
    error: Annotated[Floats, COMPARED_MAX]
    """Range, or half a cross path, less the predicted one, m."""
    slope_x: Annotated[Floats, COMPARED_MAX]
    """Derivatives of the predicted range by the circle's centre."""
    slope_y: Annotated[Floats, COMPARED_MAX]
    distance: Annotated[Floats, COMPARED_MAX]
    """Of the centre from the sensor that fired, m."""
    ahead: Annotated[Floats, COMPARED_MAX]
    """The same along the sensor's axis, m."""


class NearReadings(Record):
    """The recent readings that may bear on a new wall, field by field, and what each says of a line."""

    x: Annotated[Floats, RECENT_READINGS_MAX]
    """As in `Reading`."""
    y: Annotated[Floats, RECENT_READINGS_MAX]
    axis_x: Annotated[Floats, RECENT_READINGS_MAX]
    axis_y: Annotated[Floats, RECENT_READINGS_MAX]
    range_m: Annotated[Floats, RECENT_READINGS_MAX]
    is_free: Annotated[Floats, RECENT_READINGS_MAX]
    """1 for an echo that nothing explains, 0 for others."""
    weight: Annotated[Floats, RECENT_READINGS_MAX]
    """For a line, or against it."""


class OtherCircle(Record):
    """An established circle other than the one whose readings are asked for."""

    x: float
    y: float
    radius: float
    root_xx: float
    """As in `CircleTrack`, m."""
    rays: int
    """As in `Predictions`."""
    is_named: int
    takes: int
    """Which readings it takes from that circle; see `TAKES_NOTHING`."""


class Score(Record):
    """The evidence of readings for a circle or a polygon."""

    log_likelihood_ratio: float
    hits: float
    misses: float
    """Readings that should have hit and passed through."""
    near: float
    """Readings within the gate."""
    closest: float
    """Least range of a hit, m."""
    dispersion: float
    """Dispersion of the axes of the sensors that heard it."""
    sure_hits: float
    """Hits where an echo was certain to be heard; of a polygon only."""


class LineScore(Record):
    """The evidence of readings for a line."""

    log_likelihood_ratio: float
    hits: float
    misses: float
    low: float
    """Extent of the hits along the line, m."""
    high: float


class CircleFit(Record):
    """A fitted centre and its information."""

    x: float
    y: float
    information_xx: float
    """1/m²"""
    information_xy: float
    information_yy: float


class LineFit(Record):
    """A fitted line: unit normal and distance from the fit's origin."""

    normal_x: float
    normal_y: float
    distance: float
    rays: int
    """As in `Predictions`; given."""
    half_angle: float


class CornerFit(Record):
    """Two faces and the edge in which they meet, if they do."""

    faces: Annotated[Records[LineFit], 2]
    edge_x: float
    edge_y: float


class CirclePosterior(Record):
    """Mean, lower Cholesky root of the expected covariance, and covariance of a circle's centre; m, m²."""

    x: float
    y: float
    root_xx: float
    root_yx: float
    root_yy: float
    covariance_xx: float
    covariance_xy: float
    covariance_yy: float


class BearingErrors(Record):
    """The errors of a circle's readings from one bearing."""

    count: int
    errors: Annotated[Floats, BIN_CAPACITY]
    """Ascending, m."""
    variance: float
    """Sum of their variances, m²."""
    mean: float
    """m"""
    accuracy: float
    """Inverse of the mean's standard deviation, 1/m; 0 with too few readings."""
    whitened: float


class Pull(Record):
    """What an echo of a wall says of the ring's shift."""

    x: float
    """Growth of its range with the shift along x."""
    y: float
    error: float
    """Range less predicted, m."""
    accuracy: float
    """Inverse of that error's variance without the shift, m⁻²; 0 where no wall explains the echo."""


class ShiftInformation(Record):
    """What is known of the ring's shift: the sum of information (m⁻²), and of information times shift (m⁻¹)."""

    xx: float
    xy: float
    yy: float
    x: float
    y: float


class Scratch(Record):
    """Values that kernels overwrite before each use."""

    fired: Annotated[Records[Reading], SENSORS_MAX]
    """The readings of this firing: echoes, then cross paths."""
    crosses: int
    """Number of cross paths among them."""
    crosses_found: Annotated[Ints, CROSS_HISTORY]
    """Places of the remembered cross paths that a circle may explain."""
    fired_sensors: Annotated[Ints, SENSORS_MAX]
    explained_by: Annotated[Ints, SENSORS_MAX]
    """Explanation of each fired reading; see `UNEXPLAINED`."""
    pulls: Annotated[Records[Pull], SENSORS_MAX]
    """Of each fired reading."""
    shift: ShiftInformation
    near_recent: Annotated[Ints, RECENT_READINGS_MAX]
    """Places of the recent readings that may bear on a new wall."""
    near_readings: NearReadings
    """The readings at these places."""
    wall_evidence: Annotated[Floats, WALL_BINS]
    """Evidence that a wall covers each of its bins, nat."""
    wall_covered: Annotated[Ints, WALL_BINS]
    """Whether the bin before is covered: 1 if so where this one is open, plus 2 if so where this one is covered."""
    segments: Annotated[Records[PairSegment], PAIRS_PER_SENSOR * SENSORS_MAX]
    """The segments of this firing."""
    readings: Annotated[Records[Reading], COMPARED_MAX]
    """The readings of one object."""
    face_readings: Annotated[Records[Reading], COMPARED_MAX]
    facing: Annotated[Ints, COMPARED_MAX]
    """Places of those readings that end near the circle with which a corner is compared."""
    others: Annotated[Records[OtherCircle], TRACKS_MAX]
    """The established circles other than one."""
    predicted: Predictions
    """Of the circle that was last asked for."""
    own: Predictions
    """Of the circle that is refined, where it is now."""
    linear: Annotated[Records[LinearReading], COMPARED_MAX]
    cells: Annotated[Floats, GRID_CELLS]
    """Log likelihood of each cell of a posterior's grid, nat."""
    sides: Annotated[Ints, BEARING_BINS]
    """1 for each bearing bin from which an object was heard."""
    bearings: Annotated[Records[BearingErrors], BEARING_BINS]
    outline_root: Annotated[Floats, BEARING_BINS, BEARING_BINS]
    """Lower Cholesky root of an unknown outline's covariance; see `perception.bayes.circles.outline_check`."""
    near: Annotated[Records[MappedSegment], 32]
    """Segments near a place."""
    attracting: Annotated[Floats, ATTRACTING_MAX, 5]
    """Segments as `perception.relaxation` takes them: ends x, y, x, y (m) and normal (rad)."""
    attracting_rows: Annotated[Ints, ATTRACTING_MAX]
    """The whole numbers from 0 on."""
    pose: Annotated[Floats, 3]
    """x, y (m), heading (rad), as `perception.relaxation` takes a pose."""
    hypothesis: Pose
    score: Score
    line_score: LineScore
    circle_fit: CircleFit
    line_fit: LineFit
    corner_fit: CornerFit
    posterior: CirclePosterior
