"""Predicted ranges and evidence of polygons against oracles, and the search for a pose that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.memory.job_records import PoseSearch
from perception.bayes.memory.scratch import Score
from perception.bayes.polygons.cross_path import NO_ANSWER_M
from perception.bayes.polygons.likelihood import begin_search, continue_search, predict
from perception.records import records, zeros
from perception.shared_numbers import FAR
from tests import naive_polygon
from tests.perception.bayes.box_readings import (
    BOX,
    CLOSED,
    LEVEL,
    SIDES,
    P,
    S,
    evidence,
    heard,
    random_outline,
    random_pose,
    rules,
    score,
    sides_between,
)
from tests.perception.bayes.random_tracks import examples, pair, readings_of


@examples(400, 6_000)
def test_a_prediction_equals_its_oracle(examples: int) -> None:
    rng = np.random.default_rng(1)
    seen = np.zeros(5)
    for _ in range(examples):
        outline = random_outline(rng)
        closed = bool(rng.integers(2))
        sensor = complex(*rng.uniform(-2.0, 2.0, 2))
        axis_angle = math.atan2(-sensor.imag, -sensor.real) + rng.uniform(-0.6, 0.6)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        mirror, cone = rules(sensor, axis, np.zeros(3), outline, closed)
        at, must, price, at_cone, must_cone = predict(
            sensor.real, sensor.imag, axis.real, axis.imag, sides_between(outline, closed), closed, P
        )  # fmt: skip
        for expected, actual, actual_must in ((mirror, at, must), (cone, at_cone, must_cone)):
            assert actual == pytest.approx(NO_ANSWER_M if expected.expected is None else expected.expected, abs=1e-12)
            assert actual_must == expected.must
        assert price == pytest.approx(mirror.price, abs=1e-9)
        differ = cone.expected is not None and cone.expected != mirror.expected
        seen += (mirror.must, cone.must and not mirror.must, mirror.price > 0.0, differ, cone.expected is None)
    assert seen.min() > 0.05 * examples


@examples(40, 400)
def test_a_score_equals_its_oracle(examples: int) -> None:
    """On readings of boxes, some of them late, early or lost, at poses a little off."""
    rng = np.random.default_rng(2)
    seen = np.zeros(4)
    for k in range(examples):
        truth = random_pose(rng)
        w = heard(rng, truth, 30, 0.01, k % 2)
        w[rng.uniform(size=30) < 0.3, 4] *= rng.uniform(0.9, 1.8)
        pose = truth + rng.normal(0.0, 0.01, 3)
        readings = []
        for x, y, ux, uy, r in w:
            mirror, cone = rules(complex(x, y), complex(ux, uy), pose, BOX, closed=True)
            level = level_of(P, LEVEL, r)
            nats = [
                0.0 if actual.expected is None else log_likelihood(P, level, r - actual.expected)
                for actual in (mirror, cone)
            ]
            readings.append((r, (mirror, cone), (nats[0], nats[1])))
        expected, sums = naive_polygon.score(readings, S.gate_m, S.missed_echo_nat, S.short_echo_nat)
        found, result = score(w, pose)
        assert found == pytest.approx(expected, abs=1e-9)
        assert result.log_likelihood_ratio == found
        likelier = max(sums, key=lambda s: s["llr"])
        counts = (likelier["hits"], likelier["throughs"], likelier["near"], likelier["sure"])
        assert (result.hits, result.misses, result.near, result.sure_hits) == counts
        seen += counts
    assert seen.min() > 0.37 * examples


@examples(25, 200)
def test_the_evidence_is_greater_at_the_true_pose_than_beside_it(examples: int) -> None:
    rng = np.random.default_rng(3)
    for k in range(examples):
        truth = random_pose(rng)
        w = heard(rng, truth, 60, 0.0, k % 2)
        if np.count_nonzero(w[:, 4] < FAR) < 5:
            continue
        direction = rng.uniform(-math.pi, math.pi)
        beside = truth + 0.1 * np.array([math.cos(direction), math.sin(direction), 0.0])
        assert evidence(w, truth) > evidence(w, beside)


@pytest.mark.compiled
@pytest.mark.soak
@pytest.mark.parametrize("examples", [50, 150])
def test_a_search_finds_the_pose_however_often_it_is_interrupted(examples: int) -> None:
    """From 3 cm and 3° beside it, to a third of the resolution, the width of the likelihood's plateau."""
    rng = np.random.default_rng(4)
    offs = []
    for _ in range(examples):
        truth = random_pose(rng)
        w = heard(rng, truth, 80, 0.0)
        start = truth + np.array([*rng.normal(0.0, 0.03, 2), rng.normal(0.0, 0.05)])
        found = []
        for allowed in (1_000, int(rng.integers(1, 10))):
            search, result = records(PoseSearch, zeros(PoseSearch, 1))[0], records(Score, zeros(Score, 1))[0]
            scored = calls = 0
            begin_search(search, float(start[0]), float(start[1]), float(start[2]), 0.05, 40)
            while search.rounds_left > 0:
                once = continue_search(search, allowed, readings_of(w), 1, SIDES, CLOSED, P, LEVEL, result)
                assert 0 < once <= allowed
                scored, calls = scored + once, calls + 1
            assert scored <= 1 + 6 * 40
            assert calls == math.ceil(scored / allowed)
            found.append((search.x, search.y, search.heading, search.log_likelihood_ratio, search.step_m, scored))
        assert found[0] == found[1]
        pose, after = np.array([search.x, search.y, search.heading]), search.log_likelihood_ratio
        assert after >= evidence(w, start)
        assert after == pytest.approx(evidence(w, pose), abs=1e-9)
        offs.append((math.hypot(pose[0] - truth[0], pose[1] - truth[1]), abs(pose[2] - truth[2])))
    assert np.median([d for d, _ in offs]) < 0.01
    assert np.quantile([d for d, _ in offs], 0.9) < 0.03
    assert np.median([a for _, a in offs]) < math.radians(2.0)


def test_a_search_gains_from_a_pose_beside_the_truth_within_its_rounds() -> None:
    rng = np.random.default_rng(9)
    truth = np.array([0.3, -0.2, 0.4])
    w, start = heard(rng, truth, 30, 0.0), truth + np.array([0.04, -0.03, 0.05])
    search, result = records(PoseSearch, zeros(PoseSearch, 1))[0], records(Score, zeros(Score, 1))[0]
    begin_search(search, *pair(start), float(start[2]), 0.05, 6)
    scored = 0
    while search.rounds_left > 0:
        scored += continue_search(search, 7, readings_of(w), 1, SIDES, CLOSED, P, LEVEL, result)
    assert scored <= 1 + 6 * 6
    assert search.log_likelihood_ratio > evidence(w, start) + 5.0
    assert math.dist((search.x, search.y), truth[:2]) < math.dist(start[:2], truth[:2])


def test_a_step_between_readings_scores_these_readings_only() -> None:
    rng = np.random.default_rng(8)
    truth = np.array([0.3, -0.2, 0.4])
    w = heard(rng, truth, 41, 0.01)
    for every in (1, 2, 3, 50):
        actual, wanted = score(w, truth, every), score(np.ascontiguousarray(w[::every]), truth)
        assert actual[0] == wanted[0]
        for name in ("log_likelihood_ratio", "hits", "misses", "near", "sure_hits"):
            assert getattr(actual[1], name) == getattr(wanted[1], name)
