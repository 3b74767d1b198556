"""What a detected object holds, by either method."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from perception.detected_object import DetectedObject, MapCounts
from perception.pipeline import Perception
from tests.perception.edited import is_bayes


@pytest.mark.covered
def test_objects_hold_what_their_method_knows(seen: Perception) -> None:
    objects = seen.objects()
    assert len(objects) >= 4
    for o in objects:
        assert o.model in {"drum", "box"}
        assert all(math.isfinite(v) for v in (o.x, o.y, o.theta))
        assert 0.0 < o.sigma < 0.1
        assert 0.0 < o.score <= 1.0
        assert o.support > 0
        assert (o.confirmed, o.placed) == (False, False)
        if is_bayes(seen):
            assert o.probability == o.score
            assert o.covariance is not None
            xx, xy, yy = o.covariance
            worst = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)
            assert o.sigma == pytest.approx(math.sqrt(worst), rel=1e-6)
        else:
            assert (o.probability, o.covariance) == (None, None)
    assert [o.score for o in objects] == sorted((o.score for o in objects), reverse=True)
    numbers = [o.number for o in objects]
    assert len(set(numbers)) == len(numbers)


def test_counts_are_those_of_the_map(seen: Perception) -> None:
    counts = seen.counts
    assert isinstance(counts, MapCounts)
    assert counts.segments == len(seen.segment_geometry())
    assert counts.segments_total >= counts.segments
    assert counts.hypotheses >= len(seen.objects())


def test_a_wall_ends_where_its_covariance_says() -> None:
    along, c, s = 3.0**2 / 12.0, math.cos(0.5), math.sin(0.5)
    wall = DetectedObject("wall", 1.0, 2.0, 0.5, 0.9, 9, 1.0, 1.0, (c * c * along, c * s * along, s * s * along))
    assert wall.ends == pytest.approx((1.0 - 1.5 * c, 2.0 - 1.5 * s, 1.0 + 1.5 * c, 2.0 + 1.5 * s))
    assert replace(wall, model="drum").ends is None
    assert replace(wall, covariance=None).ends is None


def test_without_more_an_object_is_neither_numbered_nor_edited() -> None:
    wall = DetectedObject("wall", 1.0, 2.0, 0.0, 0.01, 12, 0.9)
    assert (wall.number, wall.probability, wall.covariance, wall.confirmed, wall.placed) == (
        None, None, None, False, False,
    )  # fmt: skip
