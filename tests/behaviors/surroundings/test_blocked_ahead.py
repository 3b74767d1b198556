"""What stays far ahead: an echo of one place and not one that moves along, and the block it is presumed to be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.surroundings.blocked_ahead import (
    POINTS_MAX,
    Ahead,
    Block,
    Pocket,
    between,
    blocked_ahead,
    outline,
    pocket_ahead,
    presume,
    widen,
)
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
    block = presume(Ahead(0.0, 0.0, 0.0, 6.0), Pose(1.0, 0.0, 0.0), 0.0, 0.9)
    assert (block.front_m, block.back_m, block.low_m, block.high_m) == (0.9, 5.0, 0.0, 0.0)
    wider = widen(block, np.array([[6.0, 0.7]]), Pose(1.0, 0.7, 0.0))
    assert (wider.low_m, wider.high_m) == (0.0, 0.7)
    assert widen(wider, NOTHING, Pose(1.0, 1.5, 0.0)) is wider
    assert outline(wider)[:, 0].max() == pytest.approx(6.0)


def heard(ranges: dict[float, float]) -> Floats:
    """Return echoes by the bearing of their sensor, degrees, and range, m, from the origin."""
    return np.array([[r * math.cos(math.radians(at)), r * math.sin(math.radians(at))] for at, r in ranges.items()])


SIDES = {-40.0: 1.8, -25.0: 2.4, -10.0: 4.4, 5.0: 5.0, 20.0: 2.9, 35.0: 2.1}
"""What a ring hears before the mouth of a canyon whose walls answer at any angle: their sides hide the back."""


def test_sides_that_recede_are_a_pocket_as_wide_as_its_mouth() -> None:
    pocket = pocket_ahead(heard(SIDES), Pose(0.0, 0.0, 0.0), 0.0, 8.0)
    assert pocket is not None
    assert pocket.mouth_m == pytest.approx(1.38, abs=0.01)
    assert pocket.back_m == pytest.approx(4.98, abs=0.01)
    assert pocket.low_m == pytest.approx(-1.16, abs=0.01)
    assert pocket.high_m == pytest.approx(1.2, abs=0.01)
    turned = pocket_ahead(heard(SIDES), Pose(0.0, 0.0, 2.0), 0.0, 8.0)
    assert turned == pocket, "the way counts, not where the robot looks"


@pytest.mark.parametrize("ranges", [
    {},
    {-10.0: 4.4, 5.0: 5.0},
    {-40.0: 1.8, 35.0: 2.1},  # a gate
    {-40.0: 3.4, -25.0: 3.1, -10.0: 3.0, 5.0: 3.0, 20.0: 3.1, 35.0: 3.3},  # a wall across the way
    {-40.0: 1.8, -25.0: 2.4, -10.0: 4.4, 5.0: 5.0},  # the left is open
    {-65.0: 3.2, -50.0: 3.5, -35.0: 4.8, -20.0: 6.0, -5.0: 7.0, 10.0: 6.5, 25.0: 5.0, 40.0: 4.0, 55.0: 3.3},  # a room
])  # fmt: skip
def test_what_is_open_flat_or_wide_is_no_pocket(ranges: dict[float, float]) -> None:
    assert pocket_ahead(heard(ranges).reshape(-1, 2), Pose(0.0, 0.0, 0.0), 0.0, 8.0) is None


def test_nothing_behind_the_goal_makes_a_pocket() -> None:
    assert pocket_ahead(heard(SIDES), Pose(0.0, 0.0, 0.0), 0.0, 4.0) is None


def test_the_echoes_of_a_pocket_are_one_although_they_move_along() -> None:
    ahead = None
    for k in range(round(0.4 / STEP_M) + 1):
        pose = Pose(k * STEP_M, 0.0, 0.0)
        echoes = heard(SIDES) + np.array([pose.x, 0.0])
        pocket = pocket_ahead(echoes, pose, 0.0, 8.0)
        ahead = blocked_ahead(echoes, pose, 0.0, 8.0, ahead, STEP_M, 0.6, pocket)
    assert ahead is not None
    assert ahead.is_sure
    block = presume(ahead, Pose(0.4, 0.0, 0.0), 0.0, 0.9, pocket)
    assert block.front_m == 0.9
    assert block.back_m == pytest.approx(4.98, abs=0.01)
    assert block.low_m < -1.1 < 1.1 < block.high_m


@pytest.mark.parametrize(("pose", "grows"), [
    (Pose(0.0, 0.2, 0.0), True), (Pose(1.5, 0.2, 0.0), False), (Pose(0.0, 1.0, 0.0), False),
])  # fmt: skip
def test_a_block_is_as_wide_as_a_pocket_that_is_seen_from_before_it(pose: Pose, grows: bool) -> None:
    thin = Block(0.0, 0.0, 0.0, 0.9, 5.0, 0.0, 0.0)
    wide = widen(thin, NOTHING, pose, Pocket(2.0, 5.0, -1.0, 1.0))
    assert (wide.front_m, wide.low_m, wide.high_m) == ((1.0, -0.8, 1.2) if grows else (0.9, 0.0, 0.0))


def test_a_line_has_both_ends_and_a_bounded_number_of_points() -> None:
    points = between(0.0, 0.0, 1.0, 0.0)
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [1.0, 0.0]
    assert len(between(0.0, 0.0, 1e6, math.pi)) <= POINTS_MAX + 2
