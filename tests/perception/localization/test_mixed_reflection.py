"""The mixture of both models of reflection, against its formula for one reading."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.mixed_reflection import mixed_ratio, range_variance
from perception.localization.range_likelihood import HEARD_SHARE, RangeModel, log_ratio
from perception.localization.room import make_room
from perception.localization.surroundings import make_surroundings
from tests.naive_known_room import naive_density

MODEL = RangeModel(0.03, 5.0)
SENSOR = make_surroundings(make_room(np.array([[0.0, 0.0, 1.0, 0.0]])), MODEL, 0.2).sensor


@pytest.mark.parametrize("measured", [1.0, 1.1, 3.0, math.inf])
@pytest.mark.parametrize("ranges", [(1.0, 1.0), (1.0, math.inf), (math.inf, 1.1), (math.inf, math.inf)])
def test_a_reading_is_from_either_model(measured: float, ranges: tuple[float, float]) -> None:
    cone, specular = ranges
    found, fits_cone, fits_specular, prefers = mixed_ratio(SENSOR, measured, cone, 0.01, specular, 0.02, 0.3)
    (a, echo_a), (b, echo_b) = (
        naive_density(MODEL, measured, cone, 0.01),
        naive_density(MODEL, measured, specular, 0.02),
    )
    anywhere = 1.0 - HEARD_SHARE if math.isinf(measured) else HEARD_SHARE / MODEL.window_m
    total = 0.7 * a + 0.3 * b
    assert found == pytest.approx(math.log(total / anywhere))
    assert (fits_cone, fits_specular) == pytest.approx((0.7 * echo_a / total, 0.3 * echo_b / total))
    assert prefers == pytest.approx(0.3 * b / total)


@pytest.mark.parametrize(("measured", "expected"), [(1.0, 1.02), (2.0, math.inf), (math.inf, 2.0)])
def test_a_share_of_one_is_one_model(measured: float, expected: float) -> None:
    found, fits_cone, fits, prefers = mixed_ratio(SENSOR, measured, 4.0, 0.0, expected, 0.0, 1.0)
    alone, fits_alone = log_ratio(MODEL, np.array(measured), np.array(expected))
    assert (found, fits) == pytest.approx((float(alone), float(fits_alone)))
    assert (fits_cone, prefers) == (0.0, 1.0)


def test_the_variance_is_the_range_models() -> None:
    for range_m in (0.2, 3.0, 9.0, math.inf):
        assert range_variance(SENSOR, range_m) == pytest.approx(float(MODEL.sigma(np.array(range_m))) ** 2)
