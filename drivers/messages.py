"""The messages of any robot, whatever its wire format.

These types are all that the rest of the program sees of a robot: a further robot is one more folder that produces
them. Units are SI and radians; counter-clockwise is positive, x points forward.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntFlag
from typing import Annotated, Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, GetPydanticSchema
from pydantic_core import CoreSchema, core_schema

from config.bounded import COUNT_MAX, RANGE_MAX_M, Coordinate, Number, Seconds, Speed


def _array_schema(
    entry: CoreSchema, dtype: type[np.generic], check: Callable[[NDArray[Any]], None] | None = None
) -> GetPydanticSchema:
    """Return how pydantic writes and reads an array of shape (n,): as a list of numbers, exact to the bit."""

    def as_array(values: list[Any]) -> NDArray[Any]:
        array = np.array(values, dtype=dtype)
        if check is not None:
            check(array)
        return array

    def schema(_source: object, _handler: object) -> CoreSchema:
        numbers = core_schema.list_schema(entry)
        return core_schema.no_info_before_validator_function(
            _as_list,
            core_schema.no_info_after_validator_function(as_array, numbers),
            serialization=core_schema.plain_serializer_function_ser_schema(_as_list, return_schema=numbers),
        )

    return GetPydanticSchema(schema)


def _as_list(value: object) -> object:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _check_ranges(ranges_m: NDArray[Any]) -> None:
    """Check ranges of a recording, m.

    Raises
    ------
    ValueError
        One is below 0, or too long to be one.
    """
    heard = ranges_m[~np.isnan(ranges_m) & (ranges_m != math.inf)]
    if len(heard) and not (heard.min() >= 0.0 and heard.max() <= RANGE_MAX_M):
        raise ValueError(f"a range of {heard.min():g} or {heard.max():g} m, expected 0 to {RANGE_MAX_M:g}")


Floats: TypeAlias = Annotated[NDArray[np.float64], _array_schema(core_schema.float_schema(), np.float64)]
"""An array of float64; pydantic records one of shape (n,) as a list."""
Ranges: TypeAlias = Annotated[
    NDArray[np.float64], _array_schema(core_schema.float_schema(), np.float64, _check_ranges)
]
"""Ranges, m; recorded likewise, and refused beyond `RANGE_MAX_M`. NaN is no reading, +inf no echo."""
Indices: TypeAlias = Annotated[NDArray[np.int64], _array_schema(core_schema.int_schema(ge=0, le=255), np.int64)]
"""An array of indices of sensors; recorded likewise."""


def wrap_angle(angle_rad: float) -> float:
    """Return the angle wrapped into [−π, π)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, slots=True)
class Pose:
    """A position and direction in the plane, m and rad: an element of SE(2)."""

    x: Coordinate
    y: Coordinate
    theta: Coordinate

    def compose(self, other: Pose) -> Pose:
        """Return the pose `other`, which is given in this pose's frame, in the frame of this pose."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, self.theta + other.theta)

    def inverse(self) -> Pose:
        """Return the pose p with ``p.compose(self)`` the identity."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, -self.theta)


IDENTITY: Final = Pose(0.0, 0.0, 0.0)
"""The pose of a frame in itself."""


@dataclass(frozen=True, slots=True)
class Twist:
    """A velocity in the body's frame: v forward in m/s, w counter-clockwise in rad/s."""

    v: Speed
    w: Speed

    def at_most(self, speed_m_s: float) -> Twist:
        """Return this velocity, or a slower one on the same curve whose speed is `speed_m_s`."""
        speed = abs(self.v)
        if speed <= speed_m_s:
            return self
        share = speed_m_s / speed
        return Twist(share * self.v, share * self.w)


class Flags(IntFlag):
    """The base's status; a robot that lacks one of these never sets it."""

    NONE = 0
    LATCHED = 1
    BUMPER = 2
    MOTOR_FAULT = 4
    DEADMAN = 8
    BATTERY_LOW = 16


