"""State of the landmark filter: the pose of the ring, slow scales and landmarks, with one covariance.

The error is the right-invariant one (A. Barrau and S. Bonnabel, "An EKF-SLAM algorithm with consistency properties",
2015): with the true heading θ = θ̂ + δθ, a true position is p = R(δθ) p̂ + V(δθ) δp, and a landmark's alike. So neither
the propagation by odometry nor the Jacobian of a range depends on the heading, and the filter cannot believe that it
has observed the heading of the whole map. Lengths are metres, angles radians.
"""

from __future__ import annotations

from typing import Annotated, Final, TypeAlias

from perception.kernel import Floats
from perception.records import Record, Records

LANDMARKS_MAX: Final = 72
"""As many as perception has tracks: 48 circles and 24 polygons."""
SENSORS_MAX: Final = 255
"""As `config.robot.SENSORS_MAX`."""

HEADING, X, Y, OFFSET, ODOMETER, TURN, RANGE = range(7)
"""Rows of the covariance for the fields of `Estimate`, in their order; those of the landmarks follow."""
FIRST: Final = 7
"""Row of the first landmark's x."""
ROWS_MAX: Final = FIRST + 2 * LANDMARKS_MAX


class Landmark(Record):
    """A round object in the map frame."""

    x: float
    y: float
    radius: float
    number: int
    """The number that perception gave the object."""
    failures: int
    """Readings in succession that should have hit it and missed, while other landmarks were hit."""
    hits: int
    moved: int
    """Whether it stood elsewhere before."""
    anchor_x: float
    anchor_y: float
    """Its place when perception's track was last moved with it."""


class LastUse(Record):
    """Where a sensor was at the last of its readings that the filter used."""

    x: float
    y: float
    axis: float
    is_known: int


class Estimate(Record):
    """The mean."""

    heading: float
    """Direction of the ring's sensor 0."""
    x: float
    y: float
    offset: float
    """True less reported angle from the ring's direction to the direction of travel."""
    odometer_scale: float
    """Reported distance over true distance."""
    turn_scale: float
    """True turn over reported turn, less 1."""
    range_scale: float
    """Reported range over true range."""
    count: int
    """Landmarks."""
    noise: float
    """Variance of the ranges over the nominal one, estimated from the innovations."""
    heading_correction: float
    offset_correction: float
    """Sums of the corrections of heading and offset since the estimate of their random walk was last renewed."""
    stray: float
    """Share of the landmarks just outside a beam that its sensor hears all the same."""
    fit_share: float
    """Share of the expected echoes that came, over the last few dozen."""
    landmarks: Annotated[Records[Landmark], LANDMARKS_MAX]
    sensors: Annotated[Records[LastUse], SENSORS_MAX]
    gain: Annotated[Floats, ROWS_MAX]
    """Scratch."""
    lever: Annotated[Floats, ROWS_MAX]
    """Scratch: how a turn of the ring moves each row."""


EstimateRecord: TypeAlias = Records[Estimate]
"""The mean as kernels take it: one record."""
