"""Refinement of polygon tracks: status, merging, and a whole refinement of a box whose pose is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.job_records import ASSIGN, JUDGE, LATTICE, NO_JOB, REFINEMENT
from perception.bayes.memory.polygon_parameters import QUANTUM_COST
from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE, Memory
from perception.bayes.tracks import polygon_tracks
from tests.perception.bayes.box_readings import LEVEL, P, heard, keep_polygon_readings
from tests.perception.bayes.random_tracks import SENSORS, TRACKS, examples

THRESHOLD = 0.08


def test_no_reading_ends_a_polygon_that_a_user_marked() -> None:
    memory = Memory(SENSORS, TRACKS)
    track = memory.s[0].polygons[2]
    for mark, left in ((0, FREE), (PLACED, TENTATIVE)):
        track.status, track.log_likelihood_ratio, track.marks = ESTABLISHED, -50.0, mark
        polygon_tracks.update_polygon_status(memory.s, P, track)
        assert track.status == left


@examples(100, 300)
def test_of_two_polygons_in_one_place_the_marked_or_the_likelier_one_stays(examples: int) -> None:
    rng = np.random.default_rng(8)
    inner = float(P[0].polygons[0].inner_radius_m)
    memory = Memory(SENSORS, TRACKS)
    for _ in range(examples):
        memory.clear()
        two = memory.polygons[:2]
        two["status"] = rng.choice([TENTATIVE, ESTABLISHED], 2)
        two["log_likelihood_ratio"], two["hits"] = rng.normal(20, 10, 2), 20.0
        two["x"][1] = apart = float(rng.choice([0.2, 1.0, 2.5])) * inner
        two["number"] = [4, 3]
        two["marks"] = int(rng.choice([0, PLACED])), int(rng.choice([0, CONFIRMED]))
        marked = two["marks"] != 0
        before = two["status"].copy()
        more = two["log_likelihood_ratio"].copy()
        polygon_tracks.merge_polygons(memory.s, P, 0)
        live = two["status"] != FREE
        if apart >= 1.8 * inner:
            assert live.all()
        elif marked.any():
            winner = int(np.argmax(marked)) if marked[0] != marked[1] else int(np.argmax(more))
            assert live.tolist() == [winner == 0, winner == 1]
            assert two["number"][winner] == [4, 3][winner], "a marked polygon keeps its number"
        elif apart < 0.4 * inner:
            winner = int(np.argmax(more))
            assert live.tolist() == [winner == 0, winner == 1]
            assert two["number"][winner] == 3, "twins keep the older number"
        else:
            winner = int(np.argmax(more))
            assert live[winner]
            assert live[1 - winner] == (before[winner] != ESTABLISHED)


@pytest.mark.parametrize(
    ("before", "fields", "after", "stage"),
    [
        (TENTATIVE, {}, ESTABLISHED, LATTICE),
        (TENTATIVE, {"probability": 0.89}, TENTATIVE, JUDGE),
        (TENTATIVE, {"near": 40.0}, TENTATIVE, JUDGE),
        (TENTATIVE, {"sure_hits": 1.0}, TENTATIVE, JUDGE),
        (TENTATIVE, {"hits": 9.0, "near": 9.0}, TENTATIVE, JUDGE),
        (ESTABLISHED, {}, ESTABLISHED, LATTICE),
        (ESTABLISHED, {"probability": 0.5, "near": 39.0}, ESTABLISHED, LATTICE),
        (ESTABLISHED, {"probability": 0.29}, TENTATIVE, JUDGE),
        (ESTABLISHED, {"near": 41.0}, TENTATIVE, JUDGE),
        (ESTABLISHED, {"log_likelihood_ratio": 4.9}, FREE, JUDGE),
        (ESTABLISHED, {"log_likelihood_ratio": 30.0 * 2.9 - 8.1}, FREE, JUDGE),
    ],
)
def test_a_polygon_is_established_doubted_and_ended_by_its_evidence(
    before: int, fields: dict[str, float], after: int, stage: int
) -> None:
    memory = Memory(SENSORS, TRACKS)
    track, job = memory.s[0].polygons[0], memory.s[0].job
    values = {"log_likelihood_ratio": 200.0, "probability": 0.95, "hits": 30.0, "near": 30.0, "sure_hits": 2.0}
    track.status, job.stage, track.covariance.xx = before, JUDGE, 1e-4
    for name, value in (values | fields).items():
        setattr(track, name, value)
    polygon_tracks.update_polygon_status(memory.s, P, track)
    assert (track.status, job.stage) == (after, stage)


@pytest.mark.parametrize("marks", [0, PLACED])
def test_a_refinement_finds_a_box_from_beside_it_and_a_placed_one_stays_until_it_is_sure(marks: int) -> None:
    rng, memory = np.random.default_rng(2), Memory(SENSORS, TRACKS)
    s, truth = memory.s, np.array([0.3, -0.2, 0.4])
    s[0].noise_level = LEVEL
    track = s[0].polygons[3]
    keep_polygon_readings(memory, 3, heard(rng, truth, 24, 0.0, 1))
    track.status, track.unseen, track.number, track.marks = TENTATIVE, 24, 1, marks
    beside = (truth + np.array([0.04, -0.03, 0.05])).tolist()
    track.x, track.y, track.heading = beside
    assert polygon_tracks.begin_refinement(s, P, THRESHOLD)
    job = s[0].job
    assert (job.kind, job.stage, job.track, job.reading_count) == (REFINEMENT, ASSIGN, 3, 24)
    assert (track.unseen, track.refinements) == (0, 1)
    while job.kind != NO_JOB:
        polygon_tracks.advance_refinement(s, memory.tracks, P, QUANTUM_COST)
    assert track.status == ESTABLISHED
    assert track.reservoir == 24
    assert track.probability > 0.9
    assert 0.0 < track.covariance.xx < 0.01
    if marks == PLACED:
        assert [track.x, track.y, track.heading] == beside
        return
    assert math.dist((track.x, track.y), truth[:2]) < 0.02
    assert abs((track.heading - truth[2] + 0.25 * math.pi) % (0.5 * math.pi) - 0.25 * math.pi) < 0.05
    assert not polygon_tracks.polygon_quantum(s, memory.tracks, P, THRESHOLD), "nothing is left to do"


def test_an_idle_polygon_uses_up_its_final_refinements() -> None:
    memory = Memory(SENSORS, TRACKS)
    track = memory.s[0].polygons[0]
    track.status, track.idle_firings, track.final_refinements = ESTABLISHED, P[0].idle_firings + 1, 2
    for left in (1, 0):
        assert polygon_tracks.begin_refinement(memory.s, P, THRESHOLD)
        assert track.final_refinements == left
    assert not polygon_tracks.begin_refinement(memory.s, P, THRESHOLD)
