"""What stays far ahead: an echo of one place and not one that moves along, and the block it is presumed to be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.blocked_ahead import POINTS_MAX, Ahead, between, blocked_ahead, outline, presume, widen
from perception.percept import Floats, Pose

STEP_M = 0.02
NOTHING: Floats = np.empty((0, 2))


def driven(echo_x: float, moving: float, way_m: float) -> Ahead | None:
    """Drive along x towards an echo that moves along by a share of the way."""
    ahead = None
    for k in range(round(way_m / STEP_M) + 1):
        x = k * STEP_M
        echo = np.array([[echo_x + moving * x, 0.1]])
        ahead = blocked_ahead(echo, Pose(x, 0.0, 0.0), 0.0, 8.0, ahead, STEP_M, 0.6)
    return ahead


def test_an_echo_of_one_place_becomes_sure() -> None:
    ahead = driven(6.0, 0.0, 0.4)
    assert ahead is not None
    assert ahead.is_sure
    assert ahead.along_m == pytest.approx(6.0, abs=0.01)
    early = driven(6.0, 0.0, 0.2)
    assert early is not None
    assert not early.is_sure


def test_an_echo_that_moves_along_with_the_robot_never_does() -> None:
    for way_m in (0.4, 1.0, 2.0):
        ahead = driven(3.0, 1.0, way_m)
        assert ahead is None or not ahead.is_sure


def test_it_is_forgotten_when_it_is_not_heard_and_when_it_is_near() -> None:
    ahead = driven(6.0, 0.0, 0.4)
    silent = ahead
    for k in range(20):
        silent = blocked_ahead(NOTHING, Pose(0.4 + k * STEP_M, 0.0, 0.0), 0.0, 8.0, silent, STEP_M, 0.6)
    assert silent is None
    assert blocked_ahead(np.array([[6.0, 0.0]]), Pose(4.5, 0.0, 0.0), 0.0, 8.0, ahead, STEP_M, 0.6) is None


def test_a_block_grows_while_the_back_answers_beside_the_robot() -> None:
    block = presume(Ahead(0.0, 0.0, 0.0, 6.0), Pose(1.0, 0.0, 0.0), 0.9)
    assert (block.front_m, block.back_m, block.low_m, block.high_m) == (0.9, 5.0, 0.0, 0.0)
    wider = widen(block, np.array([[6.0, 0.7]]), Pose(1.0, 0.7, 0.0))
    assert (wider.low_m, wider.high_m) == (0.0, 0.7)
    assert widen(wider, NOTHING, Pose(1.0, 1.5, 0.0)) is wider
    assert outline(wider)[:, 0].max() == pytest.approx(6.0)


def test_a_line_has_both_ends_and_a_bounded_number_of_points() -> None:
    points = between(0.0, 0.0, 1.0, 0.0)
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [1.0, 0.0]
    assert len(between(0.0, 0.0, 1e6, math.pi)) <= POINTS_MAX + 2
