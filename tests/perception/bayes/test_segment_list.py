"""Copies of the outline map: only the segments in it, as lines of a fixed length."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.elements import BUCKET_CAPACITY
from perception.bayes.segment_list import SHOWN_M, drawn, mapped_segments
from tests.perception.bayes.tracks import add_segment, new_memory, unit


def test_every_segment_in_the_map_is_listed_once_and_as_a_copy() -> None:
    memory = new_memory()
    assert len(mapped_segments(memory)) == 0
    for number in range(1, BUCKET_CAPACITY + 4):
        add_segment(memory, np.array([0.1, 0.1, 1.0, 0.0]), number)
    add_segment(memory, np.array([5.1, 0.1, 1.0, 0.0]), 99)
    listed = mapped_segments(memory)
    assert sorted(listed["number"].tolist()) == [*range(4, BUCKET_CAPACITY + 4), 99]
    listed["number"] = 0
    assert 99 in mapped_segments(memory)["number"]


def test_a_segment_is_drawn_about_its_middle_at_right_angles_to_its_normal() -> None:
    memory, angle = new_memory(), 0.7
    add_segment(memory, np.array([0.4, -0.3, *unit(angle)]), 1)
    ((x1, y1, x2, y2, normal),) = drawn(mapped_segments(memory)).tolist()
    assert (0.5 * (x1 + x2), 0.5 * (y1 + y2)) == pytest.approx((0.4, -0.3))
    assert math.dist((x1, y1), (x2, y2)) == pytest.approx(SHOWN_M)
    assert complex(x2 - x1, y2 - y1) / SHOWN_M == pytest.approx(1j * complex(*unit(angle)))
    assert normal == pytest.approx(angle)
