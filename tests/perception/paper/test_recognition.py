"""The goodness of fit against its oracle in tests/naive.py, on random cases."""

from __future__ import annotations

import numpy as np
import pytest

from perception.paper.recognition import goodness_of_fit
from tests import naive
from tests.perception.random_outlines import EXACT, as_segments, random_segments, random_sides


@pytest.mark.covered
def test_goodness_of_fit_equals_its_oracle() -> None:
    rng = np.random.default_rng(9)
    supported = 0
    for _ in range(300):
        sides = random_sides(rng, int(rng.integers(1, 7)))
        rows = random_segments(rng, 25, 0.8)
        members = rng.permutation(25)[: int(rng.integers(0, 25))].astype(np.int64)
        x, y, theta = (float(v) for v in rng.uniform(-1, 1, 3))
        got = goodness_of_fit(sides, rows, members, x, y, theta, 0.2, 0.6, np.zeros(len(sides), dtype=np.int64))
        model = [naive.Side(*map(float, row)) for row in sides]
        expected = naive.goodness_of_fit(model, as_segments(rows[members]), x, y, theta, 0.2, 0.6)
        assert got == pytest.approx(expected, abs=EXACT)
        supported += got[0]
    assert supported > 150
