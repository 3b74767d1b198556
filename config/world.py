"""The world file: objects and walls of an emulated hall, its acoustics, and the drift of odometry."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Final, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from config.places import PLACE_KEYS, PlacesConfig
from config.strict import Coordinate, Point, Strict, TomlList

ITEMS_MAX: Final = 20_000
"""Largest number of objects of one kind in a world, and of corners of a polygon."""

Turn: TypeAlias = Annotated[float, Field(ge=-360.0, le=360.0)]
"""An angle, degrees."""


Surface: TypeAlias = Literal["cone", "specular", "rays", "silent"]
"""How a surface answers: by a model of the acoustics, or not at all, as cloth does; it hides what is behind it."""

BEND_SHARE_MAX: Final = 0.1
"""Largest bend of a wall, as a share of its length: beyond it the wall is no longer straight but for a bend."""
BEND_PIECE_M: Final = 0.15
"""Longest straight piece of a bent wall: with a bend of 3 cm in 3 m it deviates from the arc by .1 mm."""


class DrumConfig(Strict):
    """A closed cylinder: its centre and radius, m."""

    x_m: Coordinate
    y_m: Coordinate
    """Its centre."""
    radius_m: float = Field(gt=0.0, le=100.0)
    """Its radius, m."""
    surface: Surface | None = None
    """How it answers if not by the world's `acoustics.model`; `silent` absorbs sound and hides what is behind."""


class WallConfig(Strict):
    """A wall between two points (m), visible from both sides."""

    x1_m: Coordinate
    y1_m: Coordinate
    x2_m: Coordinate
    y2_m: Coordinate
    """The two points."""
    bend_m: float = Field(default=0.0, ge=-1.0, le=1.0)
    """How far its middle lies left of the line from the first point to the second, m; the wall is an arc then."""
    surface: Surface | None = None
    """How it answers if not by the world's `acoustics.model`; `silent` absorbs sound and hides what is behind."""

    @model_validator(mode="after")
    def _bends_little(self) -> Self:
        length_m = math.hypot(self.x2_m - self.x1_m, self.y2_m - self.y1_m)
        if abs(self.bend_m) > BEND_SHARE_MAX * length_m:
            raise ValueError(
                f"bend_m: a wall of {length_m:g} m bends by {BEND_SHARE_MAX * length_m:g} m at most; "
                "a smaller bend, or several walls for a round one"
            )
        return self

    def points_m(self) -> list[tuple[float, float]]:
        """Return the wall's ends, and between them those of the straight pieces of a bent one, in order, m.

        The pieces are about `BEND_PIECE_M` long.
        """
        if self.bend_m == 0.0:
            return [(self.x1_m, self.y1_m), (self.x2_m, self.y2_m)]
        dx, dy = self.x2_m - self.x1_m, self.y2_m - self.y1_m
        length = math.hypot(dx, dy)
        # The arc's half angle: tan(a/2) = bend / half chord. Points are even along the arc.
        half = 2.0 * math.atan(2.0 * self.bend_m / length)
        count = math.ceil(length / BEND_PIECE_M)
        angles = [half * (2.0 * k / count - 1.0) for k in range(count + 1)]
        radius = 0.5 * length / math.sin(half)
        local = [(0.5 * length + radius * math.sin(a), radius * (math.cos(a) - math.cos(half))) for a in angles]
        ux, uy = dx / length, dy / length
        points = [(self.x1_m + x * ux - y * uy, self.y1_m + x * uy + y * ux) for x, y in local]
        points[0], points[-1] = (self.x1_m, self.y1_m), (self.x2_m, self.y2_m)
        return points

    def pieces_m(self) -> list[tuple[float, float, float, float]]:
        """Return both ends of the wall's straight pieces in order, m; each begins where the one before it ends."""
        return [(*a, *b) for a, b in pairwise(self.points_m())]


class BoxConfig(Strict):
    """A rectangle: its centre (m), its sides (m) and its rotation (degrees)."""

    x_m: Coordinate
    y_m: Coordinate
    """Its centre."""
    width_m: float = Field(gt=0.0, le=100.0)
    depth_m: float = Field(gt=0.0, le=100.0)
    """Its sides before it is turned: along x and along y, m."""
    angle_deg: Turn = 0.0
    """How far it is turned counter-clockwise, degrees."""
    surface: Surface | None = None
    """How it answers if not by the world's `acoustics.model`; `silent` absorbs sound and hides what is behind."""

    def corners_m(self) -> list[tuple[float, float]]:
        """Return its corners counter-clockwise, m."""
        c, s = math.cos(math.radians(self.angle_deg)), math.sin(math.radians(self.angle_deg))
        half = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
        local = [(i * self.width_m, j * self.depth_m) for i, j in half]
        return [(self.x_m + c * x - s * y, self.y_m + s * x + c * y) for x, y in local]


class PolygonConfig(Strict):
    """A closed polygon: its corners in order, m."""

    vertices_m: TomlList[Point] = Field(min_length=3, max_length=ITEMS_MAX)
    """Its corners, m."""
    surface: Surface | None = None
    """How it answers if not by the world's `acoustics.model`; `silent` absorbs sound and hides what is behind."""


class StartConfig(Strict):
    """Pose of the robot at the start, in world coordinates (m, degrees)."""

    x_m: Coordinate = 0.0
    y_m: Coordinate = 0.0
    """The place, m."""
    heading_deg: Turn = 0.0
    """The direction, counter-clockwise from x, degrees."""


class AcousticsConfig(Strict):
    """The model of ranges and their errors."""

    model: Literal["cone", "specular", "rays"] = "cone"
    """`cone`: the nearest surface point in the beam; `specular`: an echo only if its normal is in the beam; `rays`:
    the nearest hit of a few rays in the beam, as other simulators do it."""
    rays: int = Field(default=3, ge=1, le=100)
    """Number of rays of `rays`, evenly from one edge of the beam to the other; one is the beam's axis."""
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
    late: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a sensor that hears nothing, though a surface is in its beam, hears a late echo: by way of
    another surface, .3 to 2 m farther than the first one."""
    jitter_m: float = Field(default=0.0, ge=0.0, le=1.0)
    """Standard deviation, along each axis, of the ring's true place at a firing about the place that odometry has for
    it, m."""
    jitter_rad: float = Field(default=0.0, ge=0.0, le=1.0)
    """Standard deviation of the ring's true direction at a firing about the one that odometry has for it, rad."""
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
        """Return both ends of each straight piece of a wall, and of each side of the boxes and polygons, m."""
        sides = [piece for wall in self.wall for piece in wall.pieces_m()]
        outlines = [box.corners_m() for box in self.box] + [list(polygon.vertices_m) for polygon in self.polygon]
        for outline in outlines:
            sides += [(*a, *b) for a, b in zip(outline, outline[1:] + outline[:1], strict=True)]
        return sides
