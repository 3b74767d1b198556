"""The section `[arcos]` of a robot file: what differs between models of the Pioneer family besides the ring."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from config.strict import Strict, TomlList

DISCS_MAX = 32
"""Most sonar discs of a robot: four arrays of eight."""


class ArcosConfig(Strict):
    """Factors from the raw values of a Pioneer to millimetres and radians, and the numbers of its sonar discs."""

    subclasses: TomlList[Annotated[str, Field(min_length=1, max_length=64)]] = ()
    """Models that this file describes, by the subclass that the robot reports, as p3dx; any if empty."""
    distance_factor: float = Field(default=1.0, gt=0.0, le=10.0)
    """Millimetres per count of the odometry."""
    velocity_factor: float = Field(default=1.0, gt=0.0, le=10.0)
    """Millimetres per second per unit of a wheel's speed."""
    range_factor: float = Field(default=1.0, gt=0.0, le=10.0)
    """Millimetres per unit of a range."""
    turn_factor: float = Field(default=0.0056, gt=0.0, le=0.1)
    """Turning rate, rad/s, per mm/s of half the difference of the wheels' speeds."""
    discs: Annotated[TomlList[Annotated[int, Field(ge=0, lt=DISCS_MAX)]], Field(max_length=DISCS_MAX)] | None = None
    """The robot's number of each sensor of the ring, from 0; by default 0, 1, 2 and so on."""
