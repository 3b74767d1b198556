"""The probability of all raw ranges at a pose, compared with ranges from anywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.robot import RingConfig
from perception.kernel import Floats

HEARD_PRIOR: Final = 0.5
"""Share of the sensors that hear something, at a place of which nothing is known."""
OUTLIERS: Final = 0.1
"""Share of the readings that are of something else than the map."""


@dataclass(frozen=True, slots=True)
class RangeModel:
    """Errors of a range: rounding and noise, drop-outs, and echoes of what the room does not have."""

    resolution_m: float
    """Step of the reported range, m; 0 = not rounded."""
    window_m: float
    """Greatest range, m."""
    noise_relative: float = 0.01
    """Standard deviation of the noise as a share of the range."""
    noise_m: float = 0.005
    """Standard deviation that does not depend on range, with the error of the map, m."""
    dropout: float = 0.07
    outliers: float = 0.05
    """Share of expected echoes that are not heard, and of readings that are anything."""

    @classmethod
    def of_ring(cls, ring: RingConfig) -> RangeModel:
        """Return the model with a ring's resolution and window."""
        return cls(ring.resolution_m, ring.window_m)

    def sigma(self, range_m: Floats) -> Floats:
        """Return the standard deviation at these ranges, m; at silence, that of the farthest range."""
        r = np.minimum(range_m, self.window_m)
        return np.sqrt(self.resolution_m**2 / 12.0 + self.noise_m**2 + (self.noise_relative * r) ** 2)

    def peak(self, sigma: Floats) -> Floats:
        """Return the density (1/m) of an echo exactly at its expected range, for these standard deviations (m)."""
        return (1.0 - self.dropout - self.outliers) / (sigma * math.sqrt(2.0 * math.pi))


def log_ratio(model: RangeModel, measured: Floats, expected: Floats) -> tuple[Floats, Floats]:
    """Return each reading's log likelihood ratio to a reading from anywhere (nat), and the probability that it fits.

    Parameters
    ----------
    model : RangeModel
        Errors.
    measured, expected : float
        Ranges, m, arrays of shapes that broadcast; inf for silence. An expected range beyond the window is silence.

    Returns
    -------
    (float, float)
        The log ratio; and the probability that a heard echo is the expected one (0 for silence): the weight in a fit.
    """
    heard, answers = np.isfinite(measured), expected <= model.window_m
    both = heard & answers
    sigma = model.sigma(expected)
    with np.errstate(invalid="ignore"):
        error = np.where(both, measured - expected, 0.0) / sigma
    fits = np.where(both, model.peak(sigma) * np.exp(-0.5 * error * error), 0.0)
    wild = model.outliers / model.window_m
    silent = np.where(answers, model.dropout, 1.0 - model.outliers) / (1.0 - HEARD_PRIOR)
    ratio = np.where(heard, (fits + wild) / (HEARD_PRIOR / model.window_m), silent)
    return np.log(ratio), fits / (fits + wild)


def log_ratio_of_true_pose(model: RangeModel, measured: Floats) -> tuple[float, float]:
    """Return mean and standard deviation (nat) of the summed `log_ratio` that a true pose has with these readings.

    Each reading is as expected, or with the probability of drop-outs and outliers it is not.

    Parameters
    ----------
    model : RangeModel
        Errors.
    measured : (n,) float
        Ranges, m; inf for silence.
    """
    heard = np.isfinite(measured)
    typical = model.peak(model.sigma(measured)) * math.exp(-0.5) + model.outliers / model.window_m
    good = np.where(heard, typical / (HEARD_PRIOR / model.window_m), (1.0 - model.outliers) / (1.0 - HEARD_PRIOR))
    bad = np.where(heard, model.outliers / HEARD_PRIOR, model.dropout / (1.0 - HEARD_PRIOR))
    rare = model.dropout + model.outliers
    mean = (1.0 - rare) * np.log(good) + rare * np.log(bad)
    variance = rare * (1.0 - rare) * (np.log(good) - np.log(bad)) ** 2
    return float(mean.sum()), math.sqrt(float(variance.sum()))
