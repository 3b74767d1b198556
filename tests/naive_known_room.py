"""Slow forms of what the kernels of a known room compute, written out by their formulas."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from perception.kernel import Floats
from perception.localization.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.particle_update import FIT_STEPS, TEMPER
from perception.localization.range_likelihood import HEARD_SHARE, RangeModel
from perception.localization.room import Room


def naive_density(model: RangeModel, measured: float, expected: float, variance: float) -> tuple[float, float]:
    """Density of a reading by one model of reflection, or the probability of silence; and the echo's part of it."""
    answers = expected <= model.window_m
    if math.isinf(measured):
        return (model.dropout if answers else 1.0 - model.outliers), 0.0
    echo = 0.0
    if answers:
        sigma = math.sqrt(float(model.sigma(np.array(expected))) ** 2 + variance)
        echo = math.exp(-0.5 * ((measured - expected) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
        echo *= 1.0 - model.dropout - model.outliers
    return echo + model.outliers / model.window_m, echo


class Fitted(NamedTuple):
    """A particle after an update."""

    mean: Floats
    covariance: Floats
    log_weight: float
    log_ratio: float
    specular: float


def naive_update(
    room: Room, model: RangeModel, half_angle: float, heading: float, mean: Floats, covariance: Floats,
    readings: Floats, specular_share: float,
) -> Fitted:  # fmt: skip
    """A particle's place and scale after some readings, by numpy's matrices; `log_weight` is what is added to it."""
    start, prior = mean, np.linalg.inv(covariance)
    fitted = covariance
    models: tuple[tuple[Reflection, float], ...] = ("cone", 1.0 - specular_share), ("specular", specular_share)
    for step in range(FIT_STEPS + 1):
        information, rhs = prior.copy(), prior @ (start - mean)
        log_ratio, specular = 0.0, 0.0
        for x, y, c, s, measured in readings.tolist():
            place = mean[:2] + np.array(
                [math.cos(heading) * x - math.sin(heading) * y, math.sin(heading) * x + math.cos(heading) * y]
            )
            axis = heading + math.atan2(s, c)
            parts = []
            for reflection, share in models:
                found = expected_ranges(room, Beams(*np.array([[*place, axis]]).T), half_angle, reflection)
                gradient = np.array([found.grad_x[0], found.grad_y[0], 0.0])
                variance = 0.0 if step == FIT_STEPS else float(gradient @ fitted @ gradient)
                density, echo = naive_density(model, measured, float(found.range_m[0]), variance)
                parts.append((share * density, share * echo, float(found.range_m[0]), gradient))
            total = sum(part[0] for part in parts)
            anywhere = 1.0 - HEARD_SHARE if math.isinf(measured) else HEARD_SHARE / model.window_m
            log_ratio += math.log(total / anywhere)
            specular += parts[1][0] / total / len(readings)
            for _, echo, expected, gradient in parts:
                if echo > 0.0:
                    weight = echo / total / float(model.sigma(np.array(expected))) ** 2
                    information += weight * np.outer(gradient, gradient)
                    rhs += weight * (measured - expected) * gradient
        if step < FIT_STEPS:
            fitted = np.linalg.inv(information)
            mean = mean + fitted @ rhs
    off = mean - start
    log_weight = TEMPER * log_ratio - 0.5 * float(off @ prior @ off)
    log_weight += 0.5 * float(np.linalg.slogdet(fitted)[1] - np.linalg.slogdet(covariance)[1])
    return Fitted(mean, fitted, log_weight, log_ratio, specular)
