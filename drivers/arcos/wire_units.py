"""Conversion between SI and the protocol's commands: velocities, limits, firing patterns, the base's status."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from config.families.arcos import DISCS_MAX
from config.robot import BodyConfig, RobotConfig
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import ConfigPacket, Sip, SipFlags
from drivers.arcos.sonar import DISCS_PER_ARRAY
from drivers.driver import DriverError
from drivers.firing_pattern import FiringError, FiringPattern, firing_pattern, sensors
from drivers.messages import Flags, Twist

CYCLE_MIN_MS, CYCLE_MAX_MS = 2, 120
"""Shortest and longest sonar cycle."""
_STEPS_MAX: Final = 16
"""Longest polling sequence of an array."""
RANGE_UNIT_M: Final = 1e-3
"""Step of the ranges in an information packet, m."""
STOP_S: Final = 0.25
"""Duration of a stop from full speed, s, as far as the robot allows it."""
_ROUNDING: Final = 1e-6
"""Slack for decimal fractions that float64 cannot hold, ms."""
_BUMPERS, _STALLED = 0xFE, 0x01
"""Bits of a stall byte."""


class Polling(NamedTuple):
    """A firing pattern as the robot carries it out."""

    cycle_ms: int
    sequence: bytes
    """Disc numbers from 1; those of an array are fired in this order, all arrays in parallel."""
    window_m: float

    @property
    def commands(self) -> tuple[Command, ...]:
        """The commands that set it."""
        return Command(CommandNumber.SONARCYCLE, self.cycle_ms), Command(CommandNumber.POLLING, self.sequence)

    @property
    def arrays(self) -> SipFlags:
        """The flags of the arrays that must be switched on."""
        return SipFlags(sum({SipFlags.SONAR_1 << (disc - 1) // DISCS_PER_ARRAY for disc in self.sequence}))


def discs_of(config: RobotConfig) -> tuple[int, ...]:
    """Return the robot's number of each sensor of the ring.

    Raises
    ------
    DriverError
        There are more or fewer of them than sensors, or one twice.
    """
    count, discs = len(config.ring.mounts), config.arcos.discs
    if discs is None:
        discs = tuple(range(count))
    if len(discs) != count or len(set(discs)) != count or count > DISCS_MAX:
        raise DriverError(
            f"arcos.discs: {len(set(discs))} different numbers for the {count} sensors of the ring, and this robot "
            f"has at most {DISCS_MAX}; give each sensor the number of its disc, counted from 0"
        )
    return discs


def polling_of(config: RobotConfig, discs: tuple[int, ...]) -> Polling:
    """Return the ring's firing pattern as a polling sequence.

    Raises
    ------
    FiringError
        The ring cannot carry out the pattern, or the robot: each array fires one disc at a time, all in parallel.
    """
    pattern = firing_pattern(config.ring)
    steps = [tuple(discs[sensor] for sensor in sensors(mask)) for mask in pattern.masks]
    _check_arrays(steps)
    if len(steps) > _STEPS_MAX:
        raise FiringError(
            f"ring.firing: {len(steps)} firings before the pattern repeats, and an array of this robot holds "
            f"{_STEPS_MAX}; use fewer sets or rotations"
        )
    return Polling(_cycle_ms(pattern), bytes(disc + 1 for step in steps for disc in step), pattern.window_m)


def _check_arrays(steps: list[tuple[int, ...]]) -> None:
    """Check that each firing has one disc of each array, all of the same arrays.

    Raises
    ------
    FiringError
        One does not.
    """
    arrays = [sorted(disc // DISCS_PER_ARRAY for disc in step) for step in steps]
    if any(step != arrays[0] or len(set(step)) != len(step) for step in arrays):
        raise FiringError(
            f"ring.firing: this robot fires one sensor of each array of {DISCS_PER_ARRAY} at a time, all arrays "
            f"together; name one sensor of each array in every set, or choose the preset that fires as many sensors "
            f"at a time as there are arrays: single, opposite_pairs, thirds or quadrants"
        )


def _cycle_ms(pattern: FiringPattern) -> int:
    """Return the time from one firing to the next as the robot counts it.

    Raises
    ------
    FiringError
        It is too short or too long for the robot.
    """
    cycle_ms = math.ceil(1e3 * pattern.step_period_s - _ROUNDING)
    if not CYCLE_MIN_MS <= cycle_ms <= CYCLE_MAX_MS:
        raise FiringError(
            f"ring.firing: step_period_s {pattern.step_period_s:g}, and this robot's sonar cycle is "
            f"{1e-3 * CYCLE_MIN_MS:g} to {1e-3 * CYCLE_MAX_MS:g} s; change it, or shorten window_m with it"
        )
    return cycle_ms


class Limits(NamedTuple):
    """Greatest speeds, mm/s and degrees/s."""

    speed: int
    turn: int


def limits_of(body: BodyConfig, config: ConfigPacket | None) -> Limits:
    """Return the speeds that both the robot file and the robot allow, rounded down; the latter where it is known."""
    speed, turn = math.floor(1e3 * body.speed_max_m_s), math.floor(math.degrees(body.turn_max_rad_s))
    if config is not None:
        speed = min([speed, *(limit for limit in (config.speed_top, config.speed_max) if limit)])
        turn = min([turn, *(limit for limit in (config.turn_top, config.turn_max) if limit)])
    return Limits(speed, turn)


def limit_commands(body: BodyConfig, config: ConfigPacket | None, limits: Limits) -> tuple[Command, ...]:
    """Return the commands that set the base's speeds and accelerations to those of the robot file.

    The decelerations are so high that the base stands soon after its watchdog has stopped it.
    """
    up, turn_up = 1e3 * body.acceleration_max_m_s2, math.degrees(body.turn_acceleration_max_rad_s2)
    top = (config and config.acceleration_top) or math.inf
    turn_top = (config and config.turn_acceleration_top) or math.inf
    down, turn_down = max(up, limits.speed / STOP_S), max(turn_up, limits.turn / STOP_S)
    return (
        Command(CommandNumber.SETV, limits.speed),
        Command(CommandNumber.SETA, _ramp(up, top)),
        Command(CommandNumber.SETA, -_ramp(down, top)),
        Command(CommandNumber.SETRV, limits.turn),
        Command(CommandNumber.SETRA, _ramp(turn_up, turn_top)),
        Command(CommandNumber.SETRA, -_ramp(turn_down, turn_top)),
    )


def _ramp(rate: float, top: float) -> int:
    return max(1, round(min(rate, top)))


def drive_commands(twist: Twist, limits: Limits) -> tuple[Command, Command]:
    """Return the commands of a velocity within `limits`."""
    v = max(-limits.speed, min(limits.speed, 1e3 * twist.v))
    w = max(-limits.turn, min(limits.turn, math.degrees(twist.w)))
    return Command(CommandNumber.VEL, round(v)), Command(CommandNumber.RVEL, round(w))


def flags_of(sip: Sip, low_battery: int) -> Flags:
    """Return the base's status; `low_battery` is the voltage, 0.1 V, below which the battery counts as low.

    A robot that reports 0 V runs on a battery that it does not measure: that counts as low, too.
    Motors that are off, for whatever reason, are the latch of this base: it moves again only when they are enabled.
    """
    flags = Flags.NONE
    status = SipFlags(sip.flags)
    if not status & SipFlags.MOTORS_ENABLED or status & (SipFlags.STOP_BUTTON | SipFlags.E_STALL):
        flags |= Flags.LATCHED
    if (sip.stall_left | sip.stall_right) & _BUMPERS:
        flags |= Flags.BUMPER
    if (sip.stall_left | sip.stall_right) & _STALLED:
        flags |= Flags.MOTOR_FAULT
    if (sip.battery_10 or sip.battery) < max(1, low_battery):
        flags |= Flags.BATTERY_LOW
    return flags
