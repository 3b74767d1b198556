"""Evidence of single readings for an object against oracles, and what a user is shown of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.memory.elements import COMPARED_MAX
from perception.bayes.memory.scratch import OtherCircle, Predictions, Score
from perception.bayes.memory.state import ESTABLISHED
from perception.bayes.reports.evidence import circle_evidence, evidence_of, polygon_evidence
from perception.records import array_of, records, zeros
from tests import naive_bayes, naive_polygon
from tests.perception.bayes import box_readings
from tests.perception.bayes.random_tracks import (
    COSINES,
    TRACKS,
    P,
    S,
    around,
    examples,
    keep,
    new_memory,
    noises,
    numbers,
    place_of,
    random_track,
    readings_of,
)


@examples(15, 200)
def test_the_evidence_of_each_reading_for_a_circle_equals_its_oracle(examples: int) -> None:
    rng, memory, counted = np.random.default_rng(12), new_memory(), 0
    for _ in range(examples):
        memory.circles.view(np.uint8)[...] = 0
        random_track(rng, memory, 0, ESTABLISHED)
        place, rho = place_of(memory, 0), float(memory.circles["radius"][0])
        keep(memory, 0, around(rng, 40, place, rho))
        readings, nats = readings_of(np.zeros((COMPARED_MAX, 5))), np.zeros(COMPARED_MAX)
        scores, predicted = records(Score, zeros(Score, 1)), records(Predictions, zeros(Predictions, 1))
        scratch = scores, predicted, records(OtherCircle, zeros(OtherCircle, TRACKS))
        assert circle_evidence(memory.s, memory.tracks, P, 0, readings, *scratch, nats) == 40
        w = numbers(array_of(readings))[:40, :5]
        noise = noises()[int(memory.s[0].noise_level)]
        want = [
            naive_bayes.score_circle(
                w[j : j + 1], place, rho, COSINES, S.gate_m, S.missed_echo_nat, S.short_echo_nat, noise
            )["llr"]
            for j in range(40)
        ]  # fmt: skip
        assert nats[:40] == pytest.approx(want, rel=1e-12, abs=1e-11)
        counted += int(np.count_nonzero(nats))
        # A circle between the sensor and the track hides the track, so silence is not evidence against it.
        random_track(rng, memory, 1, ESTABLISHED)
        memory.circles["x"][1], memory.circles["y"][1] = 0.5 * (place + w[0, :2])
        memory.circles["radius"][1] = 0.05
        circle_evidence(memory.s, memory.tracks, P, 0, readings, *scratch, nats)
        is_silent = w[0, 4] - (math.dist(place, w[0, :2]) - rho) > S.gate_m
        if is_silent and math.dist(place, w[0, :2]) > 0.1 + 2.5 * rho:
            assert nats[0] == 0.0
    assert counted > 10 * examples


def test_the_evidence_of_each_reading_for_a_polygon_equals_its_oracle() -> None:
    rng, memory = np.random.default_rng(13), new_memory()
    memory.s[0].noise_level = box_readings.LEVEL
    pose = np.array([0.2, -0.3, 0.5])
    w = box_readings.heard(rng, pose, 24, 0.01, 1)
    track = memory.s[0].polygons[1]
    track.status = ESTABLISHED
    track.x, track.y, track.heading = pose.tolist()
    for j, q in enumerate(w):
        held = memory.polygons["bins"][1, j]
        held["readings"][0], held["count"] = (*q, 0.0, 0.0), 1
    heard, nats = readings_of(np.zeros((COMPARED_MAX, 5))), np.zeros(COMPARED_MAX)
    score = records(Score, zeros(Score, 1))
    assert polygon_evidence(memory.s, box_readings.P, 1, heard, score, nats) == 24
    settings, expected = box_readings.P[0], []
    for x, y, ux, uy, r in numbers(array_of(heard))[:24, :5]:
        both = box_readings.rules(complex(x, y), complex(ux, uy), pose, box_readings.BOX, closed=True)
        level = level_of(box_readings.P, box_readings.LEVEL, r)
        errors = [0.0 if it.expected is None else r - it.expected for it in both]
        nat = log_likelihood(box_readings.P, level, errors[0]), log_likelihood(box_readings.P, level, errors[1])
        expected.append(
            naive_polygon.score([(r, both, nat)], settings.gate_m, settings.missed_echo_nat, settings.short_echo_nat)[
                0
            ]
        )
    assert nats[:24] == pytest.approx(expected, abs=1e-9)
    assert (nats[:24] > 0.0).sum() > 5
    before = memory.state.tobytes()
    found = evidence_of(memory, box_readings.P, len(memory.circles) + 1, 7, "box", ())
    assert [arc.nats for arc in found.arcs] == nats[:24].tolist()
    assert memory.state.tobytes() == before, "asking for the evidence changes nothing"


def test_a_user_sees_arcs_sums_and_the_alternatives_that_were_compared() -> None:
    rng, memory = np.random.default_rng(14), new_memory()
    random_track(rng, memory, 2, ESTABLISHED)
    circles, labels = memory.circles, ("semicircle", "edge", "post", "barrel", "wall", "corner")
    circles["kind"][2] = 0
    circles["leads"][2, :6] = (5.0, -3.0, 0.0, -4.0, -5.0, 0.0)
    w = around(rng, 30, place_of(memory, 2), float(circles["radius"][2]))
    keep(memory, 2, w)
    before = memory.state.tobytes(), circles.tobytes()
    found = evidence_of(memory, P, 2, 9, "semicircle", labels)
    assert (found.object, found.model) == (9, "semicircle")
    assert found.rivals == (("edge", -3.0), ("barrel", -4.0), ("wall", -5.0))
    nats = np.array([arc.nats for arc in found.arcs])
    assert len(nats) == 30
    assert (found.supporting, found.opposing) == (nats[nats > 0.0].sum(), nats[nats < 0.0].sum())
    rows = numbers(array_of(readings_of(w)))[:, :5]
    assert sorted((arc.x, arc.y) for arc in found.arcs) == sorted((x, y) for x, y in rows[:, :2].tolist())
    heard = sorted(r for r in rows[:, 4].tolist() if r < 1e3)
    assert sorted(arc.range_m for arc in found.arcs if arc.range_m is not None) == heard
    assert (memory.state.tobytes(), circles.tobytes()) == before
