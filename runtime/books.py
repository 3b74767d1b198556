"""The timing books: how long cycles took and how late they began, in memory that never grows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypedDict

import numpy as np

KEPT: Final = 65_536
"""Cycles over which quantiles are taken: 55 minutes at 20 Hz."""


class Quantiles(TypedDict):
    """Microseconds."""

    p50: float
    p99: float
    max: float


def worst_of(runs: Sequence[Quantiles]) -> Quantiles:
    """Return the largest of each figure over several runs."""
    return {
        "p50": max(run["p50"] for run in runs),
        "p99": max(run["p99"] for run in runs),
        "max": max(run["max"] for run in runs),
    }


class Books:
    """Durations and lateness of cycles.

    Parameters
    ----------
    late_after_s : float
        A cycle that begins later than this after its deadline is late.
    """

    def __init__(self, late_after_s: float) -> None:
        self._late_after_s = late_after_s
        # Written at once: pages of zeros would be taken from the system one by one while the robot drives.
        self._took_s = np.full(KEPT, 0.0)
        self._lag_s = np.full(KEPT, 0.0)
        self._worst_s = 0.0
        self._worst_lag_s = 0.0
        self.cycles = 0
        self.late = 0
        self.total_s = 0.0
        """All cycles together."""

    def enter(self, took_s: float, lag_s: float = 0.0) -> None:
        """Book one cycle: how long it took and how long after its deadline it began."""
        self._took_s[self.cycles % KEPT] = took_s
        self._lag_s[self.cycles % KEPT] = lag_s
        self._worst_s = max(self._worst_s, took_s)
        self._worst_lag_s = max(self._worst_lag_s, lag_s)
        self.total_s += took_s
        self.cycles += 1
        self.late += lag_s > self._late_after_s

    def cycle_us(self) -> Quantiles:
        """Return how long cycles took."""
        return self._quantiles(self._took_s, self._worst_s)

    def lag_us(self) -> Quantiles:
        """Return how long after their deadlines cycles began."""
        return self._quantiles(self._lag_s, self._worst_lag_s)

    def _quantiles(self, values_s: np.typing.NDArray[np.float64], worst_s: float) -> Quantiles:
        if not self.cycles:
            return {"p50": 0.0, "p99": 0.0, "max": 0.0}
        p50, p99 = 1e6 * np.quantile(values_s[: min(self.cycles, KEPT)], [0.5, 0.99])
        return {"p50": round(float(p50), 1), "p99": round(float(p99), 1), "max": round(1e6 * worst_s, 1)}
