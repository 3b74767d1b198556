"""Score of a box's corner against its oracle, on readings of drums and of corners."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.circles.alternatives import HOPELESS_NAT
from perception.bayes.circles.corner_model import score_corner
from perception.bayes.memory.state import Memory
from tests import naive_bayes
from tests.perception.bayes.random_tracks import (
    P,
    S,
    enter_readings,
    examples,
    new_memory,
    noises,
    pair,
    predict_own,
    unit,
)
from tests.perception.bayes.range_cases import GATE, OPT, cases


@examples(50, 700)
def test_a_corners_score_equals_its_oracle(examples: int) -> None:
    found, memory = 0, Memory(4, 1)
    for case in cases(examples, 6, ("circle", "edge"), least=12):
        enter_readings(memory, case.used)
        memory.s[0].noise_level = case.level
        predict_own(memory, case.n, case.centre, case.rho)
        got = score_corner(memory.s, case.p, case.n, *case.place, case.rho, case.var0, case.rel2)
        want = naive_bayes.corner(case.used, case.centre, case.rho, OPT, GATE, case.var0, case.rel2, case.noise)
        if want is None:
            assert got == HOPELESS_NAT
        else:
            found += 1
            assert got == pytest.approx(want, abs=1e-6)
    assert found > 0.28 * examples


def test_a_corner_explains_the_ranges_of_a_corner_better_than_a_circle_does() -> None:
    """Exact ranges to two faces that meet at the origin, each heard from its own side, and to their edge between."""
    memory, along = new_memory(), np.linspace(-0.9, 0.9, 40)
    places = 1.5 * unit(along)
    w = np.zeros((40, 5))
    for j, (place, bearing) in enumerate(zip(places, along, strict=True)):
        normal = 0.5 if bearing > 0.5 else -0.5 if bearing < -0.5 else bearing
        facing = unit(normal)
        w[j] = (*place, *-facing, float(place @ facing))
    enter_readings(memory, w)
    centre = -0.3 * unit(0.0)
    noise = noises()[int(memory.s[0].noise_level)]
    circle = naive_bayes.score_circle(
        w, centre, 0.3, (S.cos_may_answer, S.cos_half_angle, S.cos_must_answer), S.gate_m, S.missed_echo_nat,
        S.short_echo_nat, noise,
    )  # fmt: skip
    predict_own(memory, 40, centre, 0.3)
    corner = score_corner(memory.s, P, 40, *pair(centre), 0.3, 1e-4, 0.0)
    assert corner > circle["llr"] - 1.0
    assert corner > 0.0
    assert math.isfinite(corner)
