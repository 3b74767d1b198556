"""What a circle predicts of many readings, computed several at a time: half of a refinement's work."""

from __future__ import annotations

import math

from perception.bayes.cross_path import NEAREST_M, over_circle
from perception.bayes.elements import Reading
from perception.bayes.scratch import Predictions
from perception.kernel import kernel, loop_kernel
from perception.records import Records


@loop_kernel
def has_cross_path(readings: Records[Reading]) -> bool:
    """Return whether there is a cross path among readings."""
    crossed = 0
    for j in range(len(readings)):
        crossed += readings[j].listener_x != 0.0 or readings[j].listener_y != 0.0
    return crossed > 0


@loop_kernel
def predict_echoes(readings: Records[Reading], x: float, y: float, radius: float, out: Predictions) -> None:
    """Write what a circle predicts of readings among which there is no cross path; see `predict_circle`."""
    for j in range(len(readings)):
        q = readings[j]
        dx = x - q.x
        dy = y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        per_d = 1.0 / max(d, NEAREST_M)
        out.error[j] = q.range_m - (d - radius)
        out.slope_x[j] = dx * per_d
        out.slope_y[j] = dy * per_d
        out.distance[j] = d
        out.ahead[j] = dx * q.axis_x + dy * q.axis_y


@loop_kernel
def predict_any(readings: Records[Reading], x: float, y: float, radius: float, out: Predictions) -> None:
    """Write what a circle predicts of readings; see `predict_circle`.

    Both ways are computed for each reading, and one is taken: without a branch, and with a number of passes that the
    compiler can bound, a processor takes eight in the time of one or two.
    """
    for j in range(len(readings)):
        q = readings[j]
        dx = x - q.x
        dy = y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        half, slope_x, slope_y = over_circle(q, dx, dy, radius)
        is_echo = q.listener_x == 0.0 and q.listener_y == 0.0
        per_d = 1.0 / max(d, NEAREST_M)
        out.error[j] = q.range_m - (d - radius if is_echo else half)
        out.slope_x[j] = dx * per_d if is_echo else slope_x
        out.slope_y[j] = dy * per_d if is_echo else slope_y
        out.distance[j] = d
        out.ahead[j] = dx * q.axis_x + dy * q.axis_y


@kernel
def predict_circle(readings: Records[Reading], x: float, y: float, radius: float, out: Predictions) -> None:
    """Write what a circle predicts of readings.

    Parameters
    ----------
    readings : (n,) Reading
        Raw ranges.
    x, y, radius : float
        Centre and radius, m.
    out : Predictions
        Its first n are written.
    """
    if has_cross_path(readings):
        predict_any(readings, x, y, radius, out)
    else:
        predict_echoes(readings, x, y, radius, out)
