"""Alternatives of a polygon: the best circle in its place, and its probability among them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, Memory
from perception.bayes.polygons import alternatives
from perception.shared_numbers import FAR
from tests import naive_bayes
from tests.perception.bayes.box_readings import LEVEL, P, S, enter_job, heard
from tests.perception.bayes.random_tracks import COSINES, SENSORS, TRACKS, noises, unit

INNER = float(S.polygons[0].inner_radius_m)
RADII = [float(it.radius_m) for it in S.circles[: S.circle_count]]


def test_the_best_circle_is_the_likeliest_of_all_radii_on_the_jobs_readings() -> None:
    """Exact ranges to a drum of the library, where a polygon was supposed."""
    memory = Memory(SENSORS, TRACKS)
    memory.s[0].noise_level = LEVEL
    bearings = np.linspace(0.5, 2.5, 30)
    away = RADII[0] + 1.0
    w = np.column_stack([-away * unit(bearings), unit(bearings), np.full(30, 1.0)])
    track = memory.s[0].polygons[0]
    enter_job(memory, w, LEVEL)
    noise = noises()[LEVEL]
    want = naive_bayes.score_circle(
        w, np.zeros(2), RADII[0], COSINES, S.gate_m, S.missed_echo_nat, S.short_echo_nat, noise
    )["llr"]
    assert alternatives.evidence_of_circles(memory.s, P, track) == pytest.approx(want + S.model_prior_nat, abs=1.0)
    w[:, 4] = 2 * FAR
    enter_job(memory, w, LEVEL)
    assert alternatives.evidence_of_circles(memory.s, P, track) == -math.inf, "nothing was heard"


@pytest.mark.parametrize(
    ("marks", "lead", "left"), [(0, 6.1, FREE), (CONFIRMED, 6.1, ESTABLISHED), (0, 5.9, ESTABLISHED)]
)
def test_a_polygons_probability_counts_the_circles_in_its_place_and_removes_the_unlikely(
    marks: int, lead: float, left: int
) -> None:
    rng, memory = np.random.default_rng(34), Memory(SENSORS, TRACKS)
    memory.s[0].noise_level = LEVEL
    enter_job(memory, heard(rng, np.zeros(3), 30, 0.0, 1), LEVEL)
    track = memory.s[0].polygons[0]
    track.status, track.log_likelihood_ratio, track.near = ESTABLISHED, 20.0, 5.0
    own = 20.0 + S.model_prior_nat
    circles, rival = memory.circles, S.model_count
    circles["status"][:2], circles["kind"][:2], circles["marks"][0] = ESTABLISHED, rival, marks
    circles["log_likelihood_ratio"][:2] = own - lead
    circles["x"][1] = S.polygons[0].outer_radius_m + 0.1
    alternatives.compare_circles(memory.s, memory.tracks, P, track)
    assert circles["status"][:2].tolist() == [left, ESTABLISHED], "the other one stands farther away"
    best = alternatives.evidence_of_circles(memory.s, P, track)
    others = [0.0, S.unknown_polygon_nat * 5.0 + S.model_prior_nat, best]
    others += [own - lead] if left == ESTABLISHED else []
    weights = np.exp(np.clip(np.array(others) - own, -60.0, 60.0))
    assert track.probability == pytest.approx(1.0 / (1.0 + weights.sum()), rel=1e-9)
