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
_FIRST_DELAY_MAX_S = 3.0
"""Delay that the very first reading may have had on the way, s."""
_DELAY_MAX_S = 1.0
"""Delay that the least late reading of a period may have had, s."""
_FIRST_PERIOD_S, _PERIOD_S = 10.0, 60.0
"""Clocks are compared from one period to the next, s: a clock that is 5 % fast is found within 36 s."""


class Jump(Enum):
    """The direction of a jump that neither delay nor wrap explains: the robot may have restarted."""

    BACK = "back"
    AHEAD = "ahead"


def _nearest_time(t_us: int, reference_us: int) -> int:
    """Return the time nearest to `reference_us` at which the counter shows `t_us`."""
    return reference_us + (t_us - reference_us + _HALF) % _WRAP - _HALF


class _ClockRate:
    """Compares the speed of the robot's clock with that of the run's.

    A reading is late by its way, by seconds where this process was stopped. So the least late reading of a period is
    compared with that of the period before. What is gained on that one is no delay, but a fast clock; a slow clock
    loses in two periods in a row, while a robot that stood still for a moment loses in one.
    """

    def __init__(self, ahead_s: float, run_s: float) -> None:
        # The least late readings, of the period before and of this one: how far the clock is ahead, and when.
        self._before = self._least_late = (ahead_s, run_s)
        self._is_first, self._was_slow = True, False
        self._end_s = run_s + _FIRST_PERIOD_S

    def error(self, ahead_s: float, run_s: float) -> float | None:
        """Return the relative error of the robot's clock, `ahead_s` ahead of the run's now; None if it has none."""
        gained_s, passed_s = ahead_s - self._before[0], run_s - self._before[1]
        delay_max_s = _FIRST_DELAY_MAX_S if self._is_first else _DELAY_MAX_S
        if gained_s > delay_max_s + _RATE_ERROR_MAX * passed_s:
            return gained_s / max(passed_s, 1e-3)
        self._least_late = max(self._least_late, (ahead_s, run_s))
        return self._end_period(ahead_s, run_s) if run_s >= self._end_s else None

    def _end_period(self, ahead_s: float, run_s: float) -> float | None:
        """Begin another period, and return the error of the one that ends if it and the one before were slow."""
        was_slow, error = self._was_slow, 0.0
        if not self._is_first:
            passed_s = self._least_late[1] - self._before[1]
            error = (self._least_late[0] - self._before[0]) / max(passed_s, 1e-3)
            self._was_slow = error < -_RATE_ERROR_MAX
        self._before, self._least_late = self._least_late, (ahead_s, run_s)
        self._is_first, self._end_s = False, run_s + _PERIOD_S
        return error if was_slow and self._was_slow else None


class RobotClock:
    """Unwraps the counter with the last reading and the run's time since then, so that it may be silent for long."""

    def __init__(self) -> None:
        self.rate_error: float | None = None
        """By how much the clock is too fast, or where negative too slow, as found by the last reading; None if
        nothing was found."""
        self._rate: _ClockRate | None = None
        """None while the clocks are not compared."""
        self._t_us: int | None = None
        """The last reading, unwrapped; None before the first."""
        self._read_s = 0.0
        """When it came, by the run's clock."""
        self._trusting = False
        """Whether the next reading is accepted however far ahead."""

    def read(self, t_us: int, run_s: float) -> int | Jump:
        """Return the unwrapped time of a reading that arrived at `run_s`, µs, or the direction in which it jumped.

        A reading that jumped is discarded; the next one is compared with the last good one.
        """
        t = t_us
        self.rate_error = None
        if self._t_us is not None:
            waited_us = round((run_s - self._read_s) * 1e6)
            expected = self._t_us + waited_us
            t = _nearest_time(t_us, expected)
            if t < self._t_us:
                return Jump.BACK
            if t - expected > _AHEAD_MAX_US + _DRIFT * waited_us and not self._trusting:
                return Jump.AHEAD
        ahead_s = 1e-6 * t - run_s
        if self._rate is None:
            self._rate = _ClockRate(ahead_s, run_s)
        self.rate_error = self._rate.error(ahead_s, run_s)
        self._t_us, self._read_s, self._trusting = t, run_s, False
        return t

    def near_last(self, t_us: int) -> int | None:
        """Return the time nearest to the last reading at which the counter shows `t_us`; None before the first."""
        return None if self._t_us is None else _nearest_time(t_us, self._t_us)

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
