"""Statistics of cycles in bounded memory: their durations, their lateness, and the causes of delays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypedDict

import numpy as np

KEPT_MAX: Final = 65_536
"""Newest values over which quantiles are taken: 55 minutes of cycles at 20 Hz."""

CAUSES_MAX: Final = 32
"""Most causes that are counted by name."""
OTHERS: Final = "others"
"""Name under which further causes are counted."""


class Quantiles(TypedDict):
    """Microseconds."""

    p50: float
    p99: float
    max: float


class Spread(Quantiles):
    """Microseconds, with the tail that a deadline is about."""

    p999: float


def worst_of(runs: Sequence[Quantiles]) -> Quantiles:
    """Return the largest of each figure over several runs."""
    return {
        "p50": max(run["p50"] for run in runs),
        "p99": max(run["p99"] for run in runs),
        "max": max(run["max"] for run in runs),
    }


class Series:
    """The newest `KEPT_MAX` of a series of times, and the largest and the sum of all.

    `is_touched`: allocate the memory now rather than page by page as it is used.
    """

    def __init__(self, *, is_touched: bool = False) -> None:
        self._values_s = np.full(KEPT_MAX, 0.0) if is_touched else np.zeros(KEPT_MAX)
        self.count = 0
        self.worst_s = 0.0
        self.total_s = 0.0

    def add(self, value_s: float) -> None:
        """Add a time, s."""
        self._values_s[self.count % KEPT_MAX] = value_s
        self.count += 1
        if value_s > self.worst_s:  # `max` would take longer, six times a cycle
            self.worst_s = value_s
        self.total_s += value_s

    @property
    def newest_s(self) -> float:
        """The last value added."""
        return float(self._values_s[(self.count - 1) % KEPT_MAX])

    def spread(self) -> Spread:
        """Return median, tail and maximum, µs."""
        if not self.count:
            return {"p50": 0.0, "p99": 0.0, "p999": 0.0, "max": 0.0}
        values = self._values_s[: min(self.count, KEPT_MAX)]
        p50, p99, p999 = (round(float(q), 1) for q in 1e6 * np.quantile(values, [0.5, 0.99, 0.999]))
        return {"p50": p50, "p99": p99, "p999": p999, "max": round(1e6 * self.worst_s, 1)}

    def quantiles(self) -> Quantiles:
        """Return median, 99th percentile and maximum, µs: the form of the public surface."""
        spread = self.spread()
        return {"p50": spread["p50"], "p99": spread["p99"], "max": spread["max"]}


class CycleStats:
    """Durations, lateness and causes of delay of a run's cycles.

    Parameters
    ----------
    late_after_s : float
        A cycle that begins later than this after its deadline is late.
    is_touched : bool
        Allocate all memory now.
    """

    def __init__(self, late_after_s: float, *, is_touched: bool = False) -> None:
        self.late_after_s = late_after_s
        self.took = Series(is_touched=is_touched)
        self.lag = Series(is_touched=is_touched)
        self.late = 0
        self.missed = 0
        """Cycles that were due and did not take place."""
        self.causes: dict[str, int] = {}
        """Late and overrun cycles by cause."""

    @property
    def cycles(self) -> int:
        """Number of cycles."""
        return self.took.count

    @property
    def total_s(self) -> float:
        """Duration of all cycles together, s."""
        return self.took.total_s

    def add_cycle(self, took_s: float, lag_s: float = 0.0) -> None:
        """Add one cycle: how long it took, and how long after its deadline it began, s."""
        self.took.add(took_s)
        self.lag.add(lag_s)
        self.late += lag_s > self.late_after_s

    def add_cause(self, cause: str) -> None:
        """Count what delayed a cycle, or made the one before it overrun."""
        is_known = cause in self.causes or len(self.causes) < CAUSES_MAX
        name = cause if is_known else OTHERS
        self.causes[name] = self.causes.get(name, 0) + 1

    def cycle_us(self) -> Quantiles:
        """Return how long cycles took, µs."""
        return self.took.quantiles()

    def lag_us(self) -> Quantiles:
        """Return how long after their deadlines cycles began, µs."""
        return self.lag.quantiles()
