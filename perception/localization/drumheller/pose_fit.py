"""Fit of poses to all raw ranges.

The place is fitted by least squares at each of a row of headings, because at one heading the ranges are nearly linear
in the place, while in the heading their likelihood has steps: a turn moves echoes into beams and out of them.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from perception.kernel import Floats
from perception.localization.drumheller.panorama import Panorama
from perception.localization.room.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.room.range_likelihood import RangeModel, log_ratio
from perception.localization.room.room import Room

PRIOR_SIGMA_M: Final = 0.3
"""Deviation of a fitted place from its start, m: along a direction that no range fixes, it stays there."""
STEP_MAX_M: Final = 0.3
"""Longest step of the fit, m."""


class Stand(NamedTuple):
    """What all poses are compared with."""

    room: Room
    readings: Panorama
    """All readings, also of several panoramas; none is NaN."""
    half_angle: float
    reflection: Reflection
    model: RangeModel


class FittedPoses(NamedTuple):
    """Poses fitted from n starts at m headings each."""

    x: Floats
    """Shape (n, m), m."""
    y: Floats
    theta: Floats
    """rad"""
    log_ratio: Floats
    """Log likelihood of all readings as a ratio to readings from anywhere, nat."""
    log_area: Floats
    """Log of the area that the fit leaves to the place: 2π √det of its covariance, m²."""


def beams_at(panorama: Panorama, x: Floats, y: Floats, theta: Floats) -> Beams:
    """Return the sensors of a panorama in the map frame, shape (poses, n).

    Parameters
    ----------
    panorama : Panorama
        The sensors in the ring's frame.
    x, y, theta : (poses,) float
        The ring's poses in the map frame, m and rad.
    """
    cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
    return Beams(
        x[:, None] + cos * panorama.x - sin * panorama.y,
        y[:, None] + sin * panorama.x + cos * panorama.y,
        theta[:, None] + panorama.axis,
    )


def fit_poses(stand: Stand, starts: Floats, turns: Floats, steps: int) -> FittedPoses:
    """Return the best places near some poses at some headings around theirs, with the likelihood there.

    Parameters
    ----------
    stand : Stand
        Room and readings.
    starts : (n, 3) float
        Poses x, y (m), heading (rad).
    turns : (m,) float
        Headings to try, from each start's own, rad.
    steps : int
        Steps of the fit: each is one linear solution with weights by the probability that an echo fits.
    """
    shape = (len(starts), len(turns))
    x0, y0 = (np.repeat(starts[:, i], len(turns)) for i in (0, 1))
    theta = (starts[:, 2:] + turns).reshape(-1)
    x, y = x0, y0
    measured = stand.readings.range_m
    for step in range(steps + 1):
        expected = expected_ranges(
            stand.room, beams_at(stand.readings, x, y, theta), stand.half_angle, stand.reflection
        )
        ratio, fits = log_ratio(stand.model, measured, expected.range_m)
        weight = fits / stand.model.sigma(expected.range_m) ** 2
        xx = (weight * expected.grad_x**2).sum(axis=1) + PRIOR_SIGMA_M**-2
        yy = (weight * expected.grad_y**2).sum(axis=1) + PRIOR_SIGMA_M**-2
        xy = (weight * expected.grad_x * expected.grad_y).sum(axis=1)
        det = xx * yy - xy * xy
        if step == steps:
            break
        with np.errstate(invalid="ignore"):
            error = np.where(fits > 0.0, measured - expected.range_m, 0.0) * weight
        bx = (error * expected.grad_x).sum(axis=1) + (x0 - x) * PRIOR_SIGMA_M**-2
        by = (error * expected.grad_y).sum(axis=1) + (y0 - y) * PRIOR_SIGMA_M**-2
        dx, dy = (yy * bx - xy * by) / det, (xx * by - xy * bx) / det
        short = np.minimum(1.0, STEP_MAX_M / np.maximum(np.hypot(dx, dy), 1e-12))
        x, y = x + short * dx, y + short * dy
    area = math.log(2.0 * math.pi) - 0.5 * np.log(det)
    return FittedPoses(*(part.reshape(shape) for part in (x, y, theta, ratio.sum(axis=1), area)))
