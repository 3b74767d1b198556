"""Alternative explanations of a circle's readings against their oracles."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.circles import alternatives
from perception.bayes.inference import noise_estimation
from perception.bayes.memory.state import Memory
from perception.kernel import Floats
from perception.shared_numbers import FAR
from tests import naive_bayes, naive_tracks
from tests.naive_tracks import FT
from tests.perception.bayes.random_tracks import (
    COSINES,
    NOISES,
    RADII,
    P,
    S,
    around,
    enter_readings,
    examples,
    new_memory,
    noises,
    numbers,
    pair,
    predict_own,
    readings_of,
    sigma,
)


def fitted(memory: Memory, name: str) -> Floats:
    """Return the fields of a fit in the scratch."""
    fields: Floats = numbers(memory.state["scratch"][name])[0]
    return fields


@examples(50, 1000)
def test_alternatives_are_fitted_and_scored_on_the_same_readings(examples: int) -> None:
    """The oracle scores the kernel's own fit, to 1e-11; the fits themselves agree less closely.

    A circle's fit agrees to 1e-10 m. A line's may depend on one reading, and then only the 1e-9 that keeps the
    information from being singular determines it: 1e-16 / 1e-9 of rounding in each of the steps.
    """
    rng, memory, compared = np.random.default_rng(3), new_memory(), 0
    s, hopeless = memory.s, alternatives.HOPELESS_NAT
    for _ in range(examples):
        s[0].noise_level = h = int(rng.integers(len(NOISES)))
        rho, rho2 = (float(v) for v in rng.choice(RADII, 2))
        place, n = rng.uniform(-1, 1, 2), int(rng.integers(0, 60))
        w = around(rng, n, place, rho)
        enter_readings(memory, w)
        centre = place + rng.normal(0, 0.02, 2)
        absolute, relative = sigma(memory)
        var0, rel2 = absolute**2 + S.half_resolution_m**2 / 3 + 1e-6 * FT**2, relative**2
        assert noise_estimation.noise_variance(s, P) == pytest.approx((var0, rel2), rel=1e-13)
        aim = naive_tracks.towards(w, centre, rho, S.gate_m)
        predict_own(memory, n, centre, rho)
        bearing = alternatives.mean_bearing(readings_of(w), s[0].scratch.own, *pair(centre), float(S.gate_m))
        assert bearing == pytest.approx(aim, abs=1e-12)
        v = alternatives.fit_other_circle(s, P, n, (*pair(centre), rho), bearing, rho2, 4)
        if not aim.any():
            assert v == hopeless == alternatives.fit_other_line(s, P, n, (*pair(centre), rho), bearing, 4)
            continue
        compared += 1
        if v != hopeless:
            found, _ = naive_bayes.fit_circle(
                w, centre + (rho2 - rho) * aim, rho2, S.cos_may_answer, S.gate_m, 9.0, var0, rel2, 4
            )  # fmt: skip
            fit = fitted(memory, "circle_fit")[:2]
            assert fit == pytest.approx(found, abs=1e-10)
            score = naive_bayes.score_circle(
                w, fit, rho2, COSINES, S.gate_m, S.missed_echo_nat, S.short_echo_nat, noises()[h]
            )
            assert v == pytest.approx(score["llr"], rel=1e-12, abs=1e-11)
        v = alternatives.fit_other_line(s, P, n, (*pair(centre), rho), bearing, 4)
        normal, c = naive_bayes.fit_line(
            w, aim, centre, -rho, S.cos_may_answer, S.gate_m, 9.0, var0, rel2, 4
        )  # fmt: skip
        line = fitted(memory, "line_fit")[:3]
        assert line == pytest.approx([*normal, c], abs=1e-6)
        want = naive_bayes.score_line(
            w, line[:2], centre, float(line[2]), COSINES, S.gate_m, S.missed_echo_nat, noises()[h], FAR
        )  # fmt: skip
        assert v == pytest.approx(want[0], rel=1e-12, abs=1e-11)
    assert compared > 0.8 * examples
