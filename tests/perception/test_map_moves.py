"""What is remembered moves as rigid bodies, each with its map of the way."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.messages import Pose
from perception.map_moves import MapMoves

MOVES = MapMoves(np.array([[0.0, 0.0, 0.0], [0.5, -0.2, 0.3]]), np.array([[0.0, 0.0], [4.0, 0.0]]))


def test_places_move_with_their_map_and_those_of_the_map_that_goes_on_with_the_last() -> None:
    x, y, turn = MOVES.moved(np.array([0, 1, 2]), np.array([1.0, 2.0, 2.0]), np.array([3.0, -1.0, -1.0]))
    to = Pose(0.5, -0.2, 0.3).compose(Pose(2.0, -1.0, 0.0))
    assert x.tolist() == pytest.approx([1.0, to.x, to.x])
    assert y.tolist() == pytest.approx([3.0, to.y, to.y])
    assert turn.tolist() == [0.0, 0.3, 0.3]


def test_the_nearest_map_is_that_of_the_nearest_way() -> None:
    assert MOVES.nearest(np.array([1.9, 2.1]), np.array([5.0, -5.0])).tolist() == [0, 1]
