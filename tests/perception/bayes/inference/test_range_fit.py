"""Scores and fits of circles and lines against their oracles, on random readings of circles, edges and walls."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.inference import range_fit
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.scratch import CircleFit, LineFit, LineScore, Score
from perception.kernel import Floats
from perception.records import Records
from perception.shared_numbers import FAR
from tests import naive_bayes
from tests.perception.bayes.random_tracks import examples, pair, predictions, readings_of
from tests.perception.bayes.range_cases import COSINES, GATE, MISS, OPT, SHORT, Case, cases, one


def score_circle(case: Case, readings: Records[Reading], x: float, y: float) -> Floats:
    """Return the fields of the score: evidence, hits, misses, near, closest, dispersion, sure hits."""
    score, fields = one(Score)
    range_fit.score_circle(readings, x, y, case.rho, case.p, case.level, predictions(), score[0])
    return fields


def first_normal(case: Case) -> np.ndarray:
    """Return the unit vector from the sensors' mean place to the centre."""
    to = case.centre - case.used[:, :2].mean(0)
    return np.asarray(to / np.hypot(*to))


@examples(100, 2000)
def test_a_circles_score_equals_its_oracle(examples: int) -> None:
    hits = 0.0
    for case in cases(examples, 1):
        fields = score_circle(case, case.readings, *case.place)
        want = naive_bayes.score_circle(case.used, case.centre, case.rho, COSINES, GATE, MISS, SHORT, case.noise)
        names = ("llr", "hits", "throughs", "near", "closest")
        assert fields[:5] == pytest.approx([want[name] for name in names], rel=1e-12, abs=1e-11)
        assert fields[5] == pytest.approx(want["dispersion"], abs=1e-12)
        hits += fields[1]
    assert hits > 5 * examples


@examples(60, 2000)
def test_a_circles_fit_equals_its_oracle(examples: int) -> None:
    for case in cases(examples, 2):
        fit, out = one(CircleFit)
        assert range_fit.fit_circle(
            case.readings, (*case.place, case.rho), case.p, 9.0, (case.var0, case.rel2), 4, predictions(), fit[0]
        )  # fmt: skip
        p, info = naive_bayes.fit_circle(
            case.used, case.centre, case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4
        )  # fmt: skip
        assert out[:2] == pytest.approx(p, abs=1e-10)
        assert out[2:] == pytest.approx([info[0, 0], info[0, 1], info[1, 1]], rel=1e-7, abs=1e-7)


@examples(60, 2000)
def test_a_lines_fit_and_score_equal_their_oracles(examples: int) -> None:
    for case in cases(examples, 3):
        n0, (fit, out), (score, fields) = first_normal(case), one(LineFit), one(LineScore)
        range_fit.fit_reading_line(
            case.readings, (*pair(n0), -case.rho), case.place, (OPT, GATE), 9.0, (case.var0, case.rel2), 4, fit[0]
        )
        n, c = naive_bayes.fit_line(case.used, n0, case.centre, -case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4)
        # With a single reading only the damping determines the turn: hence not 1e-12.
        assert out[:3] == pytest.approx([*n, c], abs=1e-6)
        range_fit.score_line(case.readings, fit[0], *case.place, case.p, case.level, score[0])
        want = naive_bayes.score_line(
            case.used, out[:2], case.centre, float(out[2]), COSINES, GATE, MISS, case.noise, FAR
        )
        assert fields == pytest.approx(want, rel=1e-12, abs=1e-11)


def test_without_an_echo_a_fit_does_not_move_and_the_score_has_no_hits() -> None:
    case = next(cases(1, 7))
    silent = case.used.copy()
    silent[:, 4] = FAR
    fit, out = one(CircleFit)
    args = ((0.2, 0.3, 0.3), case.p, 9.0, (case.var0, case.rel2), 4)
    assert range_fit.fit_circle(readings_of(silent), *args, predictions(), fit[0])
    assert out[:2] == pytest.approx([0.2, 0.3], abs=1e-12)
    fields = score_circle(case._replace(rho=0.3), readings_of(silent), 0.2, 0.3)
    assert fields[1] == 0
    assert fields[0] <= 0
