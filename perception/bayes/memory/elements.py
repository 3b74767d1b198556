"""Capacities of the Bayesian method's memory, and the small records that the other records contain.

Lengths are metres, angles radians.
"""

from __future__ import annotations

from typing import Annotated, Final

from perception.bayes.memory.parameters import POST_RADIUS_M
from perception.bayes.memory.settings_record import CIRCLES_MAX
from perception.bounds import RANGE, Bound, Count, Finite, Place
from perception.records import Record

BEARING_BINS: Final = 36
"""Bins of a track's reservoir, by the bearing from the object to the sensor: 10° each."""

BIN_CAPACITY: Final = 20
"""Readings in a bin; the newest replaces the oldest."""
HISTORY: Final = 28
"""Readings kept of each sensor, hits and silences of any object."""
CROSS_EVERY: Final = 7
"""Of this many cross paths one is kept for good, like an echo; so few that they do not replace the echoes, and no
divisor of the number of listeners, so that it is not always the same one."""
CROSS_HISTORY: Final = 438 * CROSS_EVERY
"""Cross paths kept of all sensors: those of the last metre or two."""
CROSSES_MAX: Final = 192
"""Cross paths compared at a time."""
COMPARED_MAX: Final = BEARING_BINS * BIN_CAPACITY + CROSSES_MAX + 64
"""Readings compared at a time: a reservoir's, cross paths, and some more of the sensors' histories."""
ATTRACTING_MAX: Final = 16
"""Outline segments that may attract a hypothesis."""
BUCKETS: Final = 4096
"""Buckets of the hashed outline map; a power of two."""
BUCKET_CAPACITY: Final = 8
"""Segments in a bucket."""
MAX_POLYGONS: Final = 24
"""Tracks of polygons."""
POLYGON_BEARING_BINS: Final = 24
"""Bearing bins of a polygon's reservoir."""
POLYGON_BIN_CAPACITY: Final = 12
"""Readings in such a bin."""
REJECTIONS_MAX: Final = 32
"""Places where a user rejected an object."""
REQUESTS_MAX: Final = 32
"""Requests for polygon hypotheses, waiting or recent."""
PAIRS_PER_SENSOR: Final = 8
"""Greatest number of outline segments from one reading."""
ALTERNATIVES_MAX: Final = CIRCLES_MAX + 2
"""Explanations of a circle track: radii, a line, a corner."""
GRID_SIDE: Final = 7
"""Cells along a side of the grid on which a circle's posterior is summed; odd, so that one lies on the mean."""
GRID_CELLS: Final = GRID_SIDE * GRID_SIDE


RADIUS: Final = Bound(0.0, 1e3)
"""Of a round object, m."""


class Reading(Record):
    """A raw range in the odometry frame, or half a cross path; see `perception.bayes.inference.cross_path`."""

    x: Place
    """Position of the sensor that fired, m."""
    y: Place
    axis_x: Place
    """Its axis, a unit vector."""
    axis_y: Place
    range_m: Annotated[float, RANGE]
    """Range, m; at least `FAR` without an echo."""
    listener_x: Place
    """Position of the sensor that heard it, from there, m; 0, 0 where it is the same one."""
    listener_y: Place


class Pose(Record):
    """A pose: position (m) and heading (rad)."""

    x: Place
    y: Place
    heading: Place


class LowerTriangle(Record):
    """The lower triangle of a 3 × 3 matrix over x, y and heading h."""

    xx: Finite
    yx: Finite
    yy: Finite
    hx: Finite
    hy: Finite
    hh: Finite


class MappedSegment(Record):
    """An outline segment in the map."""

    x: Place
    """Its middle, m."""
    y: Place
    normal_x: Place
    """Unit normal, away from the sensors."""
    normal_y: Place
    number: Count
    time_s: Place


def round_label(radius: float) -> str:
    """Return the label of a round object of this radius (m) that is not a model."""
    return "edge" if radius == 0.0 else "post" if radius < POST_RADIUS_M else "barrel"
