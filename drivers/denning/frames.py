"""The frames of the ring-and-base protocol as typed values, in the units the wire speaks.

Millimetres, tenths of a foot and microseconds stop here: only this folder and the emulator's device side know them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

VERSION = 1
"""The version of the protocol that is spoken here."""
SENSORS_MAX = 24
"""Sensors that a mask has bits for."""
MASKS_MAX = 24
"""Steps that a pattern can hold."""
WINDOW_MIN, WINDOW_MAX = 5, 255
"""Tenths of a foot a firing can listen for."""
TENTHS_MIN, TENTHS_MAX = 5, 254
"""Echo bytes that are ranges, in tenths of a foot."""
NO_ECHO = 255
"""The echo byte of a sensor that heard nothing inside the window."""
FAULT = 0
"""The echo byte of a sensor that reports a fault."""
TENTH_FT_M = 0.03048
"""A tenth of a foot in metres."""


class NakCode(IntEnum):
    """Why the robot refuses a command."""

    UNKNOWN_TYPE = 1
    WRONG_LENGTH = 2
    VALUE_OUT_OF_RANGE = 3
    LATCHED = 4


@dataclass(frozen=True, slots=True)
class Hello:
    """Ask the robot who it is; changes nothing."""

    seq: int
    version: int = VERSION


@dataclass(frozen=True, slots=True)
class Pattern:
    """Fire these masks in turn, one each step; no masks stop the firing."""

    seq: int
    step_period_ms: int
    window: int
    masks: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive at this velocity; re-arms the deadman."""

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
    """The robot's answer to Hello."""

    seq: int
    version: int
    sensors: int
    ring_radius_mm: int
    deadman_ms: int
    odometry_period_ms: int
    boot_id: int
    name: str


@dataclass(frozen=True, slots=True)
class Ack:
    """The command with sequence number `of` is done."""

    seq: int
    of: int


@dataclass(frozen=True, slots=True)
class Nak:
    """The command with sequence number `of` is refused; `code` is a `NakCode`, or one this version does not know."""

    seq: int
    of: int
    code: int


@dataclass(frozen=True, slots=True)
class Odom:
    """Where the base believes it is, and how it is."""

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
    """What one firing heard: an echo byte for each bit of the mask, lowest sensor first."""

    seq: int
    t_us: int
    step: int
    mask: int
    tenths_ft: tuple[int, ...]


HostFrame: TypeAlias = Hello | Pattern | Drive | Halt | Release
RobotFrame: TypeAlias = Ident | Ack | Nak | Odom | Echo
Frame: TypeAlias = HostFrame | RobotFrame
