"""Slow forms of what the kernels of a known room compute, written out by their formulas."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from perception.kernel import Floats
from perception.localization.known_room.mixed_reflection import LATE_M, WILD_HEARD
from perception.localization.known_room.particle_update import FIT_STEPS, TEMPER
from perception.localization.known_room.surroundings import FRINGE_RAD
from perception.localization.room.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.room.range_likelihood import HEARD_PRIOR, RangeModel
from perception.localization.room.room import Room


class Causes(NamedTuple):
    """Weights of a reading's causes: they sum to its density, or to the probability of silence."""

    cone: float
    mirror: float
    beside: float
    away: float
    late: float
    wild: float


def naive_causes(
    model: RangeModel, measured: float, cone: tuple[float, float], mirror: tuple[float, float],
    beside: tuple[float, float], shares: tuple[float, ...],
) -> Causes:  # fmt: skip
    """The causes of a reading: each expectation is a range (inf: silence) and its variance; shares as in `Shares`."""
    specular, late_share, wild_share, beside_share = shares
    silent, known = math.isinf(measured), 1.0 - wild_share

    def echo(expected: float, variance: float) -> float:
        if silent:
            return model.dropout
        sigma = math.sqrt(float(model.sigma(np.array(expected))) ** 2 + variance)
        normal = math.exp(-0.5 * ((measured - expected) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
        return (1.0 - model.dropout) * normal

    answers, reflects = (expected[0] <= model.window_m for expected in (cone, mirror))
    is_beside = beside[0] <= model.window_m
    straight = specular * known * (1.0 - is_beside * beside_share)
    is_late = not silent and not reflects and cone[0] < measured <= cone[0] + LATE_M
    return Causes(
        cone=(1.0 - specular) * known * (echo(*cone) if answers else float(silent)),
        mirror=straight * echo(*mirror) if reflects else 0.0,
        beside=specular * known * beside_share * echo(*beside) if is_beside else 0.0,
        away=straight * (1.0 - late_share) if silent and not reflects else 0.0,
        late=straight * late_share / LATE_M if is_late else 0.0,
        wild=wild_share * (1.0 - WILD_HEARD if silent else WILD_HEARD / model.window_m),
    )


def naive_ratio(model: RangeModel, measured: float, causes: Causes) -> float:
    """Log likelihood ratio of a reading to one from anywhere."""
    return math.log(sum(causes) / (1.0 - HEARD_PRIOR if math.isinf(measured) else HEARD_PRIOR / model.window_m))


class Fitted(NamedTuple):
    """A particle after an update."""

    mean: Floats
    covariance: Floats
    log_weight: float
    log_ratio: float
    causes: Causes
    """Probabilities, summed over the readings."""
    could_beside: float
    """The same of a smooth surface, over those where one beside the beam could answer."""


def naive_update(
    room: Room, model: RangeModel, half_angle: float, heading: float, mean: Floats, covariance: Floats,
    readings: Floats, shares: tuple[float, ...],
) -> Fitted:  # fmt: skip
    """A particle's place and scale after some readings, by numpy's matrices; `log_weight` is what is added to it."""
    start, prior = mean, np.linalg.inv(covariance)
    fitted = covariance
    beams: tuple[tuple[Reflection, float], ...] = (
        ("cone", half_angle), ("specular", half_angle), ("specular", half_angle + FRINGE_RAD),
    )  # fmt: skip
    for step in range(FIT_STEPS + 1):
        information, rhs = prior.copy(), prior @ (start - mean)
        log_ratio, could_beside, summed = 0.0, 0.0, np.zeros(len(Causes._fields))
        for x, y, c, s, measured in readings.tolist():
            place = mean[:2] + np.array(
                [math.cos(heading) * x - math.sin(heading) * y, math.sin(heading) * x + math.cos(heading) * y]
            )
            axis = heading + math.atan2(s, c)
            expected, gradients = [], []
            for reflection, half in beams:
                found = expected_ranges(room, Beams(*np.array([[*place, axis]]).T), half, reflection)
                gradient = np.array([found.grad_x[0], found.grad_y[0], 0.0])
                variance = 0.0 if step == FIT_STEPS else float(gradient @ fitted @ gradient)
                expected.append((float(found.range_m[0]), variance))
                gradients.append(gradient)
            if expected[2][0] >= expected[1][0]:  # the nearest one of the wider beam is in the beam itself
                expected[2] = math.inf, 0.0
            causes = naive_causes(model, measured, expected[0], expected[1], expected[2], shares)
            if expected[2][0] <= model.window_m:
                could_beside += (sum(causes) - causes.cone - causes.wild) / sum(causes)
            log_ratio += naive_ratio(model, measured, causes)
            summed += np.array(causes) / sum(causes)
            for cause, (range_m, _), gradient in zip(causes[:3], expected, gradients, strict=True):
                if cause > 0.0 and not math.isinf(measured):
                    weight = TEMPER * cause / sum(causes) / float(model.sigma(np.array(range_m))) ** 2
                    information += weight * np.outer(gradient, gradient)
                    rhs += weight * (measured - range_m) * gradient
        if step < FIT_STEPS:
            fitted = np.linalg.inv(information)
            mean = mean + fitted @ rhs
    off = mean - start
    log_weight = TEMPER * log_ratio - 0.5 * float(off @ prior @ off)
    log_weight += 0.5 * float(np.linalg.slogdet(fitted)[1] - np.linalg.slogdet(covariance)[1])
    return Fitted(mean, fitted, log_weight, log_ratio, Causes(*summed.tolist()), could_beside)
