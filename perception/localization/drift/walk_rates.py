"""How fast a value wanders by odometry: a bank of scalar filters, each of which assumes another rate.

What a filter makes of a way is one measurement of the value, with the variance that its own variance shows. Each
filter of the bank enters that; a rate is as probable as the measurements are by its filter (D. T. Magill, "Optimal
adaptive estimation of sampled stochastic processes", 1965). So the first metres do not need a rate that is right.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from perception.bounds import FINITE, POSITIVE, bounds
from perception.kernel import Floats

FORGETTING: Final = 0.01
"""Share by which each measurement lets the rates be doubted again: the floor may change."""
LEAST_GAIN: Final = 1e-4
"""A way that adds less knowledge than this share says nothing."""


class WalkRates:
    """The bank.

    Parameters
    ----------
    rates : (n,) float
        Variances per metre, ascending.
    prior : (n,) float
        Their probabilities before anything is known.

    Attributes
    ----------
    rate : float
        The mean of the rates.
    """

    SCRATCH: Final = ("_rates", "_prior")
    """Constants, left out of snapshots."""
    BOUNDS: Final = bounds(_logs=FINITE, _means=FINITE, _variances=POSITIVE, rate=POSITIVE)

    def __init__(self, rates: Floats, prior: Floats) -> None:
        self._rates, self._prior = rates, np.log(prior / np.sum(prior))
        self._logs, self._means, self._variances = (np.zeros(len(rates)) for _ in range(3))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._logs[:] = self._prior
        self.restart(0.0)
        self.rate = float(np.exp(self._logs) @ self._rates)

    def assume(self, other: WalkRates) -> None:
        """Take the rates' probabilities from another bank of the same rates."""
        self._logs[:] = other._logs
        self.restart(0.0)
        self.rate = other.rate

    def restart(self, variance: float) -> None:
        """Keep the probabilities, but begin with a value of this variance, which is the same for every rate."""
        self._means[:] = 0.0
        self._variances[:] = variance

    def enter(self, correction: float, before: float, after: float, way: float) -> None:
        """Enter what the main filter, which assumes `rate`, made of a way.

        Parameters
        ----------
        correction : float
            The sum of its corrections of the value.
        before, after : float
            Its variance of the value at the way's begin and end.
        way : float
            m.
        """
        predicted = before + self.rate * way
        self._variances += self._rates * way
        if 0.0 < after < (1.0 - LEAST_GAIN) * predicted:
            gain = 1.0 - after / predicted
            innovations = correction / gain - self._means
            totals = self._variances + after / gain
            self._logs += FORGETTING * (self._prior - self._logs)
            self._logs -= 0.5 * (np.log(totals) + innovations * innovations / totals)
            shares = self._variances / totals
            self._means += shares * innovations
            self._variances *= 1.0 - shares
            self._logs -= np.max(self._logs)
            weights = np.exp(self._logs)
            self._logs -= np.log(np.sum(weights))
            self.rate = float(weights @ self._rates / np.sum(weights))
        self._means -= correction  # the main filter has corrected the value: what is left of it