RecordedFlags: TypeAlias = Annotated[Flags, Field(ge=0, le=COUNT_MAX)]
"""Flags of a later version may be among them."""


@dataclass(frozen=True, slots=True)
class Identity:
    """A robot's description of itself; a new `boot_id` means that it has restarted."""

    name: str
    sensors: int
    ring_radius_m: float
    deadman_s: float
    odometry_period_s: float
    boot_id: int
    traits: tuple[tuple[str, str], ...] = ()
    """What else it says of itself that outlasts a restart: names and values."""


@dataclass(frozen=True, slots=True)
class Odometry:
    """The base's pose and velocity by its own odometry."""

    robot_s: Seconds
    """The robot's own clock: seconds since boot, unwrapped."""
    pose: Pose
    """Position, and the direction in which the wheels drive; unwrapped."""
    ring_yaw: Coordinate
    """Direction of the ring's sensor 0, rad, unwrapped. It equals `pose.theta` on a base whose body turns with its
    wheels, not on a synchro drive."""
    twist: Twist
    """The wheels' velocity."""
    flags: RecordedFlags
    """The base's status."""
    last_drive_seq: Number
    """Number of the last drive command that the base obeyed."""


@dataclass(frozen=True, slots=True, eq=False)
class CrossPaths:
    """What the sensors that listened without firing heard of the others' pulses: one entry for each, shape (n,)."""

    transmitters: Indices
    listeners: Indices
    """Indices of the sensor whose pulse was heard, and of the one that listened."""
    half_paths_m: Ranges
    """Half the whole path from the transmitter over a surface to the listener, m; +inf if nothing was heard inside
    the window."""

    def contradiction(self, sensors: int) -> str | None:
        """Return why a ring of so many sensors cannot have heard this; None if it can."""
        lengths = [len(self.transmitters), len(self.listeners), len(self.half_paths_m)]
        if not 1 <= lengths[0] <= sensors or len(set(lengths)) > 1:
            return f"cross paths have arrays of {lengths} entries, expected 1 to {sensors} in each"
        highest = int(max(self.transmitters.max(), self.listeners.max()))
        if highest >= sensors or (self.transmitters == self.listeners).any():
            return f"cross paths name sensor {highest} of {sensors}, or one that hears itself"
        return "cross paths have a path that is no number" if np.isnan(self.half_paths_m).any() else None


@dataclass(frozen=True, slots=True, eq=False)
class Firing:
    """One firing of a set of sensors, and the pose of the base when they fired."""

    robot_s: Seconds
    """The robot's own clock when the sensors fired, s."""
    pose: Pose
    ring_yaw: Coordinate
    """As in `Odometry`, at that time."""
    ranges_m: Ranges
    """Shape (sensors,), one entry for each sensor of the ring: the range in metres, +inf for a sensor that fired and
    heard no echo inside its window, NaN for one that did not fire or reported a fault."""
    cross_paths: CrossPaths | None = None
    """What the listeners heard, in the order of their indices, without those that reported a fault; None if there is
    none, as always on a ring that cannot listen."""

    def contradiction(self) -> str | None:
        """Return why the cross paths are not of this ring; None if they are."""
        return None if self.cross_paths is None else self.cross_paths.contradiction(len(self.ranges_m))

    def over_scale(self, range_scale: float) -> Firing:
        """Return this firing with all distances divided by `range_scale`: reported over true."""
        heard = self.cross_paths
        if heard is not None:
            heard = replace(heard, half_paths_m=heard.half_paths_m / range_scale)
        return replace(self, ranges_m=self.ranges_m / range_scale, cross_paths=heard)


@dataclass(frozen=True, slots=True)
class LinkCounts:
    """Frames received since the line was first opened: valid ones, corrupt ones, and ones known to be lost."""

    frames: int = 0
    bad: int = 0
    lost: int = 0
