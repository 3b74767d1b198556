"""A heading that turns steadily: by a share of the angle, the short way round, and not for what is negligible."""

from __future__ import annotations

import math

import pytest

from behaviors.steady_heading import HELD_RAD, held, turned_towards
from perception.percept import wrap_angle


@pytest.mark.parametrize(("last", "wanted", "turned"), [
    (0.0, 1.0, 0.25), (0.5, -0.5, 0.25), (3.0, -3.0, 3.0 + 0.25 * (2.0 * math.pi - 6.0)), (1.0, 1.0, 1.0),
])  # fmt: skip
def test_it_turns_by_a_share_the_short_way_round(last: float, wanted: float, turned: float) -> None:
    assert wrap_angle(turned_towards(last, wanted, 0.25) - turned) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("off", "asked"), [(0.5, 0.0), (-1.0, 0.0), (1.5, 0.75), (2.0, 2.0), (-40.0, -40.0)])
def test_a_heading_that_hardly_differs_is_held(off: float, asked: float) -> None:
    assert held(3.1, 3.1 + off * HELD_RAD) == pytest.approx(3.1 + asked * HELD_RAD, abs=1e-12)
