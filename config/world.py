"""The world file: objects and walls of an emulated hall, its acoustics, and the drift of odometry."""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from config.places import PLACE_KEYS, PlacesConfig
from config.strict import Coordinate, Point, Strict, TomlList

ITEMS_MAX: Final = 20_000
"""Largest number of objects of one kind in a world, and of corners of a polygon."""

Turn: TypeAlias = Annotated[float, Field(ge=-360.0, le=360.0)]
"""An angle, degrees."""


class DrumConfig(Strict):
    """A closed cylinder: its centre and radius, m."""

    x_m: Coordinate
    y_m: Coordinate
    radius_m: float = Field(gt=0.0, le=100.0)


class WallConfig(Strict):
    """A straight wall between two points (m), visible from both sides."""

    x1_m: Coordinate
    y1_m: Coordinate
    x2_m: Coordinate
    y2_m: Coordinate


class BoxConfig(Strict):
    """A rectangle: its centre (m), its sides (m) and its rotation (degrees)."""

    x_m: Coordinate
    y_m: Coordinate
    width_m: float = Field(gt=0.0, le=100.0)
    depth_m: float = Field(gt=0.0, le=100.0)
    angle_deg: Turn = 0.0

    def corners_m(self) -> list[tuple[float, float]]:
        """Return its corners counter-clockwise, m."""
        c, s = math.cos(math.radians(self.angle_deg)), math.sin(math.radians(self.angle_deg))
        half = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
        local = [(i * self.width_m, j * self.depth_m) for i, j in half]
        return [(self.x_m + c * x - s * y, self.y_m + s * x + c * y) for x, y in local]


class PolygonConfig(Strict):
    """A closed polygon: its corners in order, m."""

    vertices_m: TomlList[Point] = Field(min_length=3, max_length=ITEMS_MAX)


class StartConfig(Strict):
    """Pose of the robot at the start, in world coordinates (m, degrees)."""

    x_m: Coordinate = 0.0
    y_m: Coordinate = 0.0
    heading_deg: Turn = 0.0


class AcousticsConfig(Strict):
    """The model of ranges and their errors."""

    model: Literal["cone", "specular"] = "cone"
    """`cone`: the nearest surface point in the beam; `specular`: an echo only if its normal is in the beam."""
    noise_relative: float = Field(default=0.0, ge=0.0, le=1.0)
    """Standard deviation of the range noise that grows with range, as a share of the range."""
    noise_m: float = Field(default=0.0, ge=0.0, le=10.0)
    """Standard deviation of the range noise that does not depend on range, m."""
    dropout: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a sensor misses its echo."""
    outliers: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a reading is a uniformly random range within the window."""
    outlier_max_m: float | None = Field(default=None, gt=0.0, le=100.0)
    """Largest random range, m; by default, and at most, the end of the window."""
    crosstalk: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a sensor hears a neighbour's echo of the same firing if that arrives first."""
    sound_speed_scale: float = Field(default=1.0, ge=0.8, le=1.2)
    """True speed of sound over the one that the ring assumes; ranges are divided by it."""


class OdometryConfig(Strict):
    """The drift of odometry."""

    scale: float = Field(default=1.0, ge=0.5, le=1.5)
    """Reported distance over true distance."""
    heading_rad_per_sqrt_m: float = Field(default=0.0, ge=0.0, le=1.0)
    """Standard deviation of the heading's random walk, rad per √m travelled."""
    turn_scale: float = Field(default=1.0, ge=0.5, le=1.5)
    """Reported turn over true turn: a differential base's wheels stand farther apart than assumed if above 1."""
    veer_rad_per_m: float = Field(default=0.0, ge=-1.0, le=1.0)
    """Turn reported on a straight way, rad/m: a differential base's wheels differ in size."""


class WorldConfig(PlacesConfig):
    """A world file: a room, and the places and no-go areas on its map."""

    drum: TomlList[DrumConfig] = Field(default=(), max_length=ITEMS_MAX)
    wall: TomlList[WallConfig] = Field(default=(), max_length=ITEMS_MAX)
    box: TomlList[BoxConfig] = Field(default=(), max_length=ITEMS_MAX)
    polygon: TomlList[PolygonConfig] = Field(default=(), max_length=ITEMS_MAX)
    start: StartConfig = StartConfig()
    acoustics: AcousticsConfig = AcousticsConfig()
    odometry: OdometryConfig = OdometryConfig()

    def places(self) -> PlacesConfig:
        """Return what is marked on the map of this room."""
        return PlacesConfig(**{key: getattr(self, key) for key in PLACE_KEYS})

    def sides_m(self) -> list[tuple[float, float, float, float]]:
        """Return both ends of each wall, and of each side of the boxes and polygons, m."""
        sides = [(wall.x1_m, wall.y1_m, wall.x2_m, wall.y2_m) for wall in self.wall]
        outlines = [box.corners_m() for box in self.box] + [list(polygon.vertices_m) for polygon in self.polygon]
        for outline in outlines:
            sides += [(*a, *b) for a, b in zip(outline, outline[1:] + outline[:1], strict=True)]
        return sides
