"""Polylines, and when perception gives the same ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Pose
from perception.pipeline import Perception
from tests.perception.halls import settings
from tests.polylines import BEND


def test_it_is_turned_and_shifted_as_the_poses_of_its_points() -> None:
    to = Pose(1.0, -2.0, 0.7)
    turned = BEND.in_frame(to)
    expected = [(at.x, at.y) for at in (to.compose(Pose(x, y, 0.0)) for x, y in BEND.points.tolist())]
    assert turned.points == pytest.approx(np.array(expected))
    assert (turned.number, turned.probability) == (3, 0.9)
    assert turned.in_frame(to.inverse()).points == pytest.approx(BEND.points)


def test_in_its_own_frame_it_is_the_same() -> None:
    assert BEND.in_frame(Pose(0.0, 0.0, 0.0)) is BEND
    assert BEND.in_frame(Pose(0.0, 0.0, math.tau)) is not BEND


def test_its_length_is_that_of_its_pieces() -> None:
    assert BEND.length_m == 2.0


def test_perception_gives_the_same_tuple_until_it_changes() -> None:
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    assert perception.polylines() is perception.polylines()
