"""State of the landmark filter: the pose of the ring, slow scales and landmarks, with one covariance.

The error is the right-invariant one (A. Barrau and S. Bonnabel, "An EKF-SLAM algorithm with consistency properties",
2015): with the true heading θ = θ̂ + δθ, a true position is p = R(δθ) p̂ + V(δθ) δp, and a landmark's alike. So neither
the propagation by odometry nor the Jacobian of a range depends on the heading, and the filter cannot believe that it
has observed the heading of the whole map. Lengths are metres, angles radians.
"""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple, TypeAlias

from config.robot import SENSORS_MAX
from perception.bounds import FINITE, Bound, Count, Finite, Flag, Place, up_to
from perception.kernel import Floats
from perception.records import Record, Records

LANDMARKS_MAX: Final = 72
"""As many as perception has tracks: 48 circles and 24 polygons."""

STRAY_MIN: Final = 5e-4
"""Least value of `Estimate.stray`."""
STRAY_MAX: Final = 0.9
"""Greatest value of `Estimate.stray`."""
SCALE_MAX: Final = 2.0
"""Greatest scale of odometer and ranges; its inverse is the least, by which something is divided: those of a real
robot are near 1."""

HEADING, X, Y, OFFSET, ODOMETER, TURN, RANGE, FIRST = range(8)
"""Rows of the covariance for the fields of `Estimate`, in their order, and the row of the first landmark's x."""
ROWS_MAX: Final = FIRST + 2 * LANDMARKS_MAX
"""Rows of the state: that of the robot, and the place of each landmark."""


class SonarModel(NamedTuple):
    """What the filter knows of the sensors."""

    var0: float
    rel2: float
    """Nominal variance of a range: var0 (m²) + rel2 · r²."""
    half_angle: float
    """Half the beam's width, rad."""
    range_min: float
    range_max: float
    """Ranges of the ring; one at either end is no measurement, m."""


class Landmark(Record):
    """A round object in the map frame."""

    x: Place
    y: Place
    radius: Annotated[float, Bound(0.0, 1e3)]
    number: Count
    """The number that perception gave the object."""
    failures: Count
    """Readings in succession that should have hit it and missed, while other landmarks were hit."""
    hits: Count
    moved: Flag
    """Whether it stood elsewhere before."""
    anchor_x: Place
    anchor_y: Place
    """Its place when perception's track was last moved with it."""
    drift_nat: Finite
    """Evidence of its readings that odometry drifts, in the filter that takes odometry as exact."""


class LastUse(Record):
    """Where a sensor was at the last of its readings that the filter used."""

    x: Place
    y: Place
    axis: Place
    is_known: Flag


class Estimate(Record):
    """The mean."""

    heading: Place
    """Direction of the ring's sensor 0."""
    x: Place
    y: Place
    offset: Place
    """True less reported angle from the ring's direction to the direction of travel."""
    odometer_scale: Annotated[float, Bound(1.0 / SCALE_MAX, SCALE_MAX)]
    """Reported distance over true distance."""
    turn_scale: Place
    """True turn over reported turn, less 1."""
    range_scale: Annotated[float, Bound(1.0 / SCALE_MAX, SCALE_MAX)]
    """Reported range over true range."""
    count: Annotated[int, up_to(LANDMARKS_MAX)]
    """Landmarks."""
    noise: Annotated[float, Bound(0.0, 1e3)]
    """Variance of the ranges over the nominal one, estimated from the innovations."""
    heading_correction: Place
    offset_correction: Place
    """Sums of the corrections of heading and offset since the estimate of their random walk was last renewed."""
    stray: Annotated[float, Bound(STRAY_MIN, STRAY_MAX)]
    """Share of the landmarks just outside a beam that its sensor hears all the same."""
    fit_share: Finite
    """Share of the expected echoes that came, over the last few dozen."""
    landmarks: Annotated[Records[Landmark], LANDMARKS_MAX]
    sensors: Annotated[Records[LastUse], SENSORS_MAX]
    gain: Annotated[Floats, ROWS_MAX, FINITE]
    """Scratch."""
    lever: Annotated[Floats, ROWS_MAX, FINITE]
    """Scratch: how a turn of the ring moves each row."""


EstimateRecord: TypeAlias = Records[Estimate]
"""The mean as kernels take it: one record."""
