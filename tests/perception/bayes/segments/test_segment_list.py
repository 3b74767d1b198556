"""Copies of the outline map: only the segments in it, as lines of a fixed length."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.elements import BUCKET_CAPACITY
from perception.bayes.segments.segment_list import (
    SHOWN_M,
    count_again,
    count_map,
    drawn,
    mapped_segments,
    put_segment,
)
from tests.perception.bayes.random_tracks import add_segment, new_memory, unit


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


@pytest.mark.covered
def test_the_map_knows_how_many_segments_it_holds() -> None:
    memory, rng = new_memory(), np.random.default_rng(3)
    # Dense places fill their buckets; far ones take over the buckets of others.
    for number, (x, y) in enumerate(np.concatenate([rng.normal(0.0, 2.0, (300, 2)), rng.normal(0.0, 2e3, (900, 2))])):
        put_segment(memory.s, float(x), float(y), 1.0, 0.0, number, 0.0)
        if number % 40 == 0:
            assert count_map(memory.s, memory.tracks)[0] == len(mapped_segments(memory))
    assert 300 < count_map(memory.s, memory.tracks)[0] == len(mapped_segments(memory)) < 1200
    memory.state["buckets"]["count"][0, ::2] = 0
    count_again(memory)
    assert count_map(memory.s, memory.tracks)[0] == len(mapped_segments(memory)) > 0


def test_the_map_knows_which_buckets_hold_segments() -> None:
    memory, rng = new_memory(), np.random.default_rng(5)
    state = memory.state
    for turn in range(2):
        for x, y in rng.normal(0.0, 5.0 * 100.0**turn, (60, 2)).tolist():
            put_segment(memory.s, x, y, 1.0, 0.0, 1, 0.0)
        used = np.flatnonzero(state["buckets"]["count"][0])
        assert state["used_buckets"][0, : state["buckets_used"][0]].tolist() == used.tolist()
        state["buckets"]["count"][0, used[::3]] = 0
        count_again(memory)
        left = [k for k in used.tolist() if k not in used[::3]]
        held = state["used_buckets"][0]
        assert (held[: len(left)].tolist(), held[len(left) :].any()) == (left, False)


def test_a_segment_is_drawn_about_its_middle_at_right_angles_to_its_normal() -> None:
    memory, angle = new_memory(), 0.7
    add_segment(memory, np.array([0.4, -0.3, *unit(angle)]), 1)
    ((x1, y1, x2, y2, normal),) = drawn(mapped_segments(memory)).tolist()
    assert (0.5 * (x1 + x2), 0.5 * (y1 + y2)) == pytest.approx((0.4, -0.3))
    assert math.dist((x1, y1), (x2, y2)) == pytest.approx(SHOWN_M)
    assert complex(x2 - x1, y2 - y1) / SHOWN_M == pytest.approx(1j * complex(*unit(angle)))
    assert normal == pytest.approx(angle)
