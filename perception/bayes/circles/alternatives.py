"""Alternative explanations of the readings of a circle track, each fitted with its own best pose.

Explanations can be compared only on the same readings. One that was fitted to other readings would win or lose by
readings that it was not scored on. Each is heard as the scratch says (`perception.bayes.inference.beam`), whose log
prior counts.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.inference.range_fit import Circle, fit_circle, fit_reading_line, score_circle, score_line
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.parameters import FIT_SOFTNESS
from perception.bayes.memory.scratch import Predictions
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.kernel import kernel
from perception.records import Records

HOPELESS_NAT: Final = -1e9
"""Evidence (nat) of an explanation that cannot be fitted."""


@kernel
def bearing_if_near(
    q: Reading, j: int, predicted: Predictions, cx: float, cy: float, gate: float
) -> tuple[float, float]:  # fmt: skip
    """Return the unit direction from a sensor to a circle's centre; zeros if its reading ends elsewhere.

    Parameters
    ----------
    q, j : Reading, int
        The reading, and which it is.
    predicted, cx, cy, gate
        As for `mean_bearing`.
    """
    d = predicted.distance[j]
    if abs(predicted.error[j]) < gate and d > 0.0:
        return (cx - q.x) / d, (cy - q.y) / d
    return 0.0, 0.0


@kernel
def mean_bearing(
    readings: Records[Reading], predicted: Predictions, cx: float, cy: float, gate: float
) -> tuple[float, float]:  # fmt: skip
    """Return the mean unit direction from the sensors that hear a circle to its centre; zeros without such a sensor.

    Parameters
    ----------
    readings : (n,) Reading
        Raw ranges.
    predicted : Predictions
        What the circle predicts of them.
    cx, cy, gate : float
        The circle's centre, and the greatest distance of a reading's end from it, m.
    """
    sx = 0.0
    sy = 0.0
    for j in range(len(readings)):
        ux, uy = bearing_if_near(readings[j], j, predicted, cx, cy, gate)
        sx += ux
        sy += uy
    m = math.hypot(sx, sy)
    if m == 0.0:
        return 0.0, 0.0
    return sx / m, sy / m


@kernel
def score(s: StateRecord, p: SettingsRecord, n: int, x: float, y: float, radius: float) -> float:
    """Return the log likelihood ratio (nat) of a circle to the background, on the first `n` readings of the scratch.

    Writes the scratch's `score` and `predicted`.

    Parameters
    ----------
    s, p
        Memory and settings.
    n : int
        Readings.
    x, y, radius : float
        The circle, m.
    """
    scratch = s[0].scratch
    score_circle(scratch.readings[:n], x, y, radius, p, s[0].noise_level, scratch.predicted, scratch.score)
    return scratch.score.log_likelihood_ratio


@kernel
def fit_other_circle(
    s: StateRecord,
    p: SettingsRecord,
    n: int,
    circle: Circle,
    bearing: tuple[float, float],
    other: float,
    steps: int,
) -> float:
    """Return the log ratio (nat) of a circle of another radius on the same surface.

    Writes the scratch's `circle_fit`, and what `score` writes.

    Parameters
    ----------
    s, p, n
        As for `score`.
    circle : Circle
        The known circle.
    bearing : (float, float)
        Mean bearing of its readings, as of `mean_bearing`.
    other : float
        The other radius, m.
    steps : int
        Steps of the fit.
    """
    scratch = s[0].scratch
    readings = scratch.readings[:n]
    cx, cy, radius = circle
    ux, uy = bearing
    if ux == 0.0 and uy == 0.0:
        return HOPELESS_NAT
    noise = noise_variance(s, p)
    k = other - radius
    start = (cx + k * ux, cy + k * uy, other)
    if not fit_circle(readings, start, p, FIT_SOFTNESS, noise, steps, scratch.predicted, scratch.circle_fit):
        return HOPELESS_NAT
    return score(s, p, n, scratch.circle_fit.x, scratch.circle_fit.y, other)


@kernel
def fit_other_line(
    s: StateRecord, p: SettingsRecord, n: int, circle: Circle, bearing: tuple[float, float], steps: int
) -> float:
    """Return the log ratio (nat) of a line along the same surface; write the scratch's `line_fit` about the centre.

    Parameters
    ----------
    s, p, n, circle, bearing, steps
        As for `fit_other_circle`.
    """
    scratch = s[0].scratch
    readings = scratch.readings[:n]
    cx, cy, radius = circle
    ux, uy = bearing
    if ux == 0.0 and uy == 0.0:
        return HOPELESS_NAT
    fit_reading_line(
        readings,
        (ux, uy, -radius),
        (cx, cy),
        (p[0].cos_may_answer, p[0].gate_m),
        FIT_SOFTNESS,
        noise_variance(s, p),
        steps,
        scratch.line_fit,
    )
    score_line(readings, scratch.line_fit, cx, cy, p, s[0].noise_level, scratch.line_score)
    return scratch.line_score.log_likelihood_ratio
