"""Posterior of a circle's centre against its oracle, and its accuracy where ranges are only rounded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.circles.posterior import posterior_circle
from perception.bayes.inference import range_fit
from perception.bayes.memory.elements import GRID_CELLS, Reading
from perception.bayes.memory.scratch import CircleFit, CirclePosterior, LinearReading
from perception.kernel import Floats
from perception.records import Records, records, zeros
from tests import naive_bayes
from tests.perception.bayes.random_tracks import examples, predictions, readings_of
from tests.perception.bayes.range_cases import GATE, HALF_BOX, OPT, Case, cases, noisy_settings, one


def posterior_of(case: Case, readings: Records[Reading], start: tuple[float, ...]) -> Floats:
    """Return centre, root and covariance, each as xx, yx, yy, from a centre and a root."""
    posterior, fields = one(CirclePosterior)
    fields[:5] = start
    linear = records(LinearReading, zeros(LinearReading, len(readings)))
    posterior_circle(
        readings, case.rho, case.p, case.level, predictions(), linear, np.zeros(GRID_CELLS), posterior[0]
    )
    return fields


@examples(8, 150)
def test_the_posterior_equals_its_oracle(examples: int) -> None:
    for case in cases(examples, 4):
        p, frame, spread = naive_bayes.posterior_circle(
            case.used, case.rho, OPT, GATE, case.noise, case.centre.copy(), np.array([[0.01, 0.0], [0.003, 0.015]])
        )
        fields = posterior_of(case, case.readings, (*case.place, 0.01, 0.003, 0.015))
        assert fields[:2] == pytest.approx(p, abs=1e-10)
        assert fields[2:5] == pytest.approx([frame[0, 0], frame[1, 0], frame[1, 1]], abs=1e-9)
        assert fields[5:] == pytest.approx([spread[0, 0], spread[0, 1], spread[1, 1]], abs=1e-10)


@pytest.mark.soak
@pytest.mark.compiled
def test_the_posterior_beats_least_squares_where_ranges_are_only_rounded() -> None:
    """Sixty rounded but otherwise perfect ranges all round a drum: the posterior's mean against the robust fit."""
    p, _ = noisy_settings(np.array([[0.0, 0.0]]))
    case = next(cases(1, 5))._replace(rho=0.3, p=p, level=0)
    rng = np.random.default_rng(5)
    exact, fitted = [], []
    for _ in range(60):
        w = np.zeros((60, 5))
        for j in range(60):
            b, d = rng.uniform(0, 2 * math.pi), rng.uniform(0.5, 3)
            u = np.array([math.cos(b), math.sin(b)])
            w[j] = (*(-d * u), *u, round((d - 0.3) / (2 * HALF_BOX)) * 2 * HALF_BOX)
        fit, out = one(CircleFit)
        pose = posterior_of(case, readings_of(w), (0.01, -0.01, 0.003, 0.0, 0.003))
        args = ((0.01, -0.01, 0.3), p, 9.0, (HALF_BOX**2 / 3, 0.0), 8)
        range_fit.fit_circle(readings_of(w), *args, predictions(), fit[0])
        exact.append(math.hypot(*pose[:2]))
        fitted.append(math.hypot(*out[:2]))
    assert np.mean(exact) < 0.6 * np.mean(fitted)
