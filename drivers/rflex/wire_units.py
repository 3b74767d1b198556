"""Conversion between SI and the controller's units: velocities, sonar ids, firing patterns."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from config.families.rflex import BANKS_MAX
from config.robot import RingConfig, RobotConfig
from drivers.driver import DriverError
from drivers.firing_pattern import FiringError, firing_pattern
from drivers.messages import Twist
from drivers.rflex.codec import ROTATION, TRANSLATION, Frame, set_direction, sonar_run

STOP_S: Final = 0.25
"""Duration of a stop from full speed, s."""
_TORQUES: Final = (30000, 35000)
"""Torque of each axis that all known clients send."""
_ESC: Final = 0x1B
_ROUNDING: Final = 1e-6


class SonarPattern(NamedTuple):
    """A firing pattern as the controller carries it out."""

    step_us: int
    ping_us: int
    window_m: float

    @property
    def command(self) -> Frame:
        """The command that starts it."""
        return sonar_run(self.step_us - self.ping_us, self.ping_us)


def sonar_ids(config: RobotConfig) -> tuple[int, ...]:
    """Return the id of each sensor of the ring.

    Raises
    ------
    DriverError
        The banks hold more or fewer sonars than the ring, or there are too many banks.
    """
    rflex, count = config.rflex, len(config.ring.mounts)
    if sum(rflex.banks) != count or rflex.first_bank + len(rflex.banks) > BANKS_MAX:
        raise DriverError(
            f"rflex.banks: {len(rflex.banks)} banks from number {rflex.first_bank} on with {sum(rflex.banks)} sonars "
            f"for the {count} sensors of the ring, and a controller has at most {BANKS_MAX} banks; give the number "
            f"of sonars of each bank"
        )
    return tuple(
        BANKS_MAX * (rflex.first_bank + bank) + index
        for bank, size in enumerate(rflex.banks)
        for index in range(size)
    )


def pattern_of(config: RobotConfig, ring: RingConfig) -> SonarPattern:
    """Return the firing pattern of a ring as delays of the controller.

    Raises
    ------
    FiringError
        The ring cannot carry out the pattern, or the controller: it fires one sonar of each bank at a time, in order.
    """
    pattern = firing_pattern(ring)
    ids = sonar_ids(config)
    by_itself = {
        sum(1 << sensor for sensor, one in enumerate(ids) if one % BANKS_MAX == index)
        for index in range(max(config.rflex.banks))
    }
    if set(pattern.masks) != by_itself or len(pattern.masks) != len(by_itself):
        sets = [[sensor for sensor, one in enumerate(ids) if one % BANKS_MAX == k] for k in range(len(by_itself))]
        raise FiringError(
            f"ring.firing: this controller fires by itself, one sonar of each bank at a time; only step_period_s and "
            f"window_m can be chosen: set sets = {sets}"
        )
    step_us, ping_us = math.ceil(1e6 * pattern.step_period_s - _ROUNDING), config.rflex.ping_delay_us
    if step_us <= ping_us:
        raise FiringError(
            f"ring.firing: step_period_s {pattern.step_period_s:g} leaves no time to listen after the ping delay of "
            f"{ping_us} µs; make it longer"
        )
    return SonarPattern(step_us, ping_us, pattern.window_m)


def without_escape(speed: int) -> int:
    """Return the nearest smaller speed, counts per second, of which no byte is ESC.

    Known clients avoid it: a controller that removes escapes would obey another speed.
    """
    size = abs(speed)
    for byte in (2, 1, 0):
        if size >> 8 * byte & 0xFF == _ESC:
            size = (size >> 8 * byte) * (1 << 8 * byte) - 1
    return size if speed >= 0 else -size


def drive_commands(twist: Twist, config: RobotConfig) -> tuple[Frame, Frame]:
    """Return the commands of a velocity, clamped to the body's limits.

    Some hardware ignores a translation of 0, and drives on: it is sent as the least speed, some 10 µm/s.
    """
    body, rflex = config.body, config.rflex
    v = _counts(twist.v, body.speed_max_m_s, rflex.distance_factor) or 1
    w = _counts(twist.w, body.turn_max_rad_s, rflex.angle_factor)
    rate = _rate(body.acceleration_max_m_s2, rflex.distance_factor)
    turn_rate = _rate(body.turn_acceleration_max_rad_s2, rflex.angle_factor)
    return (
        set_direction(TRANSLATION, v, rate, _TORQUES[0]),
        set_direction(ROTATION, w, turn_rate, _TORQUES[1]),
    )


def stop_commands(config: RobotConfig, translation: int) -> tuple[Frame, Frame]:
    """Return the commands of a stop within `STOP_S`; `translation` is 0, or 1 for hardware that ignores 0."""
    body, rflex = config.body, config.rflex
    rate = _rate(max(body.acceleration_max_m_s2, body.speed_max_m_s / STOP_S), rflex.distance_factor)
    turn_rate = _rate(max(body.turn_acceleration_max_rad_s2, body.turn_max_rad_s / STOP_S), rflex.angle_factor)
    return (
        set_direction(TRANSLATION, translation, rate, _TORQUES[0]),
        set_direction(ROTATION, 0, turn_rate, _TORQUES[1]),
    )


def _counts(value: float, limit: float, factor: float) -> int:
    most = math.floor(limit * factor + _ROUNDING)
    clamped = max(-limit, min(limit, value))
    return without_escape(max(-most, min(most, round(clamped * factor))))


def _rate(value: float, factor: float) -> int:
    return min(0xFFFFFFFF, abs(without_escape(round(value * factor))) or 1)
