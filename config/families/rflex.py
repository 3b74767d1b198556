"""The section `[rflex]` of a robot file: what differs between robots with an rFLEX controller besides the ring."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Field

from config.strict import Strict, TomlList

BANKS_MAX = 16
"""Most banks of a controller, and most sonars of a bank: an id has four bits for each."""


BankSize: TypeAlias = Annotated[int, Field(ge=1, le=BANKS_MAX)]
"""Number of sonars of a bank."""


class RflexConfig(Strict):
    """Factors from the controller's units to SI, its sonar banks and its bumpers."""

    name: str = Field(default="rFLEX robot", min_length=1, max_length=64)
    """What to call the robot, which does not report a name."""
    distance_factor: float = Field(default=101230.0, gt=0.0, le=1e7)
    """Counts of the translation axis per metre."""
    angle_factor: float = Field(default=35343.888, gt=0.0, le=1e7)
    """Counts of the rotation axis per radian."""
    range_factor: float = Field(default=1476.0, gt=0.0, le=1e5)
    """Units of a range per metre."""
    banks: Annotated[TomlList[BankSize], Field(min_length=1, max_length=BANKS_MAX)] = (
        4,
        4,
        4,
        4,
        4,
        4,
    )
    """Number of sonars of each bank; the ring lists them bank after bank. All banks fire in parallel."""
    first_bank: int = Field(default=0, ge=0, lt=BANKS_MAX)
    """The number of the first of these banks."""
    ping_delay_us: int = Field(default=0, ge=0, le=100_000)
    """The controller waits so long before each ping, µs."""
    bumpers: Annotated[TomlList[Annotated[int, Field(ge=0, le=0xFF)]], Field(max_length=64)] = ()
    """Addresses of the bumper panels among the digital inputs."""
    bumper_mask: int = Field(default=0x0F, ge=1, le=0xFFFF)
    """The bits of such an input that stand for contacts."""
    fail_safe_s: float = Field(default=1.0, ge=0.05, le=10.0)
    """The controller stops the base so long after the last motion command, s; it does not report this itself."""
    battery_low_v: float = Field(default=22.5, ge=0.0, le=100.0)
    """Voltage below which the battery counts as low."""
