"""The probability of a range in a room of which it is not known how it reflects: a mixture of both models.

Rough surfaces answer from the nearest point in the beam (`cone`), smooth ones from the foot of the perpendicular
(`specular`). Most rooms have both. Each reading is from one model with a probability that is learned on the way.
"""

from __future__ import annotations

import math

from perception.kernel import kernel
from perception.localization.range_likelihood import HEARD_SHARE
from perception.localization.surroundings import SensorModel
from perception.records import Records


@kernel
def range_variance(sensor: Records[SensorModel], range_m: float) -> float:
    """Return the variance of a range, m²; at silence, that of the farthest range."""
    r = min(range_m, sensor[0].window_m) * sensor[0].noise_relative
    return sensor[0].variance + r * r


@kernel
def range_density(
    sensor: Records[SensorModel], measured: float, expected: float, variance: float
) -> tuple[float, float]:  # fmt: skip
    """Return the density (1/m) of a reading by one model, or its probability for silence, and the echo's part of it.

    Parameters
    ----------
    sensor : (1,) SensorModel
        Errors of a range.
    measured, expected : float
        Ranges, m; inf for silence. An expected range beyond the window is silence.
    variance : float
        Of the expected range, from the pose's, m².
    """
    model = sensor[0]
    answers = expected <= model.window_m
    if measured == math.inf:
        return (model.dropout if answers else 1.0 - model.outliers), 0.0
    echo = 0.0
    if answers:
        total = range_variance(sensor, expected) + variance
        error = measured - expected
        peak = (1.0 - model.dropout - model.outliers) / math.sqrt(2.0 * math.pi * total)
        echo = peak * math.exp(-0.5 * error * error / total)
    return echo + model.outliers / model.window_m, echo


@kernel
def mixed_ratio(
    sensor: Records[SensorModel], measured: float, cone_m: float, cone_variance: float, specular_m: float,
    specular_variance: float, specular_share: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return how well a reading fits.

    Parameters
    ----------
    sensor : (1,) SensorModel
        Errors of a range.
    measured : float
        Range, m; inf for silence.
    cone_m, specular_m : float
        Expected by either model, m; inf for silence.
    cone_variance, specular_variance : float
        Of the expected ranges, from the pose's, m².
    specular_share : float
        Probability that a reading is from the specular model.

    Returns
    -------
    tuple of float
        Log likelihood ratio to a reading from anywhere, nat; probabilities that the echo is the one that `cone`
        expects, and the one that `specular` expects, 0 for silence; and that the reading, silence too, is from the
        specular model.
    """
    cone, cone_echo = range_density(sensor, measured, cone_m, cone_variance)
    specular, specular_echo = range_density(sensor, measured, specular_m, specular_variance)
    total = (1.0 - specular_share) * cone + specular_share * specular
    anywhere = 1.0 - HEARD_SHARE if measured == math.inf else HEARD_SHARE / sensor[0].window_m
    return (
        math.log(total / anywhere), (1.0 - specular_share) * cone_echo / total,
        specular_share * specular_echo / total, specular_share * specular / total,
    )  # fmt: skip
