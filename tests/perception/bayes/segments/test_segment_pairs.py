"""Segments from pairs of readings, against their oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.scratch import PairSegment
from perception.bayes.segments.segment_pairs import tangent
from perception.kernel import Floats
from perception.records import records, zeros
from tests import naive_bayes
from tests.perception.bayes.random_tracks import examples, numbers, readings_of

FIELDS = 6
"""Fields of a pair's segment but for its reading: middle, normal, length and the deviation of the direction."""


def tangent_of(first: tuple[float, ...], second: tuple[float, ...], cos_half: float, var: float) -> Floats | None:
    """Return the segment of two readings (place, axis, range) as an array, None where there is none."""
    segment = zeros(PairSegment, 1)
    a, b = readings_of(np.array([first, second]))
    found = tangent(a, b, cos_half, var, records(PairSegment, segment)[0])
    return numbers(segment)[0, :FIELDS] if found else None


@examples(1500, 6000)
def test_tangents_equal_their_oracle(examples: int) -> None:
    rng = np.random.default_rng(2)
    half = math.radians(12)
    found = 0
    for _ in range(examples):
        a = np.array([*rng.normal(size=2), rng.uniform(-math.pi, math.pi), rng.uniform(0.2, 4)])
        b = np.array([*(a[:2] + rng.normal(size=2) * 0.4), a[2] + rng.normal() * 0.1, a[3] + rng.normal() * 0.15])
        rows = [(q[0], q[1], math.cos(q[2]), math.sin(q[2]), q[3]) for q in (a, b)]
        out = tangent_of(rows[0], rows[1], math.cos(half), 0.0004)
        expected = naive_bayes.tangent(a, b, half)
        assert (out is not None) == (expected is not None)
        if expected is None or out is None:
            continue
        found += 1
        middle, alpha = expected
        normal = np.array([math.cos(alpha), math.sin(alpha)])
        assert out[:2] == pytest.approx(middle, abs=1e-9)
        assert out[2:4] == pytest.approx(normal, abs=1e-9)
        ends = np.array([a[:2] + a[3] * out[2:4], b[:2] + b[3] * out[2:4]])
        assert math.dist(*ends) == pytest.approx(out[4], abs=1e-9)
        assert (ends[1] - ends[0]) @ out[2:4] == pytest.approx(0.0, abs=1e-12)
    assert found > 0.08 * examples


def test_a_segments_direction_varies_as_errors_of_its_ranges_cause() -> None:
    rng = np.random.default_rng(3)
    sigma = 0.001
    seen, first = [], tangent_of((0.0, 0.0, 1.0, 0.0, 2.0), (0.0, 0.3, 1.0, 0.0, 2.0), 0.9, sigma**2)
    assert first is not None
    for _ in range(2000):
        r = 2.0 + rng.normal(size=2) * sigma
        out = tangent_of((0.0, 0.0, 1.0, 0.0, r[0]), (0.0, 0.3, 1.0, 0.0, r[1]), 0.9, sigma**2)
        assert out is not None
        seen.append(math.atan2(out[3], out[2]))
    assert np.std(seen) == pytest.approx(first[5], rel=0.05)


def test_readings_of_one_place_or_of_impossible_ranges_have_no_tangent() -> None:
    first = (0.0, 0.0, 1.0, 0.0, 2.0)
    assert tangent_of(first, (0.0, 0.0, 1.0, 0.0, 2.0), -1.0, 0.01) is None
    assert tangent_of(first, (0.0, 0.3, 1.0, 0.0, 2.4), -1.0, 0.01) is None
