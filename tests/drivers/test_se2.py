"""Motion at a constant twist, held against a plain numeric integration."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.messages import Pose
from drivers.se2 import exp, interpolate, log

LENGTH = st.floats(-3.0, 3.0)
TURN = st.one_of(st.floats(-3.1, 3.1), st.floats(-1e-3, 1e-3), st.just(0.0))


def integrate(start: Pose, x: float, y: float, turn: float, share: float, steps: int = 2000) -> Pose:
    """Integrate a body-frame twist over `share` of unit time by the midpoint rule."""
    px, py, dt = start.x, start.y, share / steps
    for k in range(steps):
        heading = start.theta + turn * (k + 0.5) * dt
        px += (x * math.cos(heading) - y * math.sin(heading)) * dt
        py += (x * math.sin(heading) + y * math.cos(heading)) * dt
    return Pose(px, py, start.theta + turn * share)


def close(a: Pose, b: Pose, tolerance: float = 1e-5) -> bool:
    return math.dist((a.x, a.y, a.theta), (b.x, b.y, b.theta)) < tolerance


@pytest.mark.parametrize("turn", [0.0, 1e-9, 9.9e-5, 1.01e-4, -0.3, 1.5, -3.0])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_interpolation_follows_the_arc(turn: float, share: float) -> None:
    start = Pose(4.0, -2.0, 7.5)
    end = integrate(start, 0.8, -0.2, turn, 1.0)
    assert close(interpolate(start, end, share), integrate(start, 0.8, -0.2, turn, share))


def test_a_quarter_circle_passes_through_its_middle() -> None:
    middle = interpolate(Pose(1.0, 0.0, math.pi / 2), Pose(0.0, 1.0, math.pi), 0.5)
    assert close(middle, Pose(math.sqrt(0.5), math.sqrt(0.5), 0.75 * math.pi), 1e-12)


def test_the_ends_are_given_back_as_they_are() -> None:
    start, end = Pose(0.1, 0.2, 0.3), Pose(0.4, 0.5, 0.6)
    assert interpolate(start, end, 0.0) == start
    assert interpolate(start, end, 1.0) == end


def test_past_half_a_turn_the_chord_is_taken() -> None:
    assert close(interpolate(Pose(0, 0, 0), Pose(2, 4, 4.0), 0.5), Pose(1, 2, 2.0), 1e-12)


@given(LENGTH, LENGTH, TURN)
def test_log_undoes_exp(x: float, y: float, turn: float) -> None:
    assert log(exp(x, y, turn)) == pytest.approx((x, y, turn), abs=1e-10)


def test_a_full_turn_has_no_twist() -> None:
    with pytest.raises(ValueError, match="no single twist"):
        log(Pose(1.0, 0.0, 2.0 * math.pi))
