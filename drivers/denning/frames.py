"""The frames of the ring-and-base protocol as typed values, in the protocol's units.

Only this folder uses millimetres, tenths of a foot and microseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, TypeAlias

VERSION = 2
"""The newest version of the protocol implemented here; the other one is 1."""
SENSORS_MAX = 24
"""Bits in a mask of sensors."""
MASKS_MAX = 24
"""Most steps of a pattern."""
SWEEPS_MAX = 12
"""Most servos that a SCAN turns; with more sweeps a frame would be too long."""
WINDOW_MIN, WINDOW_MAX = 5, 255
"""Shortest and longest window, tenths of a foot."""
TENTHS_MIN, TENTHS_MAX = 5, 254
"""Smallest and largest echo byte that is a range, tenths of a foot."""
NO_ECHO = 255
"""The echo byte of a sensor that heard no echo inside the window."""
FAULT = 0
"""The echo byte, or count, of a sensor that reports a fault."""
NO_ECHO_COUNT = 0xFFFF
"""The count of a sensor that heard no echo inside the window, in version 2."""
CAN_LISTEN = 1
"""The bit of `Ident.capabilities` of a ring whose sensors can listen while others fire."""
HAS_SERVOS = 2
"""The bit of `Ident.capabilities` of a ring with sensors on servos: it knows SCAN, and answers it with ECHO3."""
BEARING_RAD = 1e-4
"""A count of a servo's bearing, rad counter-clockwise from the ring's front."""
TENTH_FT_M = 0.03048
"""A tenth of a foot in metres."""


class NakCode(IntEnum):
    """The reason why the robot refuses a command."""

    UNKNOWN_TYPE = 1
    WRONG_LENGTH = 2
    VALUE_OUT_OF_RANGE = 3
    LATCHED = 4


@dataclass(frozen=True, slots=True)
class Hello:
    """Request the robot's IDENT, and the version of the protocol; changes nothing else."""

    seq: int
    version: int = 1


@dataclass(frozen=True, slots=True)
class Pattern:
    """Fire the sensors of each mask in turn, one mask a step; without masks, stop firing."""

    seq: int
    step_period_ms: int
    window: int
    masks: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Listen:
    """In each step of the pattern, listen with the sensors of its mask without firing them; without masks, never."""

    seq: int
    masks: tuple[int, ...]


class Sweep(NamedTuple):
    """The scan of one servo: its bearings are first + k × step, k < bearings, one after each firing of its sensor."""

    sensor: int
    first: int
    step: int
    bearings: int
    endless: int
    """1: after the last bearing the first follows; 0: there and back."""


@dataclass(frozen=True, slots=True)
class Scan:
    """Let servos turn their sensors; from then on echoes come with bearings. A new PATTERN ends it."""

    seq: int
    sweeps: tuple[Sweep, ...]


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive at this velocity, and restart the deadman timer."""

    seq: int
    v_mm_s: int
    w_mrad_s: int


@dataclass(frozen=True, slots=True)
class Halt:
    """Stop at once and latch."""

    seq: int


@dataclass(frozen=True, slots=True)
class Release:
    """Clear the latch."""

    seq: int


@dataclass(frozen=True, slots=True)
class Ident:
    """The robot's description of itself, the answer to HELLO; the last two fields, µm and bits, in version 2."""

    seq: int
    version: int
    sensors: int
    ring_radius_mm: int
    deadman_ms: int
    odometry_period_ms: int
    boot_id: int
    name: str
    range_unit_um: int = 0
    capabilities: int = 0


@dataclass(frozen=True, slots=True)
class Ack:
    """The command with sequence number `of` was carried out."""

    seq: int
    of: int


@dataclass(frozen=True, slots=True)
class Nak:
    """The command with sequence number `of` was refused; `code` is a `NakCode`, or one unknown to this version."""

    seq: int
    of: int
    code: int


@dataclass(frozen=True, slots=True)
class Odom:
    """The base's pose and velocity by its own odometry, and its status."""

    seq: int
    t_us: int
    x_0p1mm: int
    y_0p1mm: int
    heading_1em4rad: int
    ring_yaw_1em4rad: int
    v_mm_s: int
    w_mrad_s: int
    flags: int
    last_drive_seq: int


@dataclass(frozen=True, slots=True)
class Echo:
    """The result of one firing: an echo byte for each bit of the mask, lowest sensor first."""

    seq: int
    t_us: int
    step: int
    mask: int
    tenths_ft: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Echo2:
    """The result of one firing in version 2, in counts of the ring's range unit.

    First come the fired sensors, then the listeners, each lowest sensor first. A listener's is half the whole path.
    """

    seq: int
    t_us: int
    step: int
    fired: int
    heard: int
    counts: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Echo3:
    """The result of one firing of a ring with servos: `Echo2` with the bearings of those fired sensors on servos.

    Counts are those of the fired sensors, bearings those of the `turned` among them, each lowest sensor first.
    """

    seq: int
    t_us: int
    step: int
    fired: int
    turned: int
    counts: tuple[int, ...]
    bearings: tuple[int, ...]


HostFrame: TypeAlias = Hello | Pattern | Listen | Scan | Drive | Halt | Release
RobotFrame: TypeAlias = Ident | Ack | Nak | Odom | Echo | Echo2 | Echo3
Frame: TypeAlias = HostFrame | RobotFrame
