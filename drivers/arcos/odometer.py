"""The raw odometry of a SIP as a pose in SI: counters unwrapped, factors applied."""

from __future__ import annotations

import math
from typing import Final

from config.families.arcos import ArcosConfig
from drivers.arcos.frames import Sip
from drivers.messages import Flags, Odometry, Pose, Twist

_COUNTS: Final = 0x8000
"""Firmware counts 15 bits of the odometry; one simulator 16, which is the same modulo 15 bits."""
_HEADINGS: Final = 4096
"""Units of a turn; firmware reports them signed or unsigned."""
_NEAR_ZERO: Final = 20
"""Counts within which the odometry may be just after a restart: a centimetre or two, two degrees."""


def _difference(now: int, before: int, modulus: int) -> int:
    """Return the shortest way from one reading of a counter to another."""
    half = modulus // 2
    return (now - before + half) % modulus - half


class Odometer:
    """Continues the counters of one robot."""

    def __init__(self, config: ArcosConfig) -> None:
        self._config = config
        self._last: Sip | None = None
        self._x = self._y = self._heading = 0

    @staticmethod
    def is_near_zero(sip: Sip) -> bool:
        """Return whether the odometry of a SIP is zero or little more, as after a restart."""
        counts = ((sip.x, _COUNTS), (sip.y, _COUNTS), (sip.heading, _HEADINGS))
        return all(abs(_difference(count, 0, modulus)) <= _NEAR_ZERO for count, modulus in counts)

    @property
    def is_at_zero(self) -> bool:
        """Whether the last SIP was near zero; True before the first."""
        return self._last is None or self.is_near_zero(self._last)

    def restart(self) -> None:
        """Take the next SIP as the first."""
        self._last = None
        self._x = self._y = self._heading = 0

    def read(self, sip: Sip, robot_s: float, flags: Flags) -> Odometry:
        """Return the sample of a SIP; the first one starts where its counters stand.

        `robot_s` is when the robot measured it; flags are the base's.
        """
        before = (0, 0, 0) if self._last is None else (self._last.x, self._last.y, self._last.heading)
        self._last = sip
        self._x += _difference(sip.x, before[0], _COUNTS)
        self._y += _difference(sip.y, before[1], _COUNTS)
        self._heading += _difference(sip.heading, before[2], _HEADINGS)
        config = self._config
        heading = self._heading * (2.0 * math.pi / _HEADINGS)
        to_m = 1e-3 * config.distance_factor
        left, right = sip.left * config.velocity_factor, sip.right * config.velocity_factor
        twist = Twist(0.5e-3 * (left + right), 0.5 * (right - left) * config.turn_factor)
        return Odometry(robot_s, Pose(self._x * to_m, self._y * to_m, heading), heading, twist, flags, 0)
