"""The probability of ranges in a room of which it is not known how it reflects: a mixture of both models.

Rough surfaces answer from the nearest point in the beam (`cone`), smooth ones from the foot of the perpendicular
(`specular`). Most rooms have both. Each reading is from one model with a probability that is learned on the way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from perception.kernel import Floats
from perception.localization.expected_ranges import Beams, Expected, expected_ranges
from perception.localization.range_likelihood import HEARD_SHARE, RangeModel
from perception.localization.room import Room


class Expectations(NamedTuple):
    """What the sensors should read, by either model of reflection."""

    cone: Expected
    specular: Expected


class MixedRatio(NamedTuple):
    """How well readings fit, each an array of the sensors' shape."""

    log_ratio: Floats
    """Log likelihood ratio to a reading from anywhere, nat."""
    fits_cone: Floats
    """Probability that the echo is the one that `cone` expects, …"""
    fits_specular: Floats
    """… and the one that `specular` expects; 0 for silence."""
    prefers_specular: Floats
    """Probability that the reading, silence too, is from the specular model."""


def expect_both(room: Room, beams: Beams, half_angle: float) -> Expectations:
    """Return what sensors should read by both models; arguments as of `expected_ranges`."""
    return Expectations(
        expected_ranges(room, beams, half_angle, "cone"), expected_ranges(room, beams, half_angle, "specular")
    )


def mixed_ratio(
    model: RangeModel,
    measured: Floats,
    expected: Expectations,
    specular_share: float,
    variance: tuple[Floats, Floats],
) -> MixedRatio:
    """Return how well readings fit to what either model expects.

    Parameters
    ----------
    model : RangeModel
        Errors of a range.
    measured : (n,) float
        Ranges, m; inf for silence.
    expected : Expectations
        Arrays of shape (poses, n).
    specular_share : float
        Probability that a reading is from the specular model.
    variance : (float, float)
        Variance of the expected ranges of either model that comes from the pose, m²; of the same shape.
    """
    heard = np.isfinite(measured)
    wild = model.outliers / model.window_m
    likely, fits = [], []
    for one, extra, share in zip(expected, variance, (1.0 - specular_share, specular_share), strict=True):
        answers = one.range_m <= model.window_m
        sigma = np.sqrt(model.sigma(one.range_m) ** 2 + extra)
        with np.errstate(invalid="ignore"):
            error = np.where(heard & answers, measured - one.range_m, 0.0) / sigma
        echo = np.where(heard & answers, model.peak(sigma) * np.exp(-0.5 * error * error), 0.0)
        silent = np.where(answers, model.dropout, 1.0 - model.outliers)
        likely.append(share * np.where(heard, echo + wild, silent))
        fits.append(share * echo)
    total = likely[0] + likely[1]
    anywhere = np.where(heard, HEARD_SHARE / model.window_m, 1.0 - HEARD_SHARE)
    return MixedRatio(np.log(total / anywhere), fits[0] / total, fits[1] / total, likely[1] / total)
