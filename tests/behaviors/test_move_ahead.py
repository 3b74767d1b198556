"""Move-ahead: its vector, and the end of a leg as the robot drives along it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.move_ahead import SCHEMA, Leg, move_ahead
from config.behaviors import MoveAheadConfig
from perception.percept import Percept, Pose
from tests.behaviors.views import EVERYWHERE


def at(x: float, y: float, theta: float = 0.0) -> Percept:
    return Percept(Pose(x, y, theta), np.empty((0, 2)), EVERYWHERE)


@pytest.mark.parametrize(
    ("direction_deg", "gain", "expected"),
    [
        (0.0, 1.0, (1.0, 0.0)),
        (90.0, 2.0, (0.0, 2.0)),
        (-180.0, 0.5, (-0.5, 0.0)),
        (30.0, 1.0, (math.sqrt(0.75), 0.5)),
    ],
)
def test_gain_along_the_direction_whatever_the_pose(
    direction_deg: float, gain: float, expected: tuple[float, float]
) -> None:
    config = MoveAheadConfig(move_ahead_gain=gain, move_ahead_direction_deg=direction_deg)
    for percept in (at(0.0, 0.0), at(-70.0, 9.0, 2.5)):
        response, leg = move_ahead(percept, Leg(0.0, 0.0), config)
        assert response.schema == SCHEMA
        assert (response.x, response.y) == pytest.approx(expected, abs=1e-15)
        assert leg == Leg(0.0, 0.0)


def test_an_unlimited_leg_continues() -> None:
    response, leg = move_ahead(at(1e9, 0.0), Leg(0.0, 0.0), MoveAheadConfig())
    assert (response.x, leg.done, leg.outbound) == (1.0, False, True)


def test_stops_at_the_distance_and_stays_done_when_pushed_back() -> None:
    config = MoveAheadConfig(move_ahead_direction_deg=90.0, distance_m=2.0)
    leg = Leg.starting_at(Pose(5.0, 1.0, 0.0))
    response, leg = move_ahead(at(5.0, 2.999), leg, config)
    assert (response.y, leg.done) == (1.0, False)
    response, leg = move_ahead(at(9.0, 3.0), leg, config)
    assert (response.x, response.y, leg.done) == (0.0, 0.0, True)
    response, leg = move_ahead(at(5.0, 1.0), leg, config)
    assert (response.x, response.y, leg.done) == (0.0, 0.0, True)


def test_distance_counts_along_the_heading_only() -> None:
    response, leg = move_ahead(at(1.9, 50.0), Leg(0.0, 0.0), MoveAheadConfig(distance_m=2.0))
    assert (response.x, leg.done) == (1.0, False)


def test_drives_back_and_forth_until_it_is_stopped() -> None:
    config = MoveAheadConfig(distance_m=1.0, at_end="turn_back")
    leg, seen = Leg(2.0, 0.0), []
    for x in (2.0, 2.9, 3.0, 3.1, 2.5, 2.1, 2.0, 1.9, 2.5, 3.0, 2.5):
        response, leg = move_ahead(at(x, 0.0), leg, config)
        assert not leg.done
        seen.append(response.x)
    assert seen == [1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0]


def test_is_pure() -> None:
    config, leg = MoveAheadConfig(distance_m=1.0), Leg(0.0, 0.0)
    assert move_ahead(at(1.0, 0.0), leg, config) == move_ahead(at(1.0, 0.0), leg, config)
    assert leg == Leg(0.0, 0.0)
