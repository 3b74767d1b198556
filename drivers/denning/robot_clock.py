"""The robot's 32-bit microsecond counter, which wraps every 71.6 minutes, as a time that only grows."""

from __future__ import annotations

from enum import Enum

_WRAP = 1 << 32
_HALF = 1 << 31
_AHEAD_MAX_US = 1_000_000
"""How far the robot's clock may run ahead of the host's between two readings, by delays on the way, µs."""
_DRIFT = 1e-3
"""Greatest relative difference of the two clocks; that of two crystals is a tenth of it."""
_RATE_ERROR_MAX = 0.01
"""Relative difference beyond which a clock is wrong; ranges and speeds, measured by it, are off by as much."""
_DELAY_MAX_S = 1.0
"""Difference of the two clocks that delays on the way may explain, s."""
_RATE_SPAN_S = 60.0
"""Clocks are compared over this time or up to twice as much, s: a clock that is 5 % off is found within 26 s."""


class Jump(Enum):
    """The direction of a jump that neither delay nor wrap explains: the robot may have restarted."""

    BACK = "back"
    AHEAD = "ahead"


def _nearest(t_us: int, reference_us: int) -> int:
    """Return the time nearest to `reference_us` at which the counter shows `t_us`."""
    return reference_us + (t_us - reference_us + _HALF) % _WRAP - _HALF


class _ClockRate:
    """Compares the speed of the robot's clock with that of the run's, since a reading up to two minutes ago."""

    def __init__(self, t_us: int, run_s: float) -> None:
        self._since = self._next = (t_us, run_s)

    def error(self, t_us: int, run_s: float) -> float | None:
        """Return the relative error of the robot's clock, None while it is explained by delays; then start anew."""
        passed_s = run_s - self._since[1]
        ahead_s = 1e-6 * (t_us - self._since[0]) - passed_s
        if abs(ahead_s) > _DELAY_MAX_S + _RATE_ERROR_MAX * passed_s:
            self._since = self._next = (t_us, run_s)
            return ahead_s / max(passed_s, 1e-3)
        if run_s - self._next[1] > _RATE_SPAN_S:
            self._since, self._next = self._next, (t_us, run_s)
        return None


class RobotClock:
    """Unwraps the counter with the last reading and the run's time since then, so that it may be silent for long.

    Attributes
    ----------
    rate_error
        By how much the clock is too fast, or where negative too slow, as found by the last reading; None if nothing
        was found.
    """

    def __init__(self) -> None:
        self.rate_error: float | None = None
        self._rate: _ClockRate | None = None
        self._t_us: int | None = None
        self._read_s = 0.0
        self._trusting = False

    def read(self, t_us: int, run_s: float) -> int | Jump:
        """Return the unwrapped time of a reading that arrived at `run_s`, µs, or the direction in which it jumped.

        A reading that jumped is discarded; the next one is compared with the last good one.
        """
        t = t_us
        self.rate_error = None
        if self._t_us is not None:
            waited_us = round((run_s - self._read_s) * 1e6)
            expected = self._t_us + waited_us
            t = _nearest(t_us, expected)
            if t < self._t_us:
                return Jump.BACK
            if t - expected > _AHEAD_MAX_US + _DRIFT * waited_us and not self._trusting:
                return Jump.AHEAD
        if self._rate is None:
            self._rate = _ClockRate(t, run_s)
        self.rate_error = self._rate.error(t, run_s)
        self._t_us, self._read_s, self._trusting = t, run_s, False
        return t

    def near_last(self, t_us: int) -> int | None:
        """Return the time nearest to the last reading at which the counter shows `t_us`; None before the first."""
        return None if self._t_us is None else _nearest(t_us, self._t_us)

    def trust_next(self) -> None:
        """Accept the next reading however far ahead it is: the robot has confirmed that it did not restart."""
        self._trusting = True

    def break_off(self) -> None:
        """Compare the clocks from the next reading on: what lies between is unknown, as after the line was lost."""
        self._rate = self.rate_error = None

    def restart(self) -> None:
        """Discard all readings: the counter restarted at zero."""
        self._t_us = None
        self._trusting = False
        self.break_off()
