"""What a circle predicts of many readings, computed several at a time: half of a refinement's work."""

from __future__ import annotations

import math

from perception.bayes.inference.beam import ray_over_circle
from perception.bayes.inference.cross_path import LENGTH_MIN_M, over_circle
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.scratch import Predictions
from perception.kernel import Floats, kernel, loop_kernel
from perception.records import Records


@loop_kernel
def leading_echoes(readings: Records[Reading]) -> int:
    """Return how many readings come before the first cross path."""
    leading = len(readings)
    for j in range(len(readings)):
        is_crossed = readings[j].listener_x != 0.0 or readings[j].listener_y != 0.0
        leading = min(leading, j if is_crossed else len(readings))
    return leading


@loop_kernel
def predict_echoes(readings: Records[Reading], x: float, y: float, radius: float, out: Predictions) -> None:
    """Write what a circle predicts of readings among which there is no cross path; see `predict_circle`."""
    for j in range(len(readings)):
        q = readings[j]
        dx = x - q.x
        dy = y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        per_d = 1.0 / max(d, LENGTH_MIN_M)
        out.error[j] = q.range_m - (d - radius)
        out.slope_x[j] = dx * per_d
        out.slope_y[j] = dy * per_d
        out.distance[j] = d
        out.ahead[j] = dx * q.axis_x + dy * q.axis_y


@kernel
def predict_by_rays(readings: Records[Reading], x: float, y: float, radius: float, out: Predictions) -> None:
    """Write what a circle that rays meet predicts of readings among which there is no cross path."""
    for j in range(len(readings)):
        q = readings[j]
        dx = x - q.x
        dy = y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        r, slope_x, slope_y, ahead = ray_over_circle(q, dx, dy, d, radius, out.half_angle, out.rays)
        out.error[j] = q.range_m - r
        out.slope_x[j] = slope_x
        out.slope_y[j] = slope_y
        out.distance[j] = d
        out.ahead[j] = ahead


@loop_kernel
def predict_any(
    readings: Records[Reading],
    x: float,
    y: float,
    radius: float,
    error: Floats,
    slope_x: Floats,
    slope_y: Floats,
    distance: Floats,
    ahead: Floats,
) -> None:
    """Write what a circle predicts of readings; see `predict_circle`.

    Both ways are computed for each reading, and one is taken: without a branch, and with a number of passes that the
    compiler can bound, a processor takes eight in the time of one or two.
    """
    for j in range(len(readings)):
        q = readings[j]
        dx = x - q.x
        dy = y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        half, half_x, half_y = over_circle(q, dx, dy, radius)
        is_echo = q.listener_x == 0.0 and q.listener_y == 0.0
        per_d = 1.0 / max(d, LENGTH_MIN_M)
        error[j] = q.range_m - (d - radius if is_echo else half)
        slope_x[j] = dx * per_d if is_echo else half_x
        slope_y[j] = dy * per_d if is_echo else half_y
        distance[j] = d
        ahead[j] = dx * q.axis_x + dy * q.axis_y


@kernel
def predict_circle(readings: Records[Reading], x: float, y: float, radius: float, out: Predictions) -> None:
    """Write what a circle predicts of readings. An echo before all cross paths takes a sixth of the time of one.

    Parameters
    ----------
    readings : (n,) Reading
        Raw ranges.
    x, y, radius : float
        Centre and radius, m.
    out : Predictions
        Its first n are written, for the rays it gives.
    """
    k = leading_echoes(readings)
    if out.rays > 0:
        predict_by_rays(readings[:k], x, y, radius, out)
    else:
        predict_echoes(readings[:k], x, y, radius, out)
    predict_any(
        readings[k:], x, y, radius, out.error[k:], out.slope_x[k:], out.slope_y[k:], out.distance[k:], out.ahead[k:]
    )
