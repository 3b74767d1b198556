"""The simulator of bursts against cases to check by hand."""

from __future__ import annotations

import math

import pytest

from bench.cross_paths import Arrival, Room, arrivals_of, trigger_m
from drivers.messages import Pose

ROOM = Room((0j, 4 + 0j, 4 + 3j, 3j), ((2 + 2j, 0.2),), Pose(1.0, 1.0, 0.0))


def test_paths_of_a_room_are_those_of_images() -> None:
    found = arrivals_of(ROOM, (1 + 1j, 0.0, math.pi), (1 + 1.2j, 0.0, math.pi))
    assert min(found).way_m == pytest.approx(math.hypot(2.0, 0.2)), "the wall behind"
    ways = [arrival.way_m for arrival in found]
    for image in (-1 - 1j, 7 + 1j, 1 - 1j):
        assert any(way == pytest.approx(abs(image - (1 + 1.2j))) for way in ways), image
    ahead = arrivals_of(ROOM, (1 + 1j, 0.0, 0.2), (1 + 1.2j, 0.0, 0.2))
    assert [arrival.way_m for arrival in ahead if arrival.is_direct] == [pytest.approx(math.hypot(6.0, 0.2))]


def test_the_detector_triggers_within_half_a_millimetre_of_the_onset() -> None:
    for loudness in (1.0, 0.3):
        way = trigger_m([Arrival(3.0, loudness, is_direct=True), Arrival(3.05, 1.0, is_direct=True)], 10.0)
        assert 0.0 < way - 3.0 < 5e-4
    assert trigger_m([Arrival(3.0, 0.05, is_direct=True)], 10.0) == math.inf
    assert trigger_m([], 10.0) == math.inf
