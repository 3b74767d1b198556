"""What a circle predicts of many readings at a time, against one reading at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference import cross_path
from perception.bayes.inference.prediction import predict_circle
from perception.bayes.memory.elements import COMPARED_MAX
from tests.perception.bayes.cross_cases import crosses
from tests.perception.bayes.random_tracks import examples, predictions


@examples(20, 400)
def test_many_readings_are_predicted_as_each_is_alone(examples: int) -> None:
    """Echoes alone, cross paths alone, and both in any order: any number of them, as a processor takes eight."""
    rng, out = np.random.default_rng(81), predictions()
    for _ in range(examples):
        n, kinds = int(rng.choice([0, 1, 7, 8, 9, 60, COMPARED_MAX])), int(rng.integers(3))
        rows = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), rng.normal(0, 1, (n, 2)), rng.uniform(0.5, 2, n)])
        across = rng.uniform(-0.3, 0.3, (n, 2)) * rng.choice([[0, 0], [1, 1], [0, 1]][kinds], n)[:, None]
        x, y, radius = rng.uniform(1.2, 2.0), rng.uniform(-1, 1), float(rng.choice([0.0, 0.1067, 0.3048, 0.67]))
        readings = crosses(np.column_stack([rows, across]))
        predict_circle(readings, x, y, radius, out)
        for j in range(n):
            q = readings[j]
            dx, dy = x - q.x, y - q.y
            d = math.hypot(dx, dy)
            slope = (dx / d, dy / d)
            if cross_path.is_crossed(q):
                _, *gradient = cross_path.over_circle(q, dx, dy, radius)
                slope = gradient[0], gradient[1]
            assert out.error[j] == pytest.approx(cross_path.circle_error(q, dx, dy, d, radius), abs=1e-14)
            assert (out.slope_x[j], out.slope_y[j]) == pytest.approx(slope, abs=1e-14)
            assert out.distance[j] == pytest.approx(d, rel=1e-14)
            assert out.ahead[j] == pytest.approx(dx * q.axis_x + dy * q.axis_y, abs=1e-14)


def test_a_circle_that_no_direction_leads_to_is_predicted_without_an_error() -> None:
    """One about a sensor itself, and one in the middle between two."""
    out = predictions()
    readings = crosses(np.array([[0.0, 0, 1, 0, 1, 0, 0], [0.0, 0, 1, 0, 1, 0.2, 0], [0.1, 0, 1, 0, 1, -0.2, 0]]))
    predict_circle(readings, 0.0, 0.0, 0.05, out)
    assert np.isfinite([out.error[:3], out.slope_x[:3], out.slope_y[:3]]).all()
    assert out.error[2] == pytest.approx(1.0 - (0.1 - 0.05), abs=1e-5)
