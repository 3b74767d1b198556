"""The outline map against its oracle; the relaxation of bodies onto it is tested with their initiation."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.inference.outline_map import add_to_map, segments_near
from perception.bayes.memory.elements import MappedSegment
from perception.bayes.memory.state import Bucket
from perception.records import records, zeros
from tests import naive_bayes
from tests.perception.bayes.random_tracks import examples, numbers

FIELDS = 7
"""Numbers of a segment that the oracle keeps, of which the first four are middle and normal."""


@examples(300, 2000)
@pytest.mark.parametrize("slots", [8, 64])
def test_the_map_equals_its_oracle(slots: int, examples: int) -> None:
    rng = np.random.default_rng(slots)
    cell = 0.3
    buckets, out = records(Bucket, zeros(Bucket, slots)), zeros(MappedSegment, 2000)
    found = records(MappedSegment, out)
    oracle = naive_bayes.Buckets(slots, 8, cell)
    copied = 0
    for _ in range(examples):
        segment = rng.normal(size=FIELDS)
        px, py, nx, ny = segment[:4].tolist()
        add_to_map(buckets, cell, px, py, nx, ny, 0, 0.0)
        oracle.add(segment)
        x, y = rng.normal(size=2)
        n = segments_near(buckets, cell, x, y, 0.4, found)
        assert sorted(tuple(float(v) for v in row) for row in numbers(out)[:n, :4]) == oracle.near(x, y, 0.4)
        copied += n
    assert copied > 0.05 * examples


def test_no_more_segments_are_copied_than_there_is_room_for() -> None:
    buckets = records(Bucket, zeros(Bucket, 8))
    for _ in range(20):
        add_to_map(buckets, 1.0, 0.1, 0.1, 1.0, 0.0, 0, 0.0)
    for room, count in ((32, 8), (3, 3)):
        assert segments_near(buckets, 1.0, 0.1, 0.1, 0.5, records(MappedSegment, zeros(MappedSegment, room))) == count


def test_a_segment_keeps_its_number_and_time() -> None:
    array = zeros(Bucket, 8)
    k = add_to_map(records(Bucket, array), 1.0, 0.1, 0.2, 0.6, 0.8, 7, 3.5)
    assert array["segments"][k, 0].item() == (0.1, 0.2, 0.6, 0.8, 7, 3.5)
    assert array["count"][k] == 1
