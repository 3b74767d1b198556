"""The time at which a robot measured a SIP: SIPs carry no stamp, but come periodically.

A SIP arrives late, never early: behind other packets on the line, or because this process was held up. So its time is
at most that of its arrival, and at most one period after the SIP before. When all of the last SIPs came late, the
least late of them sets the clock: then SIPs were lost, or the robot's period is longer than nominal.
"""

from __future__ import annotations

from collections import deque
from typing import Final

_KEPT: Final = 5
"""SIPs of which the least late one counts: half a second."""
_LEAST_S: Final = 1e-3
"""Least time between two SIPs, s."""
_LOST: Final = 0.7
"""A SIP after a corrupt frame that is late by this share of a period follows one that was lost."""
_GAP_PERIODS: Final = 10.0
"""A SIP that is later than so many periods begins anew."""


class SipClock:
    """Smooths the arrival times of SIPs.

    `period_s` is their nominal interval.
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._read_s: float | None = None
        self._late_s: deque[float] = deque(maxlen=_KEPT)

    def restart(self) -> None:
        """Take the next arrival as it is."""
        self._read_s = None

    def read(self, arrived_s: float, *, after_loss: bool) -> float:
        """Return when a SIP was measured, later than the one before.

        `arrived_s` is its arrival, less the time that its bytes take. `after_loss`: a corrupt frame came since the
        SIP before.
        """
        before_s, self._read_s = self._read_s, arrived_s
        if before_s is None:
            self._late_s.clear()
            return arrived_s
        late_s = arrived_s - before_s - self.period_s
        if late_s > (_LOST * self.period_s if after_loss else _GAP_PERIODS * self.period_s):
            self._late_s.clear()
            return arrived_s
        self._late_s.append(late_s)
        time_s = before_s + self.period_s + min(0.0, late_s)
        if len(self._late_s) == _KEPT and (least_s := min(self._late_s)) > 0.0:
            time_s += least_s
            self._late_s = deque((late_s - least_s for late_s in self._late_s), _KEPT)
        self._read_s = max(time_s, before_s + _LEAST_S)
        return self._read_s
