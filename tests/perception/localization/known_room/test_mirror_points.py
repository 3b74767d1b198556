"""Mirror points in a beam; test_surroundings.py compares them with numpy's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.localization.known_room.mirror_points import expect_specular
from perception.localization.known_room.surroundings import look_around, make_surroundings
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import make_room
from tests.perception.localization.rooms import HALF_ANGLE, RING

MODEL = RangeModel.of_ring(RING)


def test_a_wall_between_hides_a_mirror_point() -> None:
    room = make_room(np.array([[2.0, -1.0, 2.0, 1.0], [1.0, -0.2, 1.2, 0.2]]))
    around = make_surroundings(room, MODEL, HALF_ANGLE)
    look_around(around, 0.0, 0.0, 0.0)
    assert expect_specular(around, 0.0, 0.0, 1.0, 0.0, around.sensor[0].cos_half)[0][0] == math.inf
    assert expect_specular(around, 0.0, 0.6, 1.0, 0.0, around.sensor[0].cos_half)[0][0] == pytest.approx(2.0)
    assert expect_specular(around, 0.0, 0.6, -1.0, 0.0, around.sensor[0].cos_half)[0][0] == math.inf


@pytest.mark.parametrize("away_m", [0.5 * EDGE_REACH_M, 2.0 * EDGE_REACH_M])
def test_an_edge_answers_from_near_only(away_m: float) -> None:
    around = make_surroundings(make_room(np.array([[away_m, 0.0, away_m + 1.0, 1.0]])), MODEL, HALF_ANGLE)
    look_around(around, 0.0, 0.0, 0.0)
    found = expect_specular(around, 0.0, 0.0, 1.0, 0.0, around.sensor[0].cos_half)[0][0]
    assert found == pytest.approx(away_m if away_m < EDGE_REACH_M else math.inf)
