"""Named places, no-go lines and areas, and speed limits by area, as a map file and a run file hold them.

They lie in the map frame of a run that has one (``run --map``, or correction of drift), otherwise in the frame of its
odometry, which is another one in the next run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Final, TypeAlias

from pydantic import Field, model_validator

from config.files import ConfigError, did_you_mean
from config.mission import MissionConfig
from config.mission_step import Name
from config.strict import Coordinate, Point, Strict, TomlList

PLACES_MAX: Final = 200
"""Most places, and most lines or areas of a kind."""
CORNERS_MAX: Final = 100
"""Most corners of a line or an area."""

Title: TypeAlias = Annotated[str, Field(max_length=40, description="For the operator.")]


class PlaceConfig(Strict):
    """A named place, to which goals and missions can drive (m, degrees)."""

    name: Name
    x_m: Coordinate
    y_m: Coordinate
    """The place, m."""
    heading_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Heading at the place, counter-clockwise from x; by default any."""

    @property
    def heading_rad(self) -> float | None:
        """The same in rad."""
        return None if self.heading_deg is None else math.radians(self.heading_deg)


class NoGoLineConfig(Strict):
    """A line that the robot does not cross."""

    name: Title = ""
    points_m: TomlList[Point] = Field(min_length=2, max_length=CORNERS_MAX)
    """Its corners in order, m."""


class NoGoAreaConfig(Strict):
    """An area that the robot does not enter."""

    name: Title = ""
    vertices_m: TomlList[Point] = Field(min_length=3, max_length=CORNERS_MAX)
    """Its corners in order, m."""


class SpeedAreaConfig(Strict):
    """An area in which the robot drives no faster than some speed."""

    name: Title = ""
    vertices_m: TomlList[Point] = Field(min_length=3, max_length=CORNERS_MAX)
    """Its corners in order, m."""
    speed_max_m_s: float = Field(ge=0.02, le=10.0)
    """The speed, m/s."""


class PlacesConfig(Strict):
    """`[places]`: named places, no-go lines and areas, and speed limits by area."""

    place: TomlList[PlaceConfig] = Field(default=(), max_length=PLACES_MAX)
    """Named places."""
    no_go_line: TomlList[NoGoLineConfig] = Field(default=(), max_length=PLACES_MAX)
    """Lines that the robot does not cross."""
    no_go_area: TomlList[NoGoAreaConfig] = Field(default=(), max_length=PLACES_MAX)
    """Areas that the robot does not enter."""
    speed_area: TomlList[SpeedAreaConfig] = Field(default=(), max_length=PLACES_MAX)
    """Areas with a speed limit."""

    @model_validator(mode="after")
    def _has_distinct_names(self) -> PlacesConfig:
        names = [place.name for place in self.place]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"two places are named {twice}: give each place a name of its own")
        return self

    def __str__(self) -> str:
        parts = {
            "places": self.place,
            "no-go lines": self.no_go_line,
            "no-go areas": self.no_go_area,
            "speed areas": self.speed_area,
        }
        return ", ".join(f"{len(rows)} {what}" for what, rows in parts.items() if rows) or "no places"

    def named(self, name: str) -> PlaceConfig | None:
        """Return the place of this name, None if there is none."""
        return next((place for place in self.place if place.name == name), None)

    @property
    def has_any(self) -> bool:
        """Whether anything is marked."""
        return bool(self.place) or self.limits_drive

    @property
    def limits_drive(self) -> bool:
        """Whether there is a no-go line or area, or a speed limit."""
        return bool(self.no_go_line or self.no_go_area or self.speed_area)

    def no_go_outlines(self) -> Iterator[tuple[str, tuple[tuple[float, float], ...], bool]]:
        """Yield text for the operator, corners (m) and whether it is an area, of each no-go line and area."""
        for number, line in enumerate(self.no_go_line, 1):
            yield f"the no-go line {line.name or number}", line.points_m, False
        for number, area in enumerate(self.no_go_area, 1):
            yield f"the no-go area {area.name or number}", area.vertices_m, True


PLACE_KEYS: Final = tuple(PlacesConfig.model_fields)
"""The tables of places in a map file."""


def check_places(mission: MissionConfig | None, places: PlacesConfig) -> None:
    """Refuse a mission that names a place which there is not.

    Raises
    ------
    ConfigError
        It names one; the message lists those that there are.
    """
    if mission is not None:
        problems = [no_such_place(name, places) for name in sorted(mission.places()) if places.named(name) is None]
        if problems:
            raise ConfigError(*(f"mission {mission.name}: {problem}" for problem in problems))


def no_such_place(name: str, places: PlacesConfig) -> str:
    """Return the error for a place that does not exist, with the names of those that do."""
    known = [place.name for place in places.place]
    listed = f"the places are {', '.join(known)}" if known else "no place has been named yet: name one on the map"
    near = did_you_mean(name, known)
    return f"no place is named {name}{near}; {listed}"
