"""A base that obeys within its limits: as fast as it may, never past the command, the same in one step as in many."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import load_robot
from drivers.base_model import obeyed, stop_s
from drivers.messages import Twist


def test_one_step_is_as_many_and_keeps_the_limits() -> None:
    rng, body = np.random.default_rng(0), load_robot("b21r").body
    for _ in range(200):
        asked = Twist(*rng.uniform(-2.0, 2.0, 2).tolist())
        before = many = Twist(
            float(rng.uniform(-1.0, 1.0)) * body.speed_max_m_s, float(rng.uniform(-1.0, 1.0)) * body.turn_max_rad_s
        )
        lasted_s = float(rng.uniform(0.0, 1.0))
        for _ in range(50):
            many = obeyed(many, asked, body, lasted_s / 50.0)
        once = obeyed(before, asked, body, lasted_s)
        assert (once.v, once.w) == pytest.approx((many.v, many.w), abs=1e-9)
        assert abs(once.v) <= body.speed_max_m_s
        assert abs(once.w) <= body.turn_max_rad_s
        assert abs(once.v - before.v) <= body.acceleration_max_m_s2 * lasted_s + 1e-12
        end = obeyed(before, asked, body, 100.0)
        assert end.v == max(-body.speed_max_m_s, min(body.speed_max_m_s, asked.v))


@pytest.mark.parametrize(("v", "w"), [(0.4, 0.1), (-0.2, 1.0), (0.0, 0.0)])
def test_a_base_stands_after_the_time_that_it_takes_to_stop_and_not_before(v: float, w: float) -> None:
    body, still = load_robot("p3dx").body, Twist(0.0, 0.0)
    needed_s = stop_s(Twist(v, w), body)
    assert obeyed(Twist(v, w), still, body, needed_s + 1e-9) == still
    assert needed_s == 0.0 or obeyed(Twist(v, w), still, body, 0.99 * needed_s) != still


@pytest.mark.parametrize("v", [-0.4, -0.1, 0.0, 0.1, 0.4])
def test_a_slower_velocity_is_on_the_same_curve(v: float) -> None:
    slow = Twist(v, 0.3).at_most(0.2)
    assert abs(slow.v) <= 0.2
    assert slow.v * 0.3 == pytest.approx(slow.w * v)
    assert (slow == Twist(v, 0.3)) is (abs(v) <= 0.2)
