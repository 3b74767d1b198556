"""The robot's microsecond counter, which wraps every 71.6 minutes, as a time that only grows."""

from __future__ import annotations

from enum import Enum

_WRAP = 1 << 32
_HALF = 1 << 31
_AHEAD_MAX_US = 1_000_000
"""So far may the robot's clock run ahead of the host's between two readings, by delays on the way."""
_DRIFT = 1e-3
"""And by so much of the time in between, by two crystals that differ."""


class Jump(Enum):
    """A reading that no delay and no wrap explains: the robot may have restarted."""

    BACK = "back"
    AHEAD = "ahead"


def _nearest(t_us: int, reference_us: int) -> int:
    """Return the time nearest to `reference_us` that the counter shows as `t_us`: the half-range rule."""
    return reference_us + (t_us - reference_us + _HALF) % _WRAP - _HALF


class RobotClock:
    """Unwraps the counter by the last reading and the host's time since, so that a long silence does no harm."""

    def __init__(self) -> None:
        self._t_us: int | None = None
        self._now_s = 0.0
        self._trusting = False

    def read(self, t_us: int, now_s: float) -> int | Jump:
        """Return the unwrapped time of a reading that has just come, or in which direction it jumped.

        A reading that jumped is not kept; the next one is measured against the last good one.
        """
        t = t_us
        if self._t_us is not None:
            waited_us = round((now_s - self._now_s) * 1e6)
            expected = self._t_us + waited_us
            t = _nearest(t_us, expected)
            if t < self._t_us:
                return Jump.BACK
            if t - expected > _AHEAD_MAX_US + _DRIFT * waited_us and not self._trusting:
                return Jump.AHEAD
        self._t_us, self._now_s, self._trusting = t, now_s, False
        return t

    def past(self, t_us: int) -> int | None:
        """Return the unwrapped time of a moment near the last reading; None before the first."""
        return None if self._t_us is None else _nearest(t_us, self._t_us)

    def trust_next(self) -> None:
        """Let the next reading lie ahead as far as it likes: the robot has been asked and did not restart."""
        self._trusting = True

    def restart(self) -> None:
        """Forget everything: the counter began again at zero."""
        self._t_us = None
        self._trusting = False
