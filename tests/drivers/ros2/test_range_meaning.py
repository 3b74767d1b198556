"""What a range of a ROS node means: whatever its habits are, silence and faults are never an obstacle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ros2.range_meaning import Limits, Oddity, range_meaning
from tests.examples import examples

UNIT_M = 0.001
RING = Limits(0.05, 4.0)
UNKNOWN = Limits(math.nan, math.nan)


def heard(value: float, ring: Limits = RING, sensor: Limits = UNKNOWN, *, zero_is_silence: bool = False) -> float:
    return range_meaning(value, ring, sensor, UNIT_M, zero_is_silence=zero_is_silence).range_m


@examples(1.0)
@given(
    st.floats(0.5, 12.0).map(lambda value: round(value, 4)), st.floats(0.01, 0.3),
    st.sampled_from(["its maximum", "its maximum in float32", "more", "inf"]), st.booleans(),
)  # fmt: skip
def test_each_way_to_say_silence_is_silence(greatest_m: float, least_m: float, habit: str, with_limits: bool) -> None:
    value = {
        "its maximum": greatest_m, "its maximum in float32": float(np.float32(greatest_m)),
        "more": 1.01 * greatest_m, "inf": math.inf,
    }[habit]  # fmt: skip
    own = Limits(float(np.float32(least_m)), float(np.float32(greatest_m)))
    assert heard(value, Limits(least_m, greatest_m), own if with_limits else UNKNOWN) == math.inf


def test_a_sensor_of_shorter_range_than_the_ring_is_silent_at_its_own_maximum() -> None:
    assert heard(2.0, RING, Limits(0.02, 2.0)) == math.inf
    assert heard(1.9, RING, Limits(0.02, 2.0)) == 1.9
    assert heard(2.0) == 2.0


@pytest.mark.parametrize("sensor", [UNKNOWN, Limits(0.0, 0.0), Limits(4.0, 4.0), Limits(3.0, 1.0), Limits(-1.0, 2.0),
                                    Limits(0.0, math.inf), Limits(math.nan, 2.0)])  # fmt: skip
def test_limits_between_which_no_range_lies_are_passed_over(sensor: Limits) -> None:
    assert heard(1.3, RING, sensor) == 1.3
    assert heard(4.0, RING, sensor) == math.inf


@examples(0.5)
@given(st.floats(allow_nan=True, allow_infinity=True, width=32), st.floats(0.0, 1.0), st.floats(1.5, 12.0))
def test_what_is_used_lies_between_the_limits(value: float, least_m: float, greatest_m: float) -> None:
    meaning = range_meaning(value, Limits(least_m, greatest_m), UNKNOWN, UNIT_M, zero_is_silence=False)
    if math.isfinite(meaning.range_m):
        assert meaning.range_m == value
        assert least_m - UNIT_M <= value < greatest_m
    else:
        assert not least_m + UNIT_M < value < greatest_m - UNIT_M


@pytest.mark.parametrize(
    ("value", "oddity"),
    [(0.0, Oddity.ZERO), (-1.0, Oddity.ZERO), (0.03, Oddity.BELOW), (-math.inf, Oddity.TOO_NEAR), (math.nan, None)],
)
def test_what_is_below_the_least_range_is_no_obstacle_and_has_a_line(value: float, oddity: Oddity | None) -> None:
    meaning = range_meaning(value, RING, UNKNOWN, UNIT_M, zero_is_silence=False)
    assert math.isnan(meaning.range_m)
    assert meaning.oddity is oddity


def test_the_option_settles_what_zero_means() -> None:
    assert heard(0.0, zero_is_silence=True) == math.inf
    assert heard(-1.0, zero_is_silence=True) == math.inf
    assert math.isnan(heard(0.03, zero_is_silence=True))


def test_a_ranger_with_a_fixed_distance_gives_no_distance() -> None:
    """REP 117: equal limits, -inf for a detection, +inf for none."""
    fixed = Limits(0.3, 0.3)
    assert math.isnan(heard(-math.inf, RING, fixed))
    assert heard(math.inf, RING, fixed) == math.inf
