"""The world file: what stands in an emulated hall, how sound behaves there, and how odometry drifts."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from config.strict import Many, Place, Point, Strict

THINGS_MAX: Final = 1000
"""Things of a kind in a world, and corners of a thing."""

Turn: TypeAlias = Annotated[float, Field(ge=-360.0, le=360.0)]
"""An angle, degrees."""


class DrumConfig(Strict):
    """A closed cylinder."""

    x_m: Place
    y_m: Place
    radius_m: float = Field(gt=0.0, le=100.0)


class WallConfig(Strict):
    """A straight wall between two points, seen from both sides."""

    x1_m: Place
    y1_m: Place
    x2_m: Place
    y2_m: Place


class BoxConfig(Strict):
    """A rectangle by its centre, its sides, and its rotation."""

    x_m: Place
    y_m: Place
    width_m: float = Field(gt=0.0, le=100.0)
    depth_m: float = Field(gt=0.0, le=100.0)
    angle_deg: Turn = 0.0


class PolygonConfig(Strict):
    """A closed polygon by its corners, in order."""

    vertices_m: Many[Point] = Field(min_length=3, max_length=THINGS_MAX)


class StartConfig(Strict):
    """Where the robot stands when the world begins, in world coordinates."""

    x_m: Place = 0.0
    y_m: Place = 0.0
    heading_deg: Turn = 0.0


class AcousticsConfig(Strict):
    """How a range comes about."""

    model: Literal["cone", "specular"] = "cone"
    """`cone`: nearest surface point in the beam; `specular`: echo only where the surface normal lies in the beam."""
    noise_relative: float = Field(default=0.0, ge=0.0, le=1.0)
    """Standard deviation of the range noise as a share of the range."""
    noise_m: float = Field(default=0.0, ge=0.0, le=10.0)
    """Standard deviation of the range noise that does not depend on range."""
    dropout: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a reading that should have echoed hears nothing."""
    outliers: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a reading is a uniformly random range inside the window."""
    outlier_max_m: float | None = Field(default=None, gt=0.0, le=100.0)
    """Such a range is at most this; the window's end where it is not given or beyond."""
    crosstalk: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a sensor hears a neighbour's echo of the same firing where that comes first."""
    sound_speed_scale: float = Field(default=1.0, ge=0.8, le=1.2)
    """True speed of sound over the one the ring assumes; ranges come out divided by it."""


class OdometryConfig(Strict):
    """How the odometry drifts from the truth."""

    scale: float = Field(default=1.0, ge=0.5, le=1.5)
    """Reported over true distance."""
    heading_rad_per_sqrt_m: float = Field(default=0.0, ge=0.0, le=1.0)
    """Standard deviation of the heading's random walk, a square root of a metre travelled."""


class WorldConfig(Strict):
    """A world file."""

    drum: Many[DrumConfig] = Field(default=(), max_length=THINGS_MAX)
    wall: Many[WallConfig] = Field(default=(), max_length=THINGS_MAX)
    box: Many[BoxConfig] = Field(default=(), max_length=THINGS_MAX)
    polygon: Many[PolygonConfig] = Field(default=(), max_length=THINGS_MAX)
    start: StartConfig = StartConfig()
    acoustics: AcousticsConfig = AcousticsConfig()
    odometry: OdometryConfig = OdometryConfig()
