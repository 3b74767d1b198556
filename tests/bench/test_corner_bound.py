"""The bound of what echoes say of a corner against cases to check by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.corner_bound import POST_M, best, echoes_of_corners, judge, to_circle, to_line
from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from bench.trials.wall_trials import Corner, listen
from config.load import load_robot
from config.units import FOOT_M
from drivers.messages import Floats

CORNER = Corner(1.0, 0.5, is_edge=True)


def around(half_rad: float, reach_m: float = 0.8) -> tuple[Floats, Floats]:
    """Return places on an arc about the corner, and exact ranges."""
    bearings = np.linspace(-half_rad, half_rad, 12)
    places = np.array([CORNER.x, CORNER.y]) - reach_m * np.column_stack([np.cos(bearings), np.sin(bearings)])
    return places, np.full(len(bearings), reach_m)


def test_a_point_heard_from_around_is_distinguished_from_wall_and_post_and_one_heard_from_one_side_is_not() -> None:
    assert judge(CORNER, *around(1.0), ACOUSTICS) == (True, True, True)
    assert judge(CORNER, *around(0.05), ACOUSTICS)[1:] == (False, False)


def test_a_fit_finds_what_explains_the_ranges() -> None:
    places, _ = around(1.0)
    sigma = np.full(len(places), 0.01)
    post = np.hypot(*(np.array([1.2, 0.3]) - places).T) - POST_M
    at, chi2 = best(to_circle(POST_M), [np.array([1.0, 0.5])], places, post, sigma)
    assert at == pytest.approx([1.2, 0.3], abs=1e-6)
    assert chi2 == pytest.approx(0.0, abs=1e-6)
    wall = 1.5 - places @ [math.cos(0.2), math.sin(0.2)]
    at, chi2 = best(to_line, [np.array([0.0, 1.0])], places, wall, sigma)
    assert at == pytest.approx([0.2, 1.5], abs=1e-6)


def test_echoes_are_those_that_the_trial_counts() -> None:
    ring, room = load_robot("p3dx-sh").ring, furnished_room(3)
    heard = listen(ring, room, 3, FOOT_M)
    found = echoes_of_corners(ring, room, 3, FOOT_M)
    assert [len(ranges) for _, _, ranges in found] == list(heard.echoes)
    assert all(
        np.hypot(*(places - (corner.x, corner.y)).T) == pytest.approx(ranges, rel=0.05)
        for corner, places, ranges in found
    )
