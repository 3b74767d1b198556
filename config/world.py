"""The world file: what stands in an emulated hall, how sound behaves there, and how odometry drifts."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from config.strict import Coordinate, Point, Strict, TomlList

ITEMS_MAX: Final = 1000
"""Things of a kind in a world, and corners of a thing."""

Turn: TypeAlias = Annotated[float, Field(ge=-360.0, le=360.0)]
"""An angle, degrees."""


class DrumConfig(Strict):
    """A closed cylinder."""

    x_m: Coordinate
    y_m: Coordinate
    radius_m: float = Field(gt=0.0, le=100.0)


class WallConfig(Strict):
    """A straight wall between two points, seen from both sides."""

    x1_m: Coordinate
    y1_m: Coordinate
    x2_m: Coordinate
    y2_m: Coordinate


class BoxConfig(Strict):
    """A rectangle by its centre, its sides, and its rotation."""

    x_m: Coordinate
    y_m: Coordinate
    width_m: float = Field(gt=0.0, le=100.0)
    depth_m: float = Field(gt=0.0, le=100.0)
    angle_deg: Turn = 0.0


class PolygonConfig(Strict):
    """A closed polygon by its corners, in order."""

    vertices_m: TomlList[Point] = Field(min_length=3, max_length=ITEMS_MAX)


class StartConfig(Strict):
    """Where the robot stands when the world begins, in world coordinates."""

    x_m: Coordinate = 0.0
    y_m: Coordinate = 0.0
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

    drum: TomlList[DrumConfig] = Field(default=(), max_length=ITEMS_MAX)
    wall: TomlList[WallConfig] = Field(default=(), max_length=ITEMS_MAX)
    box: TomlList[BoxConfig] = Field(default=(), max_length=ITEMS_MAX)
    polygon: TomlList[PolygonConfig] = Field(default=(), max_length=ITEMS_MAX)
    start: StartConfig = StartConfig()
    acoustics: AcousticsConfig = AcousticsConfig()
    odometry: OdometryConfig = OdometryConfig()
