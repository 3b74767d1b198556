"""The robot file: the ring and its firing pattern, the body, the serial line.

Everything that differs from one robot to the next, and nothing that does not.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple, TypeAlias

from pydantic import BeforeValidator, Field, model_validator

from config.strict import Strict, TomlList

SOUND_SPEED_M_S = 343.0
"""Speed of sound in dry air at 20 °C; what the ring's own electronics assume."""

SENSORS_MAX = 255
"""Sensors in a ring, and sets in a firing pattern; a file that lists a million must not fill the memory."""

SensorSet: TypeAlias = Annotated[TomlList[Annotated[int, Field(ge=0, lt=SENSORS_MAX)]], Field(max_length=SENSORS_MAX)]
"""Numbers of sensors that fire together."""

Preset = Literal["single", "opposite_pairs", "thirds", "quadrants", "octets", "alternating"]


class Mount(NamedTuple):
    """Where one sensor sits and looks, in the ring's frame: metres and radians."""

    x_m: float
    y_m: float
    angle_rad: float


class SensorConfig(Strict):
    """One sensor of a ring that is not a regular one."""

    x_m: float = Field(ge=-10.0, le=10.0)
    y_m: float = Field(ge=-10.0, le=10.0)
    angle_deg: float = Field(ge=-360.0, le=360.0)


class FiringConfig(Strict):
    """Which sensors fire together, and how often: a preset, or sets of one's own."""

    preset: Preset | None = None
    """A regular pattern by name: how many sensors, equally spaced, fire at a time; `alternating` fires octets and
    thirds in turn, so that no two sensors fire together in both and crosstalk shows."""
    sets: Annotated[TomlList[SensorSet], Field(max_length=SENSORS_MAX)] | None = None
    """Sets of sensor numbers, fired in turn; instead of a preset."""
    rotations: int = Field(default=1, ge=1, le=255)
    """Fire `sets` this many times round, one sensor further round the ring each time."""
    step_period_s: float = Field(default=0.05, ge=0.001, le=60.0)
    """Time from one firing to the next."""
    window_m: float | None = Field(default=None, gt=0.0, le=100.0)
    """How far each firing listens; `ring.range_max_m` where it is not given."""

    @model_validator(mode="after")
    def _one_pattern(self) -> FiringConfig:
        if (self.preset is None) == (self.sets is None):
            raise ValueError("give either preset or sets, one of the two")
        if self.sets is not None and not self.sets:
            raise ValueError("sets is empty: a ring that never fires sees nothing")
        if self.sets is not None and any(len(s) == 0 or len(set(s)) != len(s) for s in self.sets):
            raise ValueError("each set needs at least one sensor, and none twice")
        return self


def _preset_as_table(value: object) -> object:
    """Let ``firing = "octets"`` stand for ``firing = {preset = "octets"}``."""
    return {"preset": value} if isinstance(value, str) else value


class RingConfig(Strict):
    """The ring of sensors: regular (count and radius_m) or listed one by one (sensors)."""

    count: int | None = Field(default=None, ge=2, le=SENSORS_MAX)
    radius_m: float | None = Field(default=None, ge=0.0, le=10.0)
    sensors: Annotated[TomlList[SensorConfig], Field(max_length=SENSORS_MAX)] | None = None
    beam_half_angle_deg: float = Field(gt=0.0, lt=90.0)
    resolution_m: float = Field(ge=0.0, lt=1.0)
    """Step of the reported range; 0 = not quantised."""
    range_min_m: float = Field(ge=0.0, lt=100.0)
    range_max_m: float = Field(gt=0.0, le=100.0)
    firing: Annotated[FiringConfig, BeforeValidator(_preset_as_table)] = FiringConfig(preset="octets")

    @model_validator(mode="after")
    def _whole_ring(self) -> RingConfig:
        regular = self.count is not None and self.radius_m is not None
        partly = self.count is not None or self.radius_m is not None
        if (self.sensors is None) != regular or (self.sensors is not None and partly):
            raise ValueError("give either count and radius_m, or sensors")
        if self.sensors is not None and not self.sensors:
            raise ValueError("sensors is empty: a ring needs at least one")
        if self.range_min_m >= self.range_max_m:
            raise ValueError(f"range_min_m {self.range_min_m} is not below range_max_m {self.range_max_m}")
        return self

    @property
    def mounts(self) -> tuple[Mount, ...]:
        """Every sensor's place and direction, in the order of their numbers."""
        if self.sensors is not None:
            return tuple(Mount(s.x_m, s.y_m, math.radians(s.angle_deg)) for s in self.sensors)
        count, radius = self.count or 0, self.radius_m or 0.0
        angles = [2.0 * math.pi * i / count for i in range(count)]
        return tuple(Mount(radius * math.cos(a), radius * math.sin(a), a) for a in angles)

    @property
    def window_m(self) -> float:
        """How far a firing listens, metres."""
        return self.range_max_m if self.firing.window_m is None else self.firing.window_m


class BodyConfig(Strict):
    """The base: its size, its limits, and whether its ring turns with its wheels."""

    radius_m: float = Field(gt=0.0, le=10.0)
    speed_max_m_s: float = Field(gt=0.0, le=10.0)
    turn_max_rad_s: float = Field(gt=0.0, le=20.0)
    acceleration_max_m_s2: float = Field(default=0.5, gt=0.0, le=50.0)
    turn_acceleration_max_rad_s2: float = Field(default=2.0, gt=0.0, le=100.0)
    synchro: bool = False
    """True where the wheels turn and the body with its ring does not."""


class LinkConfig(Strict):
    """The serial line and the patience the runtime has with it."""

    port: str | None = None
    baud: int = Field(default=115200, ge=300, le=4_000_000)
    reply_timeout_s: float = Field(default=0.1, ge=0.001, le=10.0)
    """A command unanswered for this long is sent again."""
    tries: int = Field(default=3, ge=1, le=100)
    """After this many unanswered tries the link is down."""
    silence_max_s: float = Field(default=0.4, ge=0.05, le=60.0)
    """With no odometry for this long the link is down; it comes also when still. Noticed by the next cycle."""
    reopen_first_s: float = Field(default=0.05, gt=0.0, le=60.0)
    reopen_max_s: float = Field(default=0.5, gt=0.0, le=600.0)
    """First and longest wait between attempts to open the port; it doubles in between."""


class DriverConfig(Strict):
    """Which driver speaks to the robot."""

    driver: str = Field(default="denning", min_length=1, max_length=64)
    """Name of a shipped driver, or of one that an installed package provides: entry points `echolocate.drivers`."""


class RobotConfig(Strict):
    """A robot file: `[robot]`, `[ring]`, `[body]` and `[link]`."""

    robot: DriverConfig = DriverConfig()
    ring: RingConfig
    body: BodyConfig
    link: LinkConfig = LinkConfig()
